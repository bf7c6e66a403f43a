"""Damaged and hostile HDF5 files: what the library itself would not survive is found before it sees it.

HDF5 reports most damage by exceptions. It loops without end on one kind, an object of size zero in a heap of
texts, and it allocates whatever a damaged shape asks for.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path
from typing import BinaryIO

import h5py

from vsacli.base.errors import InputError, StorageError
from vsacli.documents.source import HDF5_SIGNATURE
from vsacli.results.store.schema import CHUNK_BYTES

EXPECTED = "expected a result file, as invdyn or simulate writes it"

BYTES_PER_READ = 2**24
"""Bytes of a file looked at in one go."""

_COLLECTION = struct.Struct("<8xQ")
_OBJECT = struct.Struct("<HHIQ")
_REFERENCE = struct.Struct("<IQI")
_HEAP = b"GCOL\x01\0\0\0"
_SMALLEST_HEAP = 4096
_LARGEST_HEAP = 2**26


def open_checked(path: str | Path) -> h5py.File:
    """Open a file for reading, after all of it was searched for what HDF5 does not survive.

    Raises:
        InputError: there is no such file, or it is none of HDF5, or damaged.
        StorageError: the operating system refuses to read it, or another program is writing it.
    """
    _check_signature(path)
    with reporting_damage(path):
        check_heaps(path)
        return h5py.File(path, "r")


def _check_signature(path: str | Path) -> None:
    """Tell a missing file, a folder and a file of another kind from each other before HDF5 sees them."""
    if "\0" in str(path):
        raise InputError.one("the path holds a NUL character", path)
    try:
        if Path(path).is_fifo():
            raise InputError.one(f"is a pipe; {EXPECTED}", path)
        with Path(path).open("rb") as file:
            start = file.read(len(HDF5_SIGNATURE))
    except FileNotFoundError:
        raise InputError.one(f"there is no such file; {EXPECTED}", path) from None
    except IsADirectoryError:
        raise InputError.one(f"is a folder; {EXPECTED}", path) from None
    except OSError as error:
        raise StorageError(path, f"cannot be read: {error.strerror}") from error
    if start != HDF5_SIGNATURE:
        kind = "is empty" if not start else "is not an HDF5 file"
        raise InputError.one(f"{kind}; {EXPECTED}", path)


@contextlib.contextmanager
def reporting_damage(path: str | Path) -> Iterator[None]:
    """HDF5 reports truncation and corruption by any of these exceptions."""
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
        reason = " ".join(str(error).split())[:200]
        raise InputError.one(f"is damaged or truncated ({reason}); compute it again", path) from error


def check_heaps(path: str | Path) -> None:
    """Refuse a file with a heap of texts that does not end where it says.

    A heap collection (HDF5 file format 3.0, III.E) is a row of objects, each after its header of index,
    reference count and size; index 0 is the free space at the end.

    Raises:
        InputError: naming the offset.
        OSError: the file cannot be read.
    """
    with open(path, "rb") as file:
        for offset in _heaps(file):
            file.seek(offset)
            content = file.read(_COLLECTION.size)
            size = _COLLECTION.unpack(content)[0] if len(content) == _COLLECTION.size else 0
            if not (_SMALLEST_HEAP <= size <= _LARGEST_HEAP) or not _ends(file.read(size - len(content))):
                raise InputError.one(f"is damaged: the texts at byte {offset} have no end", path)


def _heaps(file: BinaryIO) -> Iterator[int]:
    """Offsets at which a heap collection begins."""
    start, tail = 0, b""
    while piece := file.read(BYTES_PER_READ):
        text, found = tail + piece, -1
        position = file.tell()
        while (found := text.find(_HEAP, found + 1)) >= 0:
            yield start - len(tail) + found
            file.seek(position)
        start, tail = start + len(piece), text[-len(_HEAP) + 1 :]


def _ends(objects: bytes) -> bool:
    """Whether the objects of a heap fill it: each has a size above zero, and none goes beyond the end."""
    position = 0
    while len(objects) - position >= _OBJECT.size:
        index, _, _, size = _OBJECT.unpack_from(objects, position)
        room = size if index == 0 else _OBJECT.size + -(-size // 8) * 8
        if not 0 < room <= len(objects) - position:
            return False
        position += room
    return True


def own_dataset(file: h5py.File, name: str) -> h5py.Dataset:
    """A dataset, if its values stand in this file and need no more memory at a time than the file has bytes.

    Raises:
        KeyError: there is none.
        ValueError: it is a link to another file or kept there, or its chunks or texts ask for more.
    """
    for path in accumulate(name.split("/"), "{}/{}".format):
        link = file.get(path, getlink=True)
        if link is None:
            raise KeyError(f"{path} not found")
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{path} is a link to elsewhere")
    dataset = file[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.external or dataset.is_virtual:
        raise ValueError(f"the values of {name} are not in this file")
    _check_chunks(dataset, file_size(file))
    if h5py.check_string_dtype(dataset.dtype) is not None:
        _check_texts(dataset, file_size(file))
    return dataset


def file_size(file: h5py.File) -> int:
    """Bytes of an open file."""
    return int(file.id.get_filesize())


def bounded(dataset: h5py.Dataset) -> h5py.Dataset:
    """The dataset, if to read it whole takes no more memory than its file has bytes.

    Raises:
        ValueError: its shape asks for more.
    """
    size = file_size(dataset.file)
    if dataset.nbytes > size:
        raise ValueError(f"{dataset.name} claims {dataset.nbytes:,} bytes in a file of {size:,}")
    return dataset


def _check_chunks(dataset: h5py.Dataset, size: int) -> None:
    """The size that follows from the shape of a chunk, and the one that the library allocates."""
    if dataset.chunks is None:
        return
    claimed = dataset.dtype.itemsize
    for length in dataset.chunks:
        claimed *= length
    if dataset.size:
        claimed = max(claimed, dataset.id.get_chunk_info_by_coord((0,) * dataset.ndim).size)
    if claimed > max(size, CHUNK_BYTES):
        raise ValueError(f"{dataset.name} claims chunks of {claimed:,} bytes in a file of {size:,}")


def _check_texts(dataset: h5py.Dataset, size: int) -> None:
    """Texts of any length are references to heaps, each a length, an address and an index."""
    offset = dataset.id.get_offset()
    if offset is None:
        return
    with open(dataset.file.filename, "rb") as file:
        file.seek(offset)
        references = file.read(min(dataset.size * _REFERENCE.size, size))
    whole = len(references) // _REFERENCE.size * _REFERENCE.size
    claimed = sum(length for length, _, _ in _REFERENCE.iter_unpack(references[:whole]))
    if claimed > size:
        raise ValueError(f"{dataset.name} claims texts of {claimed:,} bytes in a file of {size:,}")
