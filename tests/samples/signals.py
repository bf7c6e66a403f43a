"""Commanded signals by the names of their arrays."""

from __future__ import annotations

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS


def by_name(*stiffness: FloatArray) -> dict[str, FloatArray]:
    """A stiffness and its two derivatives."""
    return dict(zip(STIFFNESS.names, stiffness, strict=True))
