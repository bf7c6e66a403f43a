"""Commanded signals by the names of their arrays."""

from __future__ import annotations

import numpy as np

from vsacli.base.signals import STIFFNESS


def by_name(*stiffness: np.ndarray) -> dict[str, np.ndarray]:
    """A stiffness and its two derivatives."""
    return dict(zip(STIFFNESS.names, stiffness, strict=True))
