"""Springs and motors, of which a URDF says nothing, in proportion to what each joint carries.

A joint carries the links beyond it at a distance from its axis. Bounds of these distances over all
configurations give a bound I of the inertia about the axis, and with the mass m the torque
g sqrt(m I), which by Schwarz's inequality is at least that of gravity, however the arm stands and the axis
points. So also the springs of a vertical axis, which gravity does not load, fit the arm that they accelerate.
To this comes what the joint's damping asks for in a slow motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vsacli.actuators.actuator import PlaceholderConstants
from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.units import TORQUE
from vsacli.robot.joint import DenavitHartenberg, Link
from vsacli.robot.urdf.serial_chain import STANDARD_GRAVITY, ChainJoint

DEFLECTION = {True: 0.1, False: 0.01}
"""Deflection of springs by the largest load, at revolute (rad) and prismatic (m) joints."""

SLOW = {True: 1.0, False: 0.2}
"""Velocity of a slow motion, rad/s and m/s, which the springs carry the damping of; that of wrists in URDF
files exceeds their weight many times."""

HARDENING = 0.05
"""k_c/k times the square of this deflection; gives the k_c/k of 5 rad^-2 that the paper's springs have."""

MOTOR_SHARE = 0.5
"""Inertia of each motor relative to the largest that the joint carries. At the shoulders of the shipped arms
after the Panda, the UR5 and the LWR it is 0.1 to 0.9; it grows towards their wrists."""

DIGITS = 2
"""Digits of the constants, which are made up and should look so."""

LEAST_TORQUE, LEAST_INERTIA = 1e-9, 1e-12
"""N m and kg m^2 (N and kg); a joint that carries less carries nothing."""

UNLOADED = PlaceholderConstants(motor_inertia=1.0, stiffness=1000.0, spring=(400.0, 2000.0))
"""Constants of a joint without load, as in a file without masses."""


class Placeholders(NamedTuple):
    """The actuator of every joint as long as nothing is known of it, and its constants, in SI units.

    Constants that are None follow from what each joint carries.

    Attributes:
        actuator: a key of `vsacli.actuators.kinds.ACTUATORS`.
        motor_inertia: of each motor, joint side of the gear.
        stiffness: of an elastic transmission, and in the middle of what a serial one reaches.
        spring: k and k_c of the cubic springs of an antagonistic one.
    """

    actuator: str = "antagonistic"
    motor_inertia: float | None = None
    stiffness: float | None = None
    spring: tuple[float, float] | None = None

    def constants(self, joint: ChainJoint, load: JointLoad) -> PlaceholderConstants:
        """Return the constants of a joint from its load, its effort limit, and its gear."""
        gear = joint.urdf.gear_ratio if ACTUATORS[self.actuator].motor_count == 1 else None
        own = load.constants(DEFLECTION[joint.is_revolute], gear or 1.0)
        return PlaceholderConstants(
            motor_inertia=own.motor_inertia if self.motor_inertia is None else self.motor_inertia,
            stiffness=own.stiffness if self.stiffness is None else self.stiffness,
            spring=own.spring if self.spring is None else self.spring,
            max_torque=joint.urdf.limit.effort or math.inf,
            gear_ratio=gear,
        )

    def origin(self, field: str, joint: ChainJoint, load: JointLoad) -> str:
        """Return the source of the numbers in a field of its actuator, a clause."""
        sized = {"motor": self.motor_inertia, "stiffness": self.stiffness, "spring": self.spring}
        if not load.is_there or sized.get(field, ()) is not None:
            return "not from the URDF"
        if field == "motor":
            return f"{MOTOR_SHARE:g} times the largest inertia that it moves"
        give = f"{DEFLECTION[joint.is_revolute]:g} {joint.urdf.unit()}"
        torque = f"{_rounded(load.torque):g} {joint.urdf.unit(TORQUE)}"
        return f"gives way by {give} under {torque}, its largest load"


class JointLoad(NamedTuple):
    """The largest load of a joint.

    Attributes:
        torque: of weight and damping, N m (N).
        inertia: about its axis, kg m^2 (the mass, kg).
    """

    torque: float
    inertia: float

    @property
    def is_there(self) -> bool:
        """Whether there is anything to carry."""
        return self.torque > LEAST_TORQUE and self.inertia > LEAST_INERTIA

    def constants(self, deflection: float, gear: float) -> PlaceholderConstants:
        """Constants with which the load deflects the springs by so much, rad (m), of motors behind a gear."""
        if not self.is_there:
            return UNLOADED
        stiffness = _rounded(self.torque / deflection)
        k = _rounded(stiffness / 2)
        return PlaceholderConstants(
            motor_inertia=_rounded(MOTOR_SHARE * self.inertia / gear**2) * gear**2,
            stiffness=stiffness,
            spring=(k, _rounded(HARDENING * k / deflection**2)),
        )


def _rounded(number: float) -> float:
    return float(f"{number:.{DIGITS - 1}e}")


class _Masses(NamedTuple):
    """Bodies at distances of at most r from a point or an axis.

    Attributes:
        mass: sum of their masses m.
        first: sum of m r.
        second: sum of m r^2 and of their own largest moments of inertia.
    """

    mass: float = 0.0
    first: float = 0.0
    second: float = 0.0

    def farther(self, distance: float) -> _Masses:
        """Seen from a point that is so far from the first."""
        second = self.second + (2 * self.first + self.mass * distance) * distance
        return _Masses(self.mass, self.first + self.mass * distance, second)

    def joined(self, link: Link, distance: float) -> _Masses:
        """Return the masses with a further link whose centre of mass has this distance."""
        own = link.mass * distance
        moment = max(float(link.inertia.principal_moments[-1]), 0.0)
        return _Masses(self.mass + link.mass, self.first + own, self.second + own * distance + moment)


def joint_loads(
    joints: Sequence[ChainJoint], rows: Sequence[DenavitHartenberg], links: Sequence[Link]
) -> list[JointLoad]:
    """Return the largest load of each joint over all configurations.

    Args:
        joints: from the base.
        rows: of each joint.
        links: that each joint moves.
    """
    loads, beyond = [], _Masses()  # beyond joint i, as seen from the origin of frame i
    for joint, row, link in zip(reversed(joints), reversed(rows), reversed(links), strict=True):
        radius, height = _centre(row, link)
        about_axis = beyond.farther(abs(row.a)).joined(link, radius)
        inertia = about_axis.second if joint.is_revolute else about_axis.mass
        weight = STANDARD_GRAVITY * math.sqrt(about_axis.mass * inertia)
        loads.append(JointLoad(weight + SLOW[joint.is_revolute] * joint.urdf.damping, inertia))
        strokes = (0.0,) if joint.is_revolute else joint.urdf.limit.position or (0.0,)
        length = math.hypot(row.a, max(abs(row.d + stroke) for stroke in strokes))
        distance = math.hypot(radius, max(abs(row.d + height + stroke) for stroke in strokes))
        beyond = beyond.farther(length).joined(link, distance)
    return loads[::-1]


def _centre(row: DenavitHartenberg, link: Link) -> tuple[float, float]:
    """Distance of a link's centre of mass from the axis that moves it, and its height along it above d."""
    x, y, z = link.com
    c, s = math.cos(row.alpha), math.sin(row.alpha)
    return math.hypot(row.a + x, c * y - s * z), s * y + c * z
