"""A block of samples to write, a file that stands where it goes, and sizes of what is written at a time."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from samples.results import random_block

from vsacli.results.exports import selection
from vsacli.results.store import new_file


@pytest.fixture
def chunks(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Set the size of chunks in bytes."""
    return lambda size: monkeypatch.setattr(new_file, "CHUNK_BYTES", size)


@pytest.fixture
def cells(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Set the number of values that are exported at a time."""
    return lambda count: monkeypatch.setattr(selection, "MAX_BLOCK_VALUES", count)


@pytest.fixture
def block():
    return random_block(50, 2)


@pytest.fixture
def old(tmp_path):
    """The bytes of a file that stands at r.h5."""
    (tmp_path / "r.h5").write_bytes(b"old")
    return b"old"
