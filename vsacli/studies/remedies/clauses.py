"""Clauses that say what stands in the way of a suggestion."""

from __future__ import annotations

import math

from vsacli.actuators.reach import LimitCheck
from vsacli.analysis.report_text import QUANTITY_OF_LIMIT
from vsacli.base.units import STIFFNESS
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Joint


def stiffness(joint: Joint, value: float) -> str:
    """A stiffness with its unit."""
    return f"{value:.6g} {STIFFNESS.unit(joint.type)}"


def corridor_reason(joint: Joint, time: float, asked: float, low: float, high: float) -> str:
    """A step whose stiffness is not between the smallest and the largest that would be accepted."""
    when = f"at t = {time:.3f} s"
    if math.isnan(low):
        return f"the springs of {joint.name} cannot carry its elastic torque {when} at any stiffness"
    needs = f"at least {stiffness(joint, low)}" if asked < low else f"at most {stiffness(joint, high)}"
    return f"{joint.name} needs {needs} {when} and is asked for {asked:.6g}"


def limit_reason(joint: Joint, time: float, check: LimitCheck, value: float) -> str:
    """A step that exceeds a limit."""
    quantity = QUANTITY_OF_LIMIT[check.flag.label]
    whose = quantity if check.motor is None else f"{quantity} {check.motor}"
    unit = VARIABLES[check.variable].quantity.unit(joint.type)
    side, bound = ("below", check.range[0]) if value < check.range[0] else ("above", check.range[1])
    asked = f"{value:.6g} {unit} at t = {time:.3f} s"
    return f"the {whose} of {joint.name}, {asked}, is {side} its limit {bound:g}"
