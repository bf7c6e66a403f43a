"""The axes along which a wrench is given."""

from __future__ import annotations

from dataclasses import dataclass

from vsacli.base.wrench import WRENCH_FRAMES
from vsacli.documents.fields import choice


@dataclass(frozen=True)
class Framed:
    """A wrench in a frame."""

    frame: str = choice(WRENCH_FRAMES, "along whose axes `fx fy fz mx my mz` are given")
