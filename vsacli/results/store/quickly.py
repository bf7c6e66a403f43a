"""Many small things into an HDF5 file by h5py's low-level calls, in a third of the time of its objects.

A result has some 70 datasets with 200 attributes, nearly all of which are known before the first sample.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5p, h5s, h5t

from vsacli.base.arrays import AnyArray
from vsacli.results.store.schema import TEXT

GZIP_LEVEL = 4

_TEXT_TYPE = h5t.py_create(TEXT, logical=True)
_TEXT_IN_MEMORY = h5t.py_create(TEXT)
_SCALAR = h5s.create(h5s.SCALAR)
_LAYOUT = h5p.create(h5p.DATASET_CREATE)
_LAYOUT.set_obj_track_times(False)
_LAYOUT.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)


def set_attributes(target: h5py.HLObject, attributes: Mapping[str, Any]) -> None:
    """New attributes of a group or dataset, texts or arrays."""
    for name, content in attributes.items():
        if isinstance(content, str):
            text = np.array(content, dtype=TEXT)
            h5a.create(target.id, name.encode(), _TEXT_TYPE, _SCALAR).write(text, _TEXT_IN_MEMORY)
        else:
            target.attrs[name] = content


def add_array(group: h5py.Group, name: str, values: AnyArray) -> h5py.Dataset:
    """A new dataset of numbers, or of texts in an array of the type `TEXT`; attributes keep their order."""
    stored = h5t.py_create(values.dtype, logical=True)
    made = h5d.create(group.id, name.encode(), stored, h5s.create_simple(values.shape), _LAYOUT)
    made.write(h5s.ALL, h5s.ALL, values)
    return h5py.Dataset(made)


def add_empty(
    group: h5py.Group,
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    chunk: int,
    *,
    compressed: bool,
) -> h5py.Dataset:
    """A new dataset for numbers to come, at most of a shape, in chunks of that many rows."""
    layout = _LAYOUT.copy()
    layout.set_chunk((chunk, *shape[1:]))
    if compressed:
        layout.set_deflate(GZIP_LEVEL)
    space = h5s.create_simple(shape, shape)
    return h5py.Dataset(h5d.create(group.id, name.encode(), h5t.py_create(dtype), space, layout))


def write_rows(dataset: h5py.Dataset, start: int, rows: AnyArray) -> None:
    """Rows of a dataset, from `start` on."""
    rows = np.ascontiguousarray(rows)
    space = dataset.id.get_space()
    space.select_hyperslab((start, *[0] * (rows.ndim - 1)), rows.shape)
    dataset.id.write(h5s.create_simple(rows.shape), space, rows)


def attach_scales(dataset: h5py.Dataset, scales: Iterable[h5py.Dataset]) -> None:
    """Attach to each axis its scale."""
    for axis, scale in enumerate(scales):
        h5ds.attach_scale(dataset.id, scale.id, axis)
