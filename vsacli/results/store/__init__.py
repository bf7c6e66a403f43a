"""The result file: written atomically, read with nothing but h5py; format page: docs/file-formats."""
