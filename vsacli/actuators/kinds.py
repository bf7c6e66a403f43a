"""The kinds of actuator by name.

To add a kind, derive a class from `vsacli.actuators.actuator.Actuator` and add a line to `ACTUATORS`.
"""

from __future__ import annotations

from typing import Any

from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.base.errors import InputError
from vsacli.base.lazy import LazyRegistry

ACTUATORS = LazyRegistry(
    {
        "antagonistic": "vsacli.actuators.antagonistic:Antagonistic",
        "elastic": "vsacli.actuators.elastic:Elastic",
        "rigid": "vsacli.actuators.rigid:Rigid",
        "serial": "vsacli.actuators.serial:Serial",
    }
)
"""Kinds of actuator by their name in a robot file."""


def example(name: str, joint_type: str) -> dict[str, Any]:
    """Return plausible values of a joint's key `actuator`.

    Args:
        name: Kind of actuator, or mechanism of a serial one.
        joint_type: Type of the joint.

    Raises:
        InputError: The mechanism does not drive such joints.
    """
    if name in ACTUATORS:
        return {"type": name, **ACTUATORS[name].example(joint_type)}
    if joint_type not in MECHANISMS[name].joint_types:
        raise InputError.one(f"{name} turns about an axis, and drives no {joint_type} joint")
    return {"type": "serial", **ACTUATORS["serial"].example(joint_type, name)}
