"""Writing of an HDF5 file: samples in chunks, in a thread, robust to disk errors and signals.

HDF5 cannot recover from a failed write, and crashes if an exception propagates through its code. It therefore
writes to a `Sink`, which raises none, and signals that end the run are deferred during each write. Chunks are
assembled here in storage order, with one copy, and written whole: the library would copy each block into its
own chunks, look up every chunk, and keep incomplete ones in its cache.
"""

from __future__ import annotations

import contextlib
import io
import os
import threading
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from h5py._objects import phil

from vsacli.base.arrays import AnyArray
from vsacli.base.interrupts import interrupts_deferred
from vsacli.base.outputs import Staged
from vsacli.base.storage import check_free_space, reporting_storage_errors, storage_error

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

CHUNK_CACHE_SLOTS = 11
"""Slots of HDF5's chunk cache for a dataset: few, since rows are written in order."""

DIRECT_BYTES = 2**24
"""Bytes written directly, in some 10 ms, before a thread is worth its start. Without the thread, 10^6 samples
of a 3R with compiled code take at least 1.26 times as long."""

MAX_PENDING_BYTES = 2**25
"""Bytes that may wait to be written: slightly more than a block of seven joints with all variables."""

SYNC_BYTES = 2**26
"""Bytes after which the disk starts to store them, so that little remains at the end."""

CHUNK_BYTES = 2**19
"""Maximum size of a chunk. Of 64 kB to 1 MB tried, sizes from 256 kB on take the same time; smaller chunks
take time for each chunk, larger ones memory for each variable."""


class NewFile:
    """Context manager that writes an HDF5 file, which is complete after `finish` of a subclass.

    Args:
        file: staged file to write.
    """

    def __init__(self, file: Staged) -> None:
        self._staged = file
        self._cleanup = contextlib.ExitStack()
        self._file: Any = None  # h5py has no types
        self._sink: Sink | None = None
        self._thread: ThreadPoolExecutor | None = None
        self._pending_writes: deque[tuple[Future[None], int]] = deque()
        self._submitted_bytes = self._synced_bytes = self._pending_bytes = 0

    def __enter__(self) -> Self:
        """Create the file with everything except samples and report.

        Raises:
            StorageError: the file cannot be written, or does not fit on its disk.
        """
        check_free_space(self._staged.path, self._expected_bytes())
        try:
            with interrupts_deferred(), self.reporting_disk_errors():
                self._open()
                self._create_datasets()
        except BaseException:
            self.discard()
            raise
        return self

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.discard()

    def _expected_bytes(self) -> int:
        """Return the approximate size of the file in bytes."""
        raise NotImplementedError

    def _create_datasets(self) -> None:
        """Write everything that is known before the first sample into the empty file."""
        raise NotImplementedError

    def _open(self) -> None:
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

    @contextlib.contextmanager
    def reporting_disk_errors(self) -> Iterator[None]:
        """Surround any use of HDF5; a disk error takes precedence over the HDF5 error that follows from it.

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

    def schedule_write(self, task: Callable[[], None], byte_count: int) -> None:
        """Run a task that writes `byte_count` bytes: immediately, or in a thread once the file is long.

        To be called within `reporting_disk_errors`, as the task itself is; tasks run in order. Signals never
        reach the thread, and its exceptions are raised by a later call or by `wait`. While too many bytes are
        waiting, the caller waits too.
        """
        self._submitted_bytes += byte_count
        if self._submitted_bytes <= DIRECT_BYTES:
            task()
            return
        if self._thread is None:
            from concurrent.futures import ThreadPoolExecutor

            self._thread = ThreadPoolExecutor(1, "vsacli-writing")
        self._pending_writes.append((self._thread.submit(task), byte_count))
        self._pending_bytes += byte_count
        while self._pending_bytes > MAX_PENDING_BYTES:
            self._await_oldest()
        if self._sink is not None and self._submitted_bytes - self._synced_bytes >= SYNC_BYTES:
            self._synced_bytes = self._submitted_bytes
            self._sink.begin_sync()

    def wait(self) -> None:
        """Wait until all tasks are done; to be called within `reporting_disk_errors`."""
        while self._pending_writes:
            self._await_oldest()

    def _await_oldest(self) -> None:
        write_future, byte_count = self._pending_writes.popleft()
        self._pending_bytes -= byte_count
        write_future.result()

    def _close(self) -> None:
        """Write remaining chunks; to be called within `reporting_disk_errors`."""
        assert self._sink is not None, "it is open"
        self._file.close()
        self._sink.close()

    def discard(self) -> None:
        """Close the file without writing the rest."""
        with interrupts_deferred():
            if self._thread is not None:
                self._thread.shutdown(cancel_futures=True)
            self._cleanup.close()


class Sink(io.RawIOBase):
    """A file object for h5py whose writes never fail from HDF5's point of view.

    HDF5 cannot recover from a failed write: closing its file fails as well, and the process then crashes at
    exit. The first error is therefore stored in `error`, which the caller checks after each use, and later
    writes are dropped.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self._sync_thread: threading.Thread | None = None
        self.error: OSError | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a byte."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the current byte."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """Read bytes that were written before."""
        return self._file.readinto(buffer)

    def write(self, data: Any) -> int:
        """Write all of `data`, or store the error."""
        remaining = memoryview(data)
        try:
            while len(remaining) and self.error is None:
                remaining = remaining[self._file.write(remaining) :]
        except OSError as error:
            self.error = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file, or store the error."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return 0

    def begin_sync(self) -> None:
        """Sync the bytes written so far to disk, in a thread, unless an earlier sync is still running."""
        if self._sync_thread is None or not self._sync_thread.is_alive():
            self._sync_thread = threading.Thread(target=self._sync, name="vsacli-syncing")
            self._sync_thread.start()

    def _sync(self) -> None:
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            self.error = self.error or error

    def close(self) -> None:
        """Close the file; store an error that the file system reports only now."""
        if self._sync_thread is not None:
            self._sync_thread.join()
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        super().close()


def chunk_rows(samples: int, row_bytes: int) -> int:
    """Return the samples of a chunk: chunks of equal size, as few as `CHUNK_BYTES` allows."""
    max_rows = max(1, CHUNK_BYTES // row_bytes)
    chunk_count = -(-samples // max_rows)
    return -(-samples // chunk_count)


class ChunkFiller:
    """Appends samples to a dataset, chunk by chunk.

    With blocks assigned to the dataset, 400,000 samples of a 3R with compiled code take 1.2 times as long.

    Args:
        dataset: dataset whose first axis is time, with chunks as wide as its rows, and no filter but gzip.
        hand_over: function such as `NewFile.schedule_write`.
    """

    def __init__(
        self, dataset: h5py.Dataset, schedule_write: Callable[[Callable[[], None], int], None]
    ) -> None:
        self._dataset, self._schedule_write = dataset, schedule_write
        self._chunk_shape, self._dtype = dataset.chunks, dataset.dtype
        self._gzip_level: int | None = dataset.compression_opts
        self._chunk_start = self._filled_rows = 0
        self._chunk: AnyArray = np.empty(0)

    def append(self, values: AnyArray) -> None:
        """Copy samples, (samples, ...), of any memory layout.

        Raises:
            FloatingPointError: a finite value overflows the type of the dataset.
        """
        capacity = self._chunk_shape[0]
        while len(values):
            if not self._filled_rows:
                self._chunk = np.empty(self._chunk_shape, self._dtype)
            rows = values[: capacity - self._filled_rows]
            with np.errstate(over="raise"):
                self._chunk[self._filled_rows : self._filled_rows + len(rows)] = rows
            self._filled_rows += len(rows)
            values = values[len(rows) :]
            if self._filled_rows == capacity:
                self._schedule_chunk()

    def finish(self) -> None:
        """Hand over the last chunk, and shorten the dataset to the samples written."""
        self._schedule_write(partial(self._shorten, self._chunk_start + self._filled_rows), 0)
        if self._filled_rows:
            self._chunk[self._filled_rows :] = 0  # beyond the shortened dataset
            self._schedule_chunk()

    def _schedule_chunk(self) -> None:
        self._schedule_write(partial(self._write_chunk, self._chunk_start, self._chunk), self._chunk.nbytes)
        self._chunk_start += self._filled_rows
        self._filled_rows, self._chunk = 0, np.empty(0)

    def _shorten(self, samples: int) -> None:
        if samples < self._dataset.shape[0]:
            self._dataset.resize(samples, axis=0)

    def _write_chunk(self, chunk_start: int, chunk: AnyArray) -> None:
        """Write a chunk, bypassing the library's cache."""
        raw_chunk = chunk if self._gzip_level is None else zlib.compress(chunk.data, self._gzip_level)
        with phil:  # h5py's lock, which this call takes only since version 3.16
            self._dataset.id.write_direct_chunk((chunk_start, *(0 for _ in chunk.shape[1:])), raw_chunk)
