"""An HDF5 file that is being written: what the disk refuses, and signals, without HDF5 coming to harm."""

from __future__ import annotations

import contextlib
import io
import os
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import h5py

from vsacli.base.interrupts import interrupts_deferred
from vsacli.base.outputs import Staged
from vsacli.base.storage import reporting_storage_errors, storage_error

if TYPE_CHECKING:
    from vsacli.results.store.write_behind import WriteBehind

CHUNK_CACHE_SLOTS = 11
"""Chunks of a dataset that HDF5 finds in its cache: few, since rows are written in order."""

BEHIND_FROM = 2**24
"""Bytes that are written at once, in some 10 ms, before a thread is worth its start."""

BEHIND = 2**25
"""Bytes that may wait to be written: some more than a block of seven joints with all variables."""

SYNCED = 2**26
"""Bytes after which the disk begins to store what was written, so that little is left of that at the end."""


class NewFile:
    """An HDF5 file that is being written.

    HDF5 crashes if an exception crosses its code. So its file is a `Sink`, which raises none, and signals
    that end the run wait until a piece is written.

    Args:
        file: where it is staged.
    """

    def __init__(self, file: Staged) -> None:
        self._staged = file
        self._cleanup = contextlib.ExitStack()
        self._file: Any = None  # h5py has no types
        self._sink: Sink | None = None
        self._behind: WriteBehind | None = None
        self._bytes = self._synced = 0

    @property
    def is_open(self) -> bool:
        """Whether it is open."""
        return bool(self._file)

    def open(self) -> h5py.File:
        """Open the file, which is empty; within `used`.

        Raises:
            StorageError: it cannot be written.
        """
        with reporting_storage_errors(self._staged.path):
            raw = self._staged.temporary.open("r+b", buffering=0)
        self._sink = self._cleanup.enter_context(Sink(raw))
        file = h5py.File(
            self._sink,
            "w",
            libver=("earliest", "v110"),
            track_order=True,
            rdcc_nslots=CHUNK_CACHE_SLOTS,
        )
        self._file = self._cleanup.enter_context(file)
        return self._file

    @contextlib.contextmanager
    def used(self) -> Iterator[None]:
        """Around any use of HDF5; an error of the disk counts more than what HDF5 makes of it.

        Raises:
            StorageError: the disk is full or fails.
        """
        with interrupts_deferred():
            try:
                yield
            except Exception:
                if self._sink is None or self._sink.error is None:
                    raise
            if self._sink is not None and self._sink.error is not None:
                raise storage_error(self._staged.path, self._sink.error) from self._sink.error

    def do(self, task: Callable[[], None], size: int) -> None:
        """Use the file in a task that holds so many bytes: now, or of a long file behind the caller's back.

        Within `used`, as what the task does is; tasks are done in their order.
        """
        self._bytes += size
        if self._bytes <= BEHIND_FROM:
            task()
            return
        if self._behind is None:
            from vsacli.results.store.write_behind import WriteBehind

            self._behind = WriteBehind(BEHIND)
        self._behind.put(task, size)
        if self._sink is not None and self._bytes - self._synced >= SYNCED:
            self._synced = self._bytes
            self._sink.begin_sync()

    def wait(self) -> None:
        """Wait until all tasks are done; within `used`."""
        if self._behind is not None:
            self._behind.wait()

    def close(self) -> None:
        """Write what is left; within `used`."""
        assert self._sink is not None, "it is open"
        self._file.close()
        self._sink.close()

    def discard(self) -> None:
        """Close what is open; what is not written is lost."""
        with interrupts_deferred():
            if self._behind is not None:
                self._behind.discard()
            self._cleanup.close()


class Sink(io.RawIOBase):
    """A file object for h5py whose writing never fails in HDF5's sight.

    HDF5 cannot be unwound from a failed write: closing its file fails as well, and the process then crashes
    at exit. So the first error is kept here, what follows it is dropped, and the caller looks at `error`
    after each step.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self._syncing: threading.Thread | None = None
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

    def begin_sync(self) -> None:
        """Have the disk store what was written, in a thread, unless it is still at that."""
        if self._syncing is None or not self._syncing.is_alive():
            self._syncing = threading.Thread(target=self._sync, name="vsacli-syncing")
            self._syncing.start()

    def _sync(self) -> None:
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            self.error = self.error or error

    def close(self) -> None:
        """Close the file, or note what the file system reports only now."""
        if self._syncing is not None:
            self._syncing.join()
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        super().close()
