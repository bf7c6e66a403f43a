"""Spring laws of the transmissions, and what a law of one's own needs.

Adding a law is adding a class derived from `SpringLaw` and its line in `LAWS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vsacli.actuators.laws.law import Pair, PairSolution, SpringLaw, SpringState
from vsacli.base.lazy import LazyRegistry
from vsacli.base.units import (
    CUBIC_STIFFNESS,
    DIMENSIONLESS,
    INVERSE_POSITION,
    POSITION,
    QUADRATIC_STIFFNESS,
    STIFFNESS,
    TORQUE,
)
from vsacli.compute.control_flow import repeat
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, number

if TYPE_CHECKING:
    from vsacli.actuators.laws.cubic import Cubic
    from vsacli.actuators.laws.four_bar import FourBar
    from vsacli.actuators.laws.polynomial import Polynomial
    from vsacli.actuators.laws.sinh import Sinh
    from vsacli.actuators.laws.table import MeasuredSpring as Table
    from vsacli.actuators.laws.tendons import Exponential, Quadratic, Tendon
    from vsacli.actuators.pairs import make_pair

LAWS = LazyRegistry(
    {
        "cubic": "vsacli.actuators.laws.cubic:Cubic",
        "polynomial": "vsacli.actuators.laws.polynomial:Polynomial",
        "sinh": "vsacli.actuators.laws.sinh:Sinh",
        "exponential": "vsacli.actuators.laws.tendons:Exponential",
        "quadratic": "vsacli.actuators.laws.tendons:Quadratic",
        "four_bar": "vsacli.actuators.laws.four_bar:FourBar",
        "table": "vsacli.actuators.laws.table:MeasuredSpring",
    }
)
"""Laws by the name they have in a robot file."""

_EXPORTS = LazyRegistry(
    {
        **{name.title().replace("_", ""): home for name, home in LAWS.homes.items()},
        "Tendon": "vsacli.actuators.laws.tendons:Tendon",
        "make_pair": "vsacli.actuators.pairs:make_pair",  # pairs know laws; no law knows them
    }
)
"""Names imported at first use; each law by its name in a robot file, written as a class name."""

__all__ = [
    "CUBIC_STIFFNESS",
    "DIMENSIONLESS",
    "INVERSE_POSITION",
    "LAWS",
    "NON_NEGATIVE",
    "POSITION",
    "POSITIVE",
    "QUADRATIC_STIFFNESS",
    "STIFFNESS",
    "TORQUE",
    "Cubic",
    "Exponential",
    "FourBar",
    "Pair",
    "PairSolution",
    "Polynomial",
    "Quadratic",
    "Sinh",
    "SpringLaw",
    "SpringState",
    "Table",
    "Tendon",
    "make_pair",
    "number",
    "repeat",
]


def __getattr__(name: str) -> Any:
    """Import a law at its first use, so that a robot's file imports the laws that it names (PEP 562)."""
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _EXPORTS[name]


def __dir__() -> list[str]:
    return sorted({*__all__, *_EXPORTS})
