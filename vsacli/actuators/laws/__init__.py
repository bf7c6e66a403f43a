"""Spring laws of the transmissions, and the names that a user-defined law needs.

To add a law, derive a class from `SpringLaw` and add a line to `LAWS`.
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
"""Laws by their name in a robot file."""

_EXPORTS = LazyRegistry(
    {
        **{name.title().replace("_", ""): home for name, home in LAWS.homes.items()},
        "Tendon": "vsacli.actuators.laws.tendons:Tendon",
        "make_pair": "vsacli.actuators.pairs:make_pair",  # lazy: pairs import laws, not the reverse
    }
)
"""Names imported at first use; the class of a law has its name in a robot file, in CamelCase."""

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
    """Import a law at first use (PEP 562), so that a robot file imports only the laws that it names."""
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _EXPORTS[name]


def __dir__() -> list[str]:
    return sorted({*__all__, *_EXPORTS})
