"""Bodies and drives in MJCF: inertia of links, rotors, springs, levers, dampers, and the start of a motion.

Motors behind springs are bodies of their own. Springs and dampers are tendons whose length is a weighted sum
of joint and motor positions; only the spring of a lever mechanism follows its geometry in space.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.motor import JointMotor
from vsacli.actuators.spring_elements import LeverSpring, SpringElement
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.variables import VARIABLES
from vsacli.robot.joint import INERTIA_ROUNDING, Joint, Link
from vsacli.robot.model import Robot
from vsacli.robot.models.exported_model import Element, Value, add_element, set_attributes

SMALLEST_INERTIA = 1e-14
"""Smallest mass, kg, and moment of inertia, kg m^2, written: ten times what MuJoCo treats as zero."""

ROUNDING = 1e-14
"""Share of the largest moment that is added to all moments if the largest equals the sum of the others, as
for flat bodies: MuJoCo rotates the tensor to its principal axes, where rounding may make the largest one
exceed the sum. In a test with two thousand flat bodies whose moments span six decades, 3e-15 was enough."""


def check_bodies(robot: Robot) -> None:
    """Raise an error for links that MuJoCo refuses.

    Raises:
        InputError: MuJoCo refuses links; names each with the reason.
    """
    reasons = [reason for joint in robot.joints for reason in _refusal_reasons(joint)]
    if reasons:
        raise InputError(Problem(robot_file_path(robot), 0, reason) for reason in reasons)


def robot_file_path(robot: Robot) -> str:
    """Return the path of the file that a robot was read from; empty without one."""
    return next((source.path for source in robot.sources), "")


def _refusal_reasons(joint: Joint) -> Iterator[str]:
    link = joint.link
    low, middle, high = link.inertia.principal_moments
    link_text = f"link of joint {joint.name}"
    if link.mass < SMALLEST_INERTIA:
        yield f"{link_text}: MuJoCo takes no body without mass; give it one, however small"
    elif low < SMALLEST_INERTIA:
        refusal = (
            f"its smallest moment of inertia is {low:.3g} kg m^2, and MuJoCo takes none below "
            f"{SMALLEST_INERTIA:g}"
        )
        yield f"{link_text}: {refusal}; give it one that makes no difference"
    elif high - low - middle > INERTIA_ROUNDING * high:
        sides = f"{high:.4g} > {low:.4g} + {middle:.4g} kg m^2"
        yield f"{link_text}: its inertia breaks the triangle inequality ({sides}), which MuJoCo refuses"


def full_inertia(link: Link) -> tuple[float, ...]:
    """Return entries xx, yy, zz, xy, xz, yz of the inertia tensor about the center of mass, kg m^2."""
    inertia = link.inertia
    low, middle, high = inertia.principal_moments
    excess, rounding = float(high - low - middle), ROUNDING * float(high)
    increase = max(excess, 0.0) + rounding if excess > -rounding else 0.0
    moments = (inertia.xx + increase, inertia.yy + increase, inertia.zz + increase)
    return (*moments, inertia.xy, inertia.xz, inertia.yz)


class Rotor(NamedTuple):
    """A motor, with the name of its coordinate, and its inertia without the coupled part."""

    name: str
    motor: JointMotor
    inertia: float


def motor_name(joint: Joint, number: int) -> str:
    """Return the name of the coordinate of motor 1 or 2; that of the joint if there are no springs."""
    return f"{joint.name}.motor_{number}" if joint.actuator.sprung else joint.name


def rotors_with_tendons(joint: Joint, tendons: Element) -> list[Rotor]:
    """Return the motors of a joint; a coupling of their inertias becomes the inertia of a tendon.

    A tendon along theta_1 + w theta_2 with inertia m adds m to motor 1, m w^2 to motor 2, and the coupling m
    w. With w^2 = B_2/B_1 these are a share |B_12|/sqrt(B_1 B_2), below 1, of either motor's inertia.
    """
    actuator = joint.actuator
    named_motors = [(motor_name(joint, number), motor) for number, motor in enumerate(actuator.motors, 1)]
    rotors = [Rotor(name, motor, motor.inertia) for name, motor in named_motors]
    coupled_inertia = actuator.coupled_rotors
    if not coupled_inertia:
        return rotors
    first, second = rotors
    weight = math.copysign(math.sqrt(second.inertia / first.inertia), coupled_inertia)
    inertia = coupled_inertia / weight
    tendon = add_weighted_sum(
        tendons, f"{joint.name}.coupled_inertia", {first.name: 1.0, second.name: weight}
    )
    set_attributes(tendon, armature=inertia)
    remaining_share = 1 - inertia / first.inertia
    return [rotor._replace(inertia=remaining_share * rotor.inertia) for rotor in rotors]


def add_rotors(world: Element, rotors: list[Rotor], *, coupled: bool) -> None:
    """Add rotors as separate bodies that turn about z.

    If they are coupled, the body of the second is inside that of the first, since MuJoCo stores no inertia
    between coordinates of which neither moves the other.
    """
    parent = world
    for rotor in rotors:
        body = add_rotor(parent, rotor, type="hinge")
        parent = body if coupled else world


def add_rotor(parent: Element, rotor: Rotor, **attributes: Value) -> Element:
    """Add the body of a motor to another body, with its coordinate along or about z, and return it."""
    body = add_element(parent, "body", name=rotor.name)
    add_element(body, "inertial", pos=(0, 0, 0), mass=SMALLEST_INERTIA, diaginertia=(SMALLEST_INERTIA,) * 3)
    damping, inertia = rotor.motor.damping, rotor.inertia
    add_element(
        body, "joint", name=rotor.name, axis=(0, 0, 1), armature=inertia, damping=damping, **attributes
    )
    return body


def add_weighted_sum(tendons: Element, name: str, weights: dict[str, float]) -> Element:
    """Add a tendon whose length is a weighted sum of positions, and return it."""
    tendon = add_element(tendons, "fixed", name=name)
    for position, weight in weights.items():
        add_element(tendon, "joint", joint=position, coef=weight)
    return tendon


ANCHOR = 2.0
"""Distance of the anchor from motor 2 at zero, 1 m for 1 rad; motor 2 is farther away under pretension."""

POINT_SIZE = 0.005
"""Size of a drawn point, m."""

LEVER_COLOR = (0.8, 0.4, 0.2, 1)

GHOST: dict[str, Value] = {"contype": 0, "conaffinity": 0, "mass": 0}
"""Attributes of a shape that is only drawn."""

HIDDEN_GROUP = 4
"""Group that a viewer hides by default: the spring would also be drawn along the pulley, a meter per
radian."""


def draw_rod(body: Element, end: Sequence[float], radius: float, color: Sequence[float]) -> None:
    """Draw a rod from the origin of a body to a point, without mass and contact."""
    ends = (0, 0, 0, *end)
    add_element(body, "geom", type="capsule", fromto=ends, size=radius, rgba=color, **GHOST)


def add_lever(below: Element, joint: Joint, spring: LeverSpring, rotors: Sequence[Rotor]) -> None:
    """Add both motors to the body at the joint's row; at zero, the lever is aligned with the link."""
    first, second = rotors
    half_angle = joint.dh.theta / 2
    lever = add_rotor(below, first, type="hinge")
    set_attributes(lever, quat=(math.cos(half_angle), 0, 0, math.sin(half_angle)))
    draw_rod(lever, (spring.lever, 0, 0), POINT_SIZE, LEVER_COLOR)
    add_element(lever, "site", name=f"{joint.name}.lever", pos=(spring.lever, 0, 0), size=POINT_SIZE)
    anchor_z = -math.copysign(ANCHOR, spring.lead)
    add_element(lever, "site", name=f"{second.name}.anchor", pos=(0, 0, anchor_z), size=POINT_SIZE)
    slide = add_rotor(lever, second, type="slide")
    add_element(slide, "site", name=f"{second.name}.end", pos=(0, 0, 0), size=POINT_SIZE)


def add_lever_spring(tendons: Element, joint: Joint, spring: LeverSpring, setter: str, body: Element) -> None:
    """Add the spring from the lever to a point of the link, and via the pulley from the anchor to motor 2."""
    dh, lead = joint.dh, abs(spring.lead)
    point = (spring.arm - dh.a, -dh.d * math.sin(dh.alpha), -dh.d * math.cos(dh.alpha))
    add_element(body, "site", name=f"{joint.name}.point", pos=point, size=POINT_SIZE)
    tendon = add_element(tendons, "spatial", name=f"{joint.name}.spring", stiffness=spring.stiffness)
    set_attributes(tendon, springlength=abs(spring.arm - spring.lever) + ANCHOR * lead, group=HIDDEN_GROUP)
    add_element(tendon, "site", site=f"{joint.name}.lever")
    add_element(tendon, "site", site=f"{joint.name}.point")
    add_element(tendon, "pulley", divisor=1 / lead)
    add_element(tendon, "site", site=f"{setter}.anchor")
    add_element(tendon, "site", site=f"{setter}.end")


POLYNOMIAL_TERMS = 3
"""Number of terms of a spring's torque in MuJoCo: phi, phi^2, phi^3."""

SLACK_LENGTHS = (-1e6, 0.0)
"""Range of lengths at which a tendon is slack."""


class Sections(NamedTuple):
    """Sections of the file that contain the parts of a drive."""

    world: Element
    tendons: Element
    actuators: Element


def springs_are_expressible(joint: Joint) -> bool:
    """Return whether MJCF can express the springs of a joint; True if it has none."""
    elements = joint.actuator.spring_elements
    is_polynomial = elements is not None and all(
        _polynomial_stiffness(element.law) is not None for element in elements
    )
    return is_polynomial or joint.actuator.lever_spring is not None


def add_drive(sections: Sections, joint: Joint, below: Element, body: Element) -> None:
    """Add motors, springs and torques of a joint; `below` is the body at its row, `body` its link's."""
    rotors = rotors_with_tendons(joint, sections.tendons)
    for rotor in rotors:
        _add_actuator(sections.actuators, rotor)
    lever = joint.actuator.lever_spring
    if not joint.actuator.sprung:
        _add_direct_drive(body, joint, rotors)
    elif lever is not None:
        add_lever(below, joint, lever, rotors)
        add_lever_spring(sections.tendons, joint, lever, rotors[1].name, body)
    else:
        add_rotors(sections.world, rotors, coupled=joint.actuator.coupled_rotors != 0)
        if springs_are_expressible(joint):
            _add_springs(sections.tendons, joint)


def _add_direct_drive(body: Element, joint: Joint, rotors: Sequence[Rotor]) -> None:
    """Add the inertia and damping of a motor, whose rotor moves with the joint, to the joint."""
    (joint_element,), (rotor,) = body.findall("joint"), rotors
    set_attributes(joint_element, armature=rotor.inertia, damping=joint.damping + rotor.motor.damping)


def _add_actuator(actuators: Element, rotor: Rotor) -> None:
    actuator = add_element(actuators, "motor", name=f"{rotor.name}.torque", joint=rotor.name)
    max_torque = rotor.motor.max_torque
    if math.isfinite(max_torque):
        set_attributes(actuator, ctrlrange=(-max_torque, max_torque), ctrllimited=False)


def _add_springs(tendons: Element, joint: Joint) -> None:
    for number, element in enumerate(joint.actuator.spring_elements or (), 1):
        _add_spring(tendons, f"{joint.name}.spring_{number}", joint, element)


def _add_spring(tendons: Element, name: str, joint: Joint, spring: SpringElement) -> None:
    """Add a tendon with the law of a spring, reversed if it pulls only at negative deflections."""
    sign = -1.0 if spring.law.domain[1] <= 0 else 1.0
    motors = [motor_name(joint, number) for number in range(1, 1 + len(spring.motors))]
    weights = zip((joint.name, *motors), (spring.joint, *spring.motors), strict=True)
    tendon = add_weighted_sum(
        tendons, name, {position: sign * weight for position, weight in weights if weight}
    )
    terms = [
        term * sign ** (power + 1) for power, term in enumerate(_polynomial_stiffness(spring.law) or (), 1)
    ]
    set_attributes(tendon, stiffness=terms, springlength=SLACK_LENGTHS if spring.law.pulls_only else 0)


def _polynomial_stiffness(law: SpringLaw) -> tuple[float, ...] | None:
    """Return the stiffness of a tendon, one number if linear; None if MuJoCo has no such spring."""
    terms = law.polynomial
    if terms is None or len(terms) > POLYNOMIAL_TERMS:
        return None
    return terms if len(terms) == 1 else (*terms, 0.0)[:POLYNOMIAL_TERMS]


def add_dampers(sections: Sections, joints: Iterable[Joint]) -> None:
    """Add dampers, each with its damping as a control; these controls follow the torques of the motors."""
    for joint in joints:
        if joint.damper_at("link"):
            _add_damper(sections.actuators, f"{joint.name}.damping", joint=joint.name)
        if joint.damper_at("transmission"):
            for number, has_spring in enumerate(joint.actuator.has_columns(VARIABLES["phi"]), 1):
                if has_spring:
                    name = f"{joint.name}.damper_{number}"
                    add_weighted_sum(
                        sections.tendons, name, {motor_name(joint, number): 1.0, joint.name: -1.0}
                    )
                    _add_damper(sections.actuators, f"{joint.name}.damping_{number}", tendon=name)


def _add_damper(actuators: Element, name: str, **attachment: str) -> None:
    """Add a force that is minus the velocity times the control."""
    add_element(actuators, "general", name=name, gaintype="affine", gainprm=(0, 0, -1), **attachment)


KEY = "start"
"""Name of the key frame."""


class Start(NamedTuple):
    """The first sample of a run.

    Attributes:
        q, dq: positions and velocities of the joints, (joints,), rad (m) and rad/s (m/s).
        theta, dtheta: positions and velocities of the motors, joint side of the gear, (joints, 2).
    """

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray


def add_start(root: Element, world: Element, robot: Robot, start: Start) -> None:
    """Add a key frame with positions and velocities in the order of the coordinates in the world.

    Raises:
        InputError: a motor position is undefined, since the sample is infeasible or singular.
    """
    states: dict[str, tuple[float, float]] = {}
    for index, joint in enumerate(robot.joints):
        for motor in range(joint.actuator.motor_count):
            states[motor_name(joint, motor + 1)] = start.theta[index, motor], start.dtheta[index, motor]
        states[joint.name] = start.q[index], start.dq[index]
    undefined_names = [name for name, state in states.items() if not np.isfinite(state).all()]
    if undefined_names:
        raise InputError.one(
            f"no motion begins where {', '.join(undefined_names)} has no position or velocity"
        )
    states_in_order = [states[str(coordinate.get("name"))] for coordinate in world.iter("joint")]
    positions, velocities = zip(*states_in_order, strict=True)
    key = add_element(root, "keyframe")
    add_element(key, "key", name=KEY, qpos=map(float, positions), qvel=map(float, velocities))
