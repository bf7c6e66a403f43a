"""The axes along which a wrench is given."""

from __future__ import annotations

from vsacli.records import dataclass
from vsacli.spec.fields import choice
from vsacli.wrench import WRENCH_FRAMES


@dataclass(frozen=True)
class Framed:
    """A wrench in a frame."""

    frame: str = choice(WRENCH_FRAMES, "along whose axes `fx fy fz mx my mz` are given")
