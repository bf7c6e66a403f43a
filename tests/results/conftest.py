"""A block of samples to write, and a file that stands where it goes."""

from __future__ import annotations

import pytest
from samples.results import random_block


@pytest.fixture
def block():
    return random_block(50, 2)


@pytest.fixture
def old(tmp_path):
    """The bytes of a file that stands at r.h5."""
    (tmp_path / "r.h5").write_bytes(b"old")
    return b"old"
