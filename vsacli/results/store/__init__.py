"""The result file: written atomically, read with nothing but h5py; format page: docs/file-formats."""

from vsacli.base.interrupts import interrupts_deferred

with interrupts_deferred():
    # When a process ends HDF5 calls into h5py, and crashes, if the import came no further than half its way.
    import h5py  # noqa: F401  # the modules in here import it themselves
