"""The registry of types of declarations in trajectory files.

A new type needs a class like those in this folder, and a row in `TYPES`.
"""

from __future__ import annotations

from typing import Any

from vsacli.base.lazy import LazyRegistry
from vsacli.base.signals import POSITION, WRENCH
from vsacli.documents.fields import OneOf
from vsacli.trajectory.curves.closed_form import Declaration, Formula, Recorded, Use

_JOINTS = ("position", "commanded")
_EVERY = (*_JOINTS, "wrench")

TYPES = {
    "polynomial": ("vsacli.trajectory.curves.polynomial:Polynomial", _EVERY),
    "via": ("vsacli.trajectory.curves.via_points:Via", _JOINTS),
    "sinusoids": ("vsacli.trajectory.curves.sinusoids:SumOfSinusoids", _JOINTS),
    "sequence": ("vsacli.trajectory.curves.sequence:Sequence", ("position",)),
    "steps": ("vsacli.trajectory.curves.steps:Steps", ("commanded", "wrench")),
    "constant": ("vsacli.trajectory.curves.polynomial:Hold", _EVERY),
    "csv": ("vsacli.trajectory.curves.closed_form:Recorded", _EVERY),
}
"""Types of declarations, each with module and class, and its uses: position, commanded signals, wrench."""


class _Types(LazyRegistry):
    """The record classes of the types that are possible for a use."""

    def __init__(self, use: Use) -> None:
        served = {POSITION: "position", WRENCH: "wrench"}.get(use.signal, "commanded")
        super().__init__({name: home for name, (home, serves) in TYPES.items() if served in serves})
        self._use = use

    def __getitem__(self, name: str) -> Any:
        return super().__getitem__(name).record(self._use)


def declared_as(use: Use) -> OneOf:
    """Return the possible declarations of a signal."""
    return OneOf(_Types(use))


__all__ = ["TYPES", "Declaration", "Formula", "Recorded", "Use", "declared_as"]
