"""Rows by the name of the array that they belong to."""

from __future__ import annotations

import numpy as np

from vsacli.compute.rows import RowLayout

LAYOUT = RowLayout({"q": (3,), "phi": (3, 2), "none": (0,), "time": ()})


def test_what_is_packed_comes_back():
    arrays = {name: np.random.default_rng(0).random((*shape, 5)) for name, shape in LAYOUT.shapes.items()}
    rows = np.array(LAYOUT.pack({name: array.reshape(-1, 5) for name, array in arrays.items()}))
    assert len(rows) == LAYOUT.size == 10
    found = LAYOUT.arrays(rows)
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)


def test_rows_of_any_kind_are_told_apart():
    given = LAYOUT.unpack("abcdefghijk")
    assert given == {"q": "abc", "phi": "defghi", "none": "", "time": "j"}
