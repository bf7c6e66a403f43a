"""The file below HDF5."""

from __future__ import annotations

import io
import os
from typing import Any


class Sink(io.RawIOBase):
    """A file object for h5py whose writing never fails in HDF5's sight.

    HDF5 cannot be unwound from a failed write: closing its file fails as well, and the process then crashes
    at exit. So the first error is kept here, what follows it is dropped, and the caller looks at `error`
    after each step.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self.error: OSError | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a byte."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """The current byte."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """Read bytes that were written before."""
        return self._file.readinto(buffer)

    def write(self, data: Any) -> int:
        """Write all of `data`, or note why not."""
        rest = memoryview(data)
        try:
            while len(rest) and self.error is None:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file, or note why not."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return 0

    def close(self) -> None:
        """Close the file, or note what the file system reports only now."""
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        super().close()
