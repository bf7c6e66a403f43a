"""Placeholder springs and motors, which a URDF does not describe, in proportion to the load of each joint.

A joint carries the links beyond it at a distance from its axis. Bounds of these distances over all
configurations give a bound I of the inertia about the axis, and with the mass m the torque g sqrt(m I). By
Schwarz's inequality this is at least the torque of gravity in any configuration and for any direction of the
axis. So the springs of a vertical axis, which gravity does not load, also fit the arm that they accelerate.
The torque of the joint's damping in a slow motion is added.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vsacli.actuators.actuator import PlaceholderConstants
from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.units import TORQUE
from vsacli.robot.joint import DenavitHartenberg, Link, Pose
from vsacli.robot.urdf.moving_tree import STANDARD_GRAVITY, MovingJoint

DEFLECTION = {True: 0.1, False: 0.01}
"""Deflection of springs under the largest load, of revolute (rad) and prismatic (m) joints."""

SLOW = {True: 1.0, False: 0.2}
"""Velocity of a slow motion, rad/s (revolute) and m/s (prismatic), whose damping the springs carry. Damping
of wrists in URDF files exceeds their weight many times."""

HARDENING = 0.05
"""Ratio k_c/k times the deflection squared; it gives 5 rad^-2, as of the paper's springs."""

MOTOR_SHARE = 0.5
"""Inertia of each motor over the largest that the joint carries. At the shoulders of the bundled arms modeled
on the Panda, the UR5 and the LWR it is 0.1 to 0.9; it grows towards their wrists."""

DIGITS = 2
"""Significant digits of the constants, few since they are invented."""

LEAST_TORQUE, LEAST_INERTIA = 1e-9, 1e-12
"""Torque, N m (N), and inertia, kg m^2 (kg), up to which a joint counts as unloaded."""

UNLOADED = PlaceholderConstants(motor_inertia=1.0, stiffness=1000.0, spring=(400.0, 2000.0))
"""Constants of a joint without load, e.g. of a file without masses."""


class Placeholders(NamedTuple):
    """The placeholder actuator of every joint, with its constants in SI units.

    Constants that are None follow from the load of each joint.

    Attributes:
        actuator: kind, a key of `vsacli.actuators.kinds.ACTUATORS`.
        motor_inertia: inertia of each motor, joint side of the gear.
        stiffness: stiffness of an elastic transmission, or middle of the attainable range of a serial one.
        spring: coefficients k and k_c of the cubic springs of an antagonistic actuator.
    """

    actuator: str = "antagonistic"
    motor_inertia: float | None = None
    stiffness: float | None = None
    spring: tuple[float, float] | None = None

    def constants(self, joint: MovingJoint, load: JointLoad) -> PlaceholderConstants:
        """Return the constants of a joint from its load, its effort limit, and its gear."""
        gear = joint.urdf.gear_ratio if ACTUATORS[self.actuator].motor_count == 1 else None
        by_load = load.constants(DEFLECTION[joint.is_revolute], gear or 1.0)
        return PlaceholderConstants(
            motor_inertia=by_load.motor_inertia if self.motor_inertia is None else self.motor_inertia,
            stiffness=by_load.stiffness if self.stiffness is None else self.stiffness,
            spring=by_load.spring if self.spring is None else self.spring,
            max_torque=joint.urdf.limit.effort or math.inf,
            gear_ratio=gear,
        )

    def origin(self, field: str, joint: MovingJoint, load: JointLoad) -> str:
        """Return a clause on the origin of the numbers in a field of the actuator."""
        sized = {"motor": self.motor_inertia, "stiffness": self.stiffness, "spring": self.spring}
        if not load.is_there or sized.get(field, ()) is not None:
            return "not from the URDF"
        if field == "motor":
            return f"{MOTOR_SHARE:g} times the largest inertia that it moves"
        give = f"{DEFLECTION[joint.is_revolute]:g} {joint.urdf.unit()}"
        torque = f"{_round_constant(load.torque):g} {joint.urdf.unit(TORQUE)}"
        return f"gives way by {give} under {torque}, its largest load"


class JointLoad(NamedTuple):
    """The largest load of a joint.

    Attributes:
        torque: torque of weight and damping, N m (N).
        inertia: inertia about the joint axis, kg m^2 (for a prismatic joint the mass, kg).
    """

    torque: float
    inertia: float

    @property
    def is_there(self) -> bool:
        """Whether the joint carries a load."""
        return self.torque > LEAST_TORQUE and self.inertia > LEAST_INERTIA

    def constants(self, deflection: float, gear: float) -> PlaceholderConstants:
        """Return constants with which the load deflects the springs by `deflection`, rad (m).

        The motor inertia is rounded on the motor side of the gear ratio `gear`.
        """
        if not self.is_there:
            return UNLOADED
        stiffness = _round_constant(self.torque / deflection)
        k = _round_constant(stiffness / 2)
        return PlaceholderConstants(
            motor_inertia=_round_constant(MOTOR_SHARE * self.inertia / gear**2) * gear**2,
            stiffness=stiffness,
            spring=(k, _round_constant(HARDENING * k / deflection**2)),
        )


def _round_constant(number: float) -> float:
    return float(f"{number:.{DIGITS - 1}e}")


class _Masses(NamedTuple):
    """Moments of bodies of mass m at distances of at most r from a point or an axis.

    Attributes:
        mass: sum of m.
        first: sum of m r.
        second: sum of m r^2 and of the largest principal moments of the bodies.
    """

    mass: float = 0.0
    first: float = 0.0
    second: float = 0.0

    def farther(self, distance: float) -> _Masses:
        """Return the moments about a point at a distance from the present one."""
        second = self.second + (2 * self.first + self.mass * distance) * distance
        return _Masses(self.mass, self.first + self.mass * distance, second)

    def plus(self, other: _Masses) -> _Masses:
        """Return the moments of these bodies and others about the same point."""
        return _Masses(self.mass + other.mass, self.first + other.first, self.second + other.second)

    def with_link(self, link: Link, distance: float) -> _Masses:
        """Return the moments with a further link, whose center of mass is at this distance."""
        moment = link.mass * distance
        principal = max(float(link.inertia.principal_moments[-1]), 0.0)
        return _Masses(
            self.mass + link.mass, self.first + moment, self.second + moment * distance + principal
        )


def largest_joint_loads(
    joints: Sequence[MovingJoint],
    rows: Sequence[DenavitHartenberg],
    mounts: Sequence[Pose | None],
    links: Sequence[Link],
) -> list[JointLoad]:
    """Return the largest load of each joint over all configurations.

    Args:
        joints: joints from the base.
        rows: rows of the joints.
        mounts: where the rows begin on the links that carry the joints; None if at their frames.
        links: links that the joints move.
    """
    loads = []
    about_axis = [_Masses()] * len(joints)  # of what the joints on a link carry, about the axis of the link
    about_seat = list(about_axis)  # and about the origin of the frame at which the link's row begins
    for number, (joint, row, link) in reversed(list(enumerate(zip(joints, rows, links, strict=True)))):
        radius, distance = _largest_distances(joint, row, link.com)
        moved = about_axis[number].with_link(link, radius)
        inertia = moved.second if joint.is_revolute else moved.mass
        weight = STANDARD_GRAVITY * math.sqrt(moved.mass * inertia)
        loads.append(JointLoad(weight + SLOW[joint.is_revolute] * joint.urdf.damping, inertia))
        if (parent := joint.parent) >= 0:
            seat = (mounts[number] or Pose()).xyz
            radius, length = _largest_distances(joints[parent], rows[parent], seat)
            beyond = about_seat[number].with_link(link, distance)
            about_axis[parent] = about_axis[parent].plus(beyond.farther(radius))
            about_seat[parent] = about_seat[parent].plus(beyond.farther(length))
    return loads[::-1]


def _largest_distances(
    joint: MovingJoint, row: DenavitHartenberg, point: tuple[float, float, float]
) -> tuple[float, float]:
    """Return the distance of a point of a link from its axis, and the largest from where its row begins."""
    x, y, z = point
    c, s = math.cos(row.alpha), math.sin(row.alpha)
    radius, height = math.hypot(row.a + x, c * y - s * z), s * y + c * z
    strokes = (0.0,) if joint.is_revolute else joint.urdf.limit.position or (0.0,)
    return radius, math.hypot(radius, max(abs(row.d + height + stroke) for stroke in strokes))
