"""Checks of damaged and malicious HDF5 files, which protect the HDF5 library.

HDF5 reports most damage by exceptions. On an object of size zero in a heap of texts it loops forever, and it
allocates as much memory as a damaged shape requests. Content is checked only when it is needed, so the time
to open a file does not depend on the number of samples.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
from collections.abc import Container, Iterable, Iterator
from itertools import accumulate
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import near_file
from vsacli.base.errors import InputError, StorageError
from vsacli.documents.source import HDF5_SIGNATURE
from vsacli.trajectory.curves.closed_form import MAX_DURATION

SCALES = "DIMENSION_LIST"
"""Attribute of HDF5 datasets with coordinates."""

EXPECTED = "expected a result file, as invdyn or simulate writes it"

_HEAP_HEADER = struct.Struct("<8xQ")
_OBJECT_HEADER = struct.Struct("<HHIQ")
_REFERENCE = struct.Struct("<IQI")
_HEAP_SIGNATURE = b"GCOL\x01\0\0\0"
_SMALLEST_HEAP = 4096
_LARGEST_HEAP = 2**26
_LARGEST_CHUNK = 2**20
"""Bytes that a chunk may have in memory, regardless of its compressed size in the file."""


class DamageError(ValueError):
    """Content that no result has; its message is for users, unlike those of HDF5."""


class CheckedFile(h5py.File):  # type: ignore[misc]  # h5py has no types
    """An HDF5 file open for reading, whose damaged heaps of texts are hidden from the library.

    Args:
        path: path of the file.

    Raises:
        InputError: the file does not exist, is not HDF5, or is damaged at its beginning.
        StorageError: the operating system refuses to read it, or another program is writing it.
    """

    def __init__(self, path: str | Path) -> None:
        _check_signature(path)
        with reporting_damage(path):
            self._checked_bytes = _CheckedBytes(path)
            try:
                super().__init__(self._checked_bytes, "r")
            except BaseException:
                self._checked_bytes.close()
                raise

    def close(self) -> None:
        """Close the file."""
        super().close()
        self._checked_bytes.close()

    def bytes_at(self, offset: int, size: int) -> bytes:
        """Return bytes of the file unchanged, fewer at the end of the file."""
        self._checked_bytes.seek(offset)
        return self._checked_bytes.read(size)


class _CheckedBytes(io.FileIO):
    """A file as passed to HDF5: zeros replace a heap of texts in which HDF5 would loop forever.

    HDF5 reads a heap from its first byte on, whole or its first 4096 bytes, and refuses one without the
    signature of heaps.
    """

    def __init__(self, path: str | Path) -> None:
        super().__init__(path)
        try:
            _lock(self)
        except BaseException:
            self.close()
            raise

    def readinto(self, buffer: Any) -> int:
        """Fill the buffer from the file; beyond the end of the file with zeros."""
        view, start, filled = memoryview(buffer), self.tell(), 0
        while count := super().readinto(view[filled:]):
            filled += count
        if bytes(view[: len(_HEAP_SIGNATURE)]) == _HEAP_SIGNATURE and not self._is_heap_valid(start):
            filled = 0
        view[filled:] = bytes(len(view) - filled)  # zeros beyond the end of the file, or in place of the heap
        return len(view)

    def _is_heap_valid(self, offset: int) -> bool:
        """Return whether a heap is as large as its header states, and each of its objects ends.

        A heap collection (HDF5 file format 3.0, III.E) is a sequence of objects, each after its header of
        index, reference count and size; index 0 is the free space at the end.
        """
        self.seek(offset)
        header = self.read(_HEAP_HEADER.size)
        size = _HEAP_HEADER.unpack(header)[0] if len(header) == _HEAP_HEADER.size else 0
        return _SMALLEST_HEAP <= size <= _LARGEST_HEAP and _objects_fill_heap(self.read(size - len(header)))


def _lock(file: io.FileIO) -> None:
    """Lock a file for reading, as HDF5 itself does, where the system supports it.

    Raises:
        BlockingIOError: another program is writing the file.
    """
    if os.environ.get("HDF5_USE_FILE_LOCKING", "").upper() in ("FALSE", "0"):
        return
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except (ImportError, OSError):
        pass  # a system or file system without locks


def _check_signature(path: str | Path) -> None:
    """Refuse a missing file, a pipe, a folder, and files other than HDF5, before HDF5 opens them."""
    if "\0" in str(path):
        raise InputError.one("the path holds a NUL character", path)
    try:
        if Path(path).is_fifo():
            raise InputError.one(f"is a pipe; {EXPECTED}", path)
        with Path(path).open("rb") as file:
            start = file.read(len(HDF5_SIGNATURE))
    except FileNotFoundError:
        raise InputError.one(f"no such file{near_file(Path(path)) or f'; {EXPECTED}'}", path) from None
    except IsADirectoryError:
        raise InputError.one(f"is a folder; {EXPECTED}", path) from None
    except OSError as error:
        raise StorageError(path, f"cannot be read: {error.strerror}") from error
    if start != HDF5_SIGNATURE:
        kind = "is empty" if not start else "is not an HDF5 file"
        raise InputError.one(f"{kind}; {EXPECTED}", path)


@contextlib.contextmanager
def reporting_damage(path: str | Path, variable: str = "") -> Iterator[None]:
    """Turn exceptions by which HDF5 reports truncation or corruption, here of `variable`, into InputError."""
    try:
        yield
    except InputError:
        raise
    except BlockingIOError as error:
        raise StorageError(path, "cannot be read: another program has it open for writing") from error
    except (
        OSError,
        LookupError,
        ValueError,
        TypeError,
        RuntimeError,
        AttributeError,
        ArithmeticError,
        MemoryError,
        NotImplementedError,
    ) as error:
        subject = f"variable {variable} is" if variable else "is"
        reason = f" ({' '.join(str(error).split())[:200]})" if isinstance(error, DamageError) else ""
        raise InputError.one(f"{subject} damaged or truncated{reason}; compute it again", path) from error


def _objects_fill_heap(objects: bytes) -> bool:
    """Return whether the objects of a heap fill it: none is empty, and none extends beyond its end."""
    position = 0
    while len(objects) - position >= _OBJECT_HEADER.size:
        index, _, _, size = _OBJECT_HEADER.unpack_from(objects, position)
        object_size = size if index == 0 else _OBJECT_HEADER.size + -(-size // 8) * 8
        if not 0 < object_size <= len(objects) - position:
            return False
        position += object_size
    return True


def local_dataset(file: CheckedFile, name: str) -> h5py.Dataset:
    """Return a dataset if its values are in this file, and chunks and texts claim no more bytes than it has.

    Raises:
        DamageError: the dataset does not exist, is a link or stored elsewhere, or its chunks or texts are too
            large.
    """
    for path in accumulate(name.split("/"), "{}/{}".format):
        link = file.get(path, getlink=True)
        if link is None:
            raise DamageError(f"{path} not found")
        if not isinstance(link, h5py.HardLink):
            raise DamageError(f"{path} is a link to elsewhere")
    dataset = file[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.external or dataset.is_virtual:
        raise DamageError(f"the values of {name} are not in this file")
    _check_chunks(dataset, file_size(file))
    if h5py.check_string_dtype(dataset.dtype) is not None:
        _check_texts(dataset, file)
    return dataset


def check_present(attributes: Container[str], required: Iterable[str], name: str = "the file") -> None:
    """Refuse an object that lacks attributes required in each file.

    Raises:
        DamageError: with the missing attributes.
    """
    missing = [attribute for attribute in required if attribute not in attributes]
    if missing:
        raise DamageError(f"{name} has no attribute {', '.join(missing)}")


def read_texts(file: h5py.File) -> None:
    """Read all attributes of all objects, and all datasets of texts, since damage of one shows only then."""

    def read(_name: str, node: h5py.Group | h5py.Dataset) -> None:
        dict(node.attrs)
        if isinstance(node, h5py.Dataset) and h5py.check_string_dtype(node.dtype):
            check_nbytes(node)[()]

    file.visititems(read)


def file_size(file: h5py.File) -> int:
    """Return the bytes of an open file."""
    return int(file.id.get_filesize())


def check_nbytes(dataset: h5py.Dataset) -> h5py.Dataset:
    """Return the dataset if its values need no more memory than its file has bytes.

    Raises:
        DamageError: the values need more memory.
    """
    size = file_size(dataset.file)
    if dataset.nbytes > size:
        raise DamageError(f"{dataset.name} claims {dataset.nbytes:,} bytes in a file of {size:,}")
    return dataset


def check_times(time: FloatArray) -> None:
    """Refuse times that no run has, on which searches, splines and rates would fail.

    Raises:
        DamageError: times are not finite or not ascending, or beyond the range allowed in trajectories.
    """
    finite, ascending = np.isfinite(time), time[1:] > time[:-1]
    if not finite.all():
        sample = int(np.argmin(finite))
        raise DamageError(f"sample {sample} is at {time[sample]} s")
    if not ascending.all():
        sample = int(np.argmin(ascending))
        raise DamageError(f"{time[sample + 1]:.9g} s follows {time[sample]:.9g} s, at sample {sample + 1}")
    if time.size and not max(-time[0], time[-1]) <= MAX_DURATION:
        raise DamageError(f"they go from {time[0]:.3g} to {time[-1]:.3g} s")


def _check_chunks(dataset: h5py.Dataset, size: int) -> None:
    """Check the size that follows from the shape of a chunk, and the size that the library allocates."""
    if dataset.chunks is None:
        return
    claimed_bytes = dataset.dtype.itemsize
    for length in dataset.chunks:
        claimed_bytes *= length
    if dataset.size:
        claimed_bytes = max(claimed_bytes, dataset.id.get_chunk_info_by_coord((0,) * dataset.ndim).size)
    if claimed_bytes > max(size, _LARGEST_CHUNK):
        raise DamageError(f"{dataset.name} claims chunks of {claimed_bytes:,} bytes in a file of {size:,}")


def _check_texts(dataset: h5py.Dataset, file: CheckedFile) -> None:
    """Check the total length of texts, stored as references to heaps with length, address and index."""
    offset, size = dataset.id.get_offset(), file_size(file)
    if offset is None:
        return
    references = file.bytes_at(offset, min(dataset.size * _REFERENCE.size, size))
    complete_bytes = len(references) // _REFERENCE.size * _REFERENCE.size
    claimed_bytes = sum(length for length, _, _ in _REFERENCE.iter_unpack(references[:complete_bytes]))
    if claimed_bytes > size:
        raise DamageError(f"{dataset.name} claims texts of {claimed_bytes:,} bytes in a file of {size:,}")
