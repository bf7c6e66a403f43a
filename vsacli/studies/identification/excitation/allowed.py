"""What an excitation may ask of each joint: the limits of the robot, and cautious ones where it has none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

MARGIN = 0.05
"""Relative distance that an excitation keeps from each limit and from the ends of stiffness corridors, as far
as a robot that is not known yet may be off; the paper's own example keeps 6 % from its corridor."""

USUAL_REACH = {"revolute": np.pi / 4, "prismatic": 0.1}
"""Either way from the middle, rad and m, of joints whose range nobody gave."""

USUAL_SPEED = {"revolute": 1.0, "prismatic": 0.25}
"""Rad/s and m/s of joints whose velocity has no limit; 0.25 m/s is the reduced speed of ISO 10218-1."""

USUAL_STIFFENING = 2.0
"""Largest stiffness over the least that carries the load, where nothing else bounds it."""

SPREAD = 100.0
"""Ratio of both ends of a corridor from which on the upper one bounds nothing: a four-bar comes to 1e9."""


class Allowed(NamedTuple):
    """Bounds of all joints, the margins taken off.

    Attributes:
        lowest, highest: positions, (joints,), rad (m).
        speed: largest velocity either way, (joints,), rad/s (m/s).
        assumptions: what was assumed where the robot has no limit, one sentence each.
    """

    lowest: FloatArray
    highest: FloatArray
    speed: FloatArray
    assumptions: tuple[str, ...]


def allowed(robot: Robot, middle: FloatArray | None = None) -> Allowed:
    """What a robot's joints may do.

    Args:
        robot: the robot.
        middle: about which joints move whose range is not known, (joints,); zero if None.
    """
    about = np.zeros(len(robot.joints)) if middle is None else middle
    words = "zero" if middle is None else "its middle in the motion given"
    ranges = np.array([_range(joint, float(each)) for joint, each in zip(robot.joints, about, strict=True)])
    speeds = np.array([_speed(joint) for joint in robot.joints])
    lowest, highest = ranges.T
    return Allowed(lowest, highest, (1 - MARGIN) * speeds, tuple(_assumptions(robot, words)))


def _range(joint: Joint, middle: float) -> tuple[float, float]:
    """Positions; an end that is not limited lies as far off the middle, or the other end, as is usual."""
    lower, upper = joint.limits.position
    reach = USUAL_REACH[joint.type]
    if not np.isfinite(lower):
        lower = min(middle, upper - reach) - reach
    if not np.isfinite(upper):
        upper = max(middle, lower + reach) + reach
    pad = MARGIN * max(abs(lower), abs(upper))
    return lower + pad, upper - pad


def _speed(joint: Joint) -> float:
    """The smaller of both directions."""
    speed = min(map(abs, joint.limits.velocity))
    return speed if np.isfinite(speed) else USUAL_SPEED[joint.type]


def _assumptions(robot: Robot, middle: str) -> Iterator[str]:
    """One clause for all joints that lack the same."""
    places: dict[str, list[str]] = {}
    for joint in robot.joints:
        for lacking in _lacking(joint, middle):
            places.setdefault(lacking, []).append(joint.name)
    for lacking, names in places.items():
        yield f"no {lacking}: {', '.join(names)}"


def _lacking(joint: Joint, middle: str) -> Iterator[str]:
    """Limits that a joint has not, each with what is assumed."""
    position, velocity = units.POSITION.unit(joint.type), units.VELOCITY.unit(joint.type)
    if not np.isfinite(joint.limits.position).all():
        reach = f"{USUAL_REACH[joint.type]:.3g} {position} either way from {middle} assumed"
        yield f"limits.position ({reach})"
    if not np.isfinite(joint.limits.velocity).all():
        yield f"limits.velocity ({USUAL_SPEED[joint.type]:g} {velocity} assumed)"
    if STIFFNESS.key in joint.actuator.commanded and not np.isfinite(joint.limits.stiffness[1]):
        most = f"at most {USUAL_STIFFENING:g} times the least assumed where springs set no end"
        yield f"limits.stiffness ({most})"
    if not all(np.isfinite(motor.max_torque) for motor in joint.actuator.motors):
        yield "max_torque of motors (none assumed)"
