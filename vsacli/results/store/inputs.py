"""Input files of a run, stored in its result, so that the run can be repeated and the files be extracted."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import h5py
import numpy as np

from vsacli.base.storage import place_of
from vsacli.documents.source import Source
from vsacli.results.store.damage import CheckedFile, DamageError, check_present, local_dataset
from vsacli.results.store.schema import TEXT, storable

LARGEST_STORED = 256 * 2**20
"""Maximum size (bytes) of a stored file; a recording of a million rows and fifteen columns has 200 MB."""

CHUNK = 2**20
COMPRESSION = 1
"""Level of gzip, the fastest."""


class StoredInput(NamedTuple):
    """An input file of a run.

    Attributes:
        path: path as given on the command line.
        sha256: digest of the content, hexadecimal.
        role: "robot" or "trajectory" for the file that describes one, else empty.
        content: content of the file; None if it was too large to store.
        changes: changes applied after reading, values by path.
    """

    path: str
    sha256: str
    role: str
    content: bytes | None
    changes: Mapping[str, Any]


def write_sources(inputs: h5py.Group, sources: Mapping[str, tuple[Source, ...]]) -> None:
    """Write a subgroup `file_1`, `file_2`, ... for each input file, once even if it was used twice.

    Args:
        inputs: group to write to.
        sources: files by the object that they describe; the first file of each refers to the others.
    """
    roles = {files[0]: role for role, files in sources.items() if files}
    unique_sources = dict.fromkeys(source for files in sources.values() for source in files)
    for number, source in enumerate(unique_sources, start=1):
        group = inputs.create_group(f"file_{number}", track_order=True)
        group.attrs.update({"path": storable(source.path), "sha256": source.sha256})
        if source.changes:
            group.attrs["changes"] = storable(source.changes)
        if source in roles:
            group.attrs["role"] = roles[source]
        if source.text is not None:
            group.create_dataset("text", data=storable(source.text), dtype=TEXT)
        else:
            _write_content(group, source)


def _write_content(group: h5py.Group, source: Source) -> None:
    """Write the bytes of a large file, unless it has changed since it was read."""
    try:
        with open(place_of(source.path), "rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size > LARGEST_STORED or hashlib.file_digest(file, "sha256").hexdigest() != source.sha256:
                return
            file.seek(0)
            dataset = group.create_dataset(
                "content",
                (size,),
                np.uint8,
                chunks=(CHUNK,),
                compression="gzip",
                compression_opts=COMPRESSION,
            )
            for start in range(0, size, CHUNK):
                chunk = np.frombuffer(file.read(CHUNK), np.uint8)
                dataset[start : start + len(chunk)] = chunk
    except OSError:
        return  # the file is gone; the run continues with the data read from it


def read_sources(file: CheckedFile) -> Iterator[StoredInput]:
    """Yield the input files in the order in which they were written."""
    file_number = 1
    while (name := f"inputs/file_{file_number}") in file:
        attributes = {key: str(value) for key, value in file[name].attrs.items()}
        check_present(attributes, ("path", "sha256"), name)
        yield StoredInput(
            path=attributes["path"],
            sha256=attributes["sha256"],
            role=attributes.get("role", ""),
            content=_read_content(file, name),
            changes=json.loads(attributes.get("changes", "{}")),
        )
        file_number += 1


def _read_content(file: CheckedFile, name: str) -> bytes | None:
    if f"{name}/text" in file:
        text: str = local_dataset(file, f"{name}/text").asstr()[()]
        return text.encode()
    if f"{name}/content" in file:
        dataset = local_dataset(file, f"{name}/content")
        if dataset.nbytes > LARGEST_STORED:
            raise DamageError(f"{name} claims {dataset.nbytes:,} bytes, of at most {LARGEST_STORED:,}")
        return bytes(dataset[...])
    return None
