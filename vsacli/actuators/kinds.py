"""The kinds of actuator by name.

Adding a kind of actuator is adding a class derived from `vsacli.actuators.actuator.Actuator` and its line in
`ACTUATORS`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from vsacli.base.lazy import LazyRegistry

if TYPE_CHECKING:
    from vsacli.base.variables import Variable

ACTUATORS = LazyRegistry(
    {
        "antagonistic": "vsacli.actuators.antagonistic:Antagonistic",
        "elastic": "vsacli.actuators.elastic:Elastic",
        "rigid": "vsacli.actuators.rigid:Rigid",
        "serial": "vsacli.actuators.serial:Serial",
    }
)
"""Kinds of actuator by the name they have in a robot file."""


def existing(variable: Variable, kinds: Iterable[str]) -> list[list[bool]]:
    """Which columns of a variable of joints exist, for each joint by its kind of actuator.

    A kind that is not known may have them all.
    """
    every = [True] * (2 if "motor" in variable.dims else 1)
    return [ACTUATORS[kind].has(variable) if kind in ACTUATORS else every for kind in kinds]
