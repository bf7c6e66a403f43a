"""By how much a number is changed to compare its effects with those of others."""

from __future__ import annotations

import math
from collections.abc import Mapping

from vsacli.base import units
from vsacli.base.units import Quantity
from vsacli.robot.parameters import Parameter

RELATIVE = 0.01
"""Change of most numbers."""

SMALL_CHANGES: Mapping[Quantity, tuple[float, str]] = {
    units.LENGTH: (1e-3, "1 mm"),
    units.ANGLE: (math.radians(1), "1 deg"),
}
"""Change of numbers that are zero as often as not, so that a share of them says nothing, and its words."""


def step_of(parameter: Parameter) -> float:
    """The change, in SI units; zero for a number that is zero and is compared by a share of it."""
    change, _ = SMALL_CHANGES.get(parameter.quantity, (RELATIVE * abs(parameter.value), ""))
    return change


def words_of(parameter: Parameter) -> str:
    """The change as people say it."""
    _, words = SMALL_CHANGES.get(parameter.quantity, (0.0, f"{100 * RELATIVE:g} %"))
    return words
