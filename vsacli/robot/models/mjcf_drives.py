"""Bodies and drives in MJCF: links with their inertia, rotors, springs, levers, and where they start."""

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
from vsacli.robot.models.exported_model import Element, Value, add, element

LEAST = 1e-14
"""Mass, kg, and moment of inertia, kg m^2, that MuJoCo takes: ten times what it holds for nothing."""

ROUNDING = 1e-14
"""Share of the largest moment that is added to all of them where the largest is the sum of both others, as of
flat bodies: MuJoCo turns the tensor to its principal axes, where rounding may find it larger. By trial on two
thousand flat bodies whose moments span six decades, 3e-15 does."""


def check_bodies(robot: Robot) -> None:
    """Refuse links that MuJoCo would.

    Raises:
        InputError: for each link, what is wrong with it.
    """
    reasons = [reason for joint in robot.joints for reason in _reasons(joint)]
    if reasons:
        raise InputError(Problem(file_of(robot), 0, reason) for reason in reasons)


def file_of(robot: Robot) -> str:
    """Return the file that a robot was read from, empty if there is none."""
    return next((source.path for source in robot.sources), "")


def _reasons(joint: Joint) -> Iterator[str]:
    link = joint.link
    low, middle, high = link.inertia.principal_moments
    whose = f"link of joint {joint.name}"
    if link.mass < LEAST:
        yield f"{whose}: MuJoCo takes no body without mass; give it one, however small"
    elif low < LEAST:
        least = f"its smallest moment of inertia is {low:.3g} kg m^2, and MuJoCo takes none below {LEAST:g}"
        yield f"{whose}: {least}; give it one that makes no difference"
    elif high - low - middle > INERTIA_ROUNDING * high:
        sides = f"{high:.4g} > {low:.4g} + {middle:.4g} kg m^2"
        yield f"{whose}: its inertia breaks the triangle inequality ({sides}), which MuJoCo refuses"


def full_inertia(link: Link) -> tuple[float, ...]:
    """Entries xx, yy, zz, xy, xz, yz about the centre of mass."""
    inertia = link.inertia
    low, middle, high = inertia.principal_moments
    excess, rounding = float(high - low - middle), ROUNDING * float(high)
    added = max(excess, 0.0) + rounding if excess > -rounding else 0.0
    moments = (inertia.xx + added, inertia.yy + added, inertia.zz + added)
    return (*moments, inertia.xy, inertia.xz, inertia.yz)


class Rotor(NamedTuple):
    """A motor: what its coordinate is called, and its inertia less what is coupled."""

    name: str
    motor: JointMotor
    inertia: float


def motor_name(joint: Joint, number: int) -> str:
    """Name of the coordinate of a motor, 1 or 2: that of the joint where there are no springs."""
    return f"{joint.name}.motor_{number}" if joint.actuator.sprung else joint.name


def rotors_of(joint: Joint, tendons: Element) -> list[Rotor]:
    """Return the motors of a joint; what couples their inertias becomes the inertia of a tendon between them.

    The inertia m of a tendon along theta_1 + w theta_2 is m of motor 1, m w^2 of motor 2, and m w of both.
    With w^2 = B_2/B_1 that takes |B_12|/sqrt(B_1 B_2) of either motor's inertia, which is less than all.
    """
    actuator = joint.actuator
    named = [(motor_name(joint, number), motor) for number, motor in enumerate(actuator.motors, 1)]
    rotors = [Rotor(name, motor, motor.inertia) for name, motor in named]
    coupled = actuator.coupled_rotors
    if not coupled:
        return rotors
    first, second = rotors
    weight = math.copysign(math.sqrt(second.inertia / first.inertia), coupled)
    inertia = coupled / weight
    tendon = add_sum(tendons, f"{joint.name}.coupled_inertia", {first.name: 1.0, second.name: weight})
    add(tendon, armature=inertia)
    left = 1 - inertia / first.inertia
    return [rotor._replace(inertia=left * rotor.inertia) for rotor in rotors]


def add_rotors(world: Element, rotors: list[Rotor], *, coupled: bool) -> None:
    """Rotors that turn by themselves, about z.

    If they are coupled, the second one's body is in that of the first: MuJoCo keeps no inertia between
    coordinates of which neither moves the other.
    """
    parent = world
    for rotor in rotors:
        body = add_rotor(parent, rotor, type="hinge")
        parent = body if coupled else world


def add_rotor(parent: Element, rotor: Rotor, **attributes: Value) -> Element:
    """Return the body of a motor in another body, with its coordinate along or about z."""
    body = element(parent, "body", name=rotor.name)
    element(body, "inertial", pos=(0, 0, 0), mass=LEAST, diaginertia=(LEAST,) * 3)
    damping, inertia = rotor.motor.damping, rotor.inertia
    element(body, "joint", name=rotor.name, axis=(0, 0, 1), armature=inertia, damping=damping, **attributes)
    return body


def add_sum(tendons: Element, name: str, weights: dict[str, float]) -> Element:
    """Return a tendon whose length is a weighted sum of positions."""
    tendon = element(tendons, "fixed", name=name)
    for position, weight in weights.items():
        element(tendon, "joint", joint=position, coef=weight)
    return tendon


ANCHOR = 2.0
"""Distance, m for rad, of the anchor from motor 2 at zero, which is its least while there is pretension."""

DRAWN = 0.005
"""Size of a drawn point, m."""

LEVER_COLOUR = (0.8, 0.4, 0.2, 1)

GHOST: dict[str, Value] = {"contype": 0, "conaffinity": 0, "mass": 0}
"""Attributes of a shape that is only drawn."""

HIDDEN = 4
"""Group of what a viewer does not show unless asked: the spring is drawn along the pulley, too, a metre for a
radian."""


def draw_rod(body: Element, end: Sequence[float], radius: float, colour: Sequence[float]) -> None:
    """A rod from the origin of a body to a point, without mass and contact."""
    ends = (0, 0, 0, *end)
    element(body, "geom", type="capsule", fromto=ends, size=radius, rgba=colour, **GHOST)


def add_lever(below: Element, joint: Joint, spring: LeverSpring, rotors: Sequence[Rotor]) -> None:
    """Both motors, on the link before the joint; the lever stands along the link while both are at zero."""
    first, second = rotors
    half = joint.dh.theta / 2
    lever = add_rotor(below, first, type="hinge")
    add(lever, quat=(math.cos(half), 0, 0, math.sin(half)))
    draw_rod(lever, (spring.lever, 0, 0), DRAWN, LEVER_COLOUR)
    element(lever, "site", name=f"{joint.name}.lever", pos=(spring.lever, 0, 0), size=DRAWN)
    place = -math.copysign(ANCHOR, spring.lead)
    element(lever, "site", name=f"{second.name}.anchor", pos=(0, 0, place), size=DRAWN)
    slide = add_rotor(lever, second, type="slide")
    element(slide, "site", name=f"{second.name}.end", pos=(0, 0, 0), size=DRAWN)


def add_lever_spring(tendons: Element, joint: Joint, spring: LeverSpring, setter: str, body: Element) -> None:
    """The spring from the lever to a point of the link, and by the pulley from the anchor to motor 2."""
    dh, lead = joint.dh, abs(spring.lead)
    place = (spring.arm - dh.a, -dh.d * math.sin(dh.alpha), -dh.d * math.cos(dh.alpha))
    element(body, "site", name=f"{joint.name}.point", pos=place, size=DRAWN)
    tendon = element(tendons, "spatial", name=f"{joint.name}.spring", stiffness=spring.stiffness)
    add(tendon, springlength=abs(spring.arm - spring.lever) + ANCHOR * lead, group=HIDDEN)
    element(tendon, "site", site=f"{joint.name}.lever")
    element(tendon, "site", site=f"{joint.name}.point")
    element(tendon, "pulley", divisor=1 / lead)
    element(tendon, "site", site=f"{setter}.anchor")
    element(tendon, "site", site=f"{setter}.end")


POLYNOMIAL_TERMS = 3
"""Terms of a spring's torque in MuJoCo: phi, phi^2 as it stands, phi^3."""

SLACK = (-1e6, 0.0)
"""Lengths of a tendon at which it does not pull."""


class Sections(NamedTuple):
    """Sections of the file for the parts of a drive."""

    world: Element
    tendons: Element
    actuators: Element


def has_springs_of(joint: Joint) -> bool:
    """Return whether MJCF has springs such as those of a joint; also if it has none."""
    elements = joint.actuator.spring_elements
    polynomial = elements is not None and all(_terms(each.law) is not None for each in elements)
    return polynomial or joint.actuator.lever_spring is not None


def add_drive(sections: Sections, joint: Joint, below: Element, body: Element) -> None:
    """Motors, springs and torques of a joint between two bodies, the second one that of its link."""
    rotors = rotors_of(joint, sections.tendons)
    for rotor in rotors:
        _actuate(sections.actuators, rotor)
    lever = joint.actuator.lever_spring
    if not joint.actuator.sprung:
        _drive_directly(body, joint, rotors)
    elif lever is not None:
        add_lever(below, joint, lever, rotors)
        add_lever_spring(sections.tendons, joint, lever, rotors[1].name, body)
    else:
        add_rotors(sections.world, rotors, coupled=joint.actuator.coupled_rotors != 0)
        if has_springs_of(joint):
            _add_springs(sections.tendons, joint)


def _drive_directly(body: Element, joint: Joint, rotors: Sequence[Rotor]) -> None:
    """Add a motor whose rotor is a part of the joint."""
    (moving,), (rotor,) = body.findall("joint"), rotors
    add(moving, armature=rotor.inertia, damping=joint.damping + rotor.motor.damping)


def _actuate(actuators: Element, rotor: Rotor) -> None:
    """The torque of a motor."""
    actuator = element(actuators, "motor", name=f"{rotor.name}.torque", joint=rotor.name)
    most = rotor.motor.max_torque
    if math.isfinite(most):
        add(actuator, ctrlrange=(-most, most), ctrllimited=False)


def _add_springs(tendons: Element, joint: Joint) -> None:
    for number, each in enumerate(joint.actuator.spring_elements or (), 1):
        _add_spring(tendons, f"{joint.name}.spring_{number}", joint, each)


def _add_spring(tendons: Element, name: str, joint: Joint, spring: SpringElement) -> None:
    """A tendon with the law of a spring; one that pulls at negative deflections only is turned round."""
    turned = -1.0 if spring.law.domain[1] <= 0 else 1.0
    motors = [motor_name(joint, number) for number in range(1, 1 + len(spring.motors))]
    weights = zip((joint.name, *motors), (spring.joint, *spring.motors), strict=True)
    tendon = add_sum(tendons, name, {position: turned * weight for position, weight in weights if weight})
    terms = [term * turned ** (power + 1) for power, term in enumerate(_terms(spring.law) or (), 1)]
    add(tendon, stiffness=terms, springlength=SLACK if spring.law.pulls_only else 0)


def _terms(law: SpringLaw) -> tuple[float, ...] | None:
    """Stiffness of a tendon, one number if the spring is linear; None if MuJoCo has no such spring."""
    terms = law.polynomial
    if terms is None or len(terms) > POLYNOMIAL_TERMS:
        return None
    return terms if len(terms) == 1 else (*terms, 0.0)[:POLYNOMIAL_TERMS]


def add_dampers(sections: Sections, joints: Iterable[Joint]) -> None:
    """Dampers, each with its damping as a control; they stand behind the torques of the motors."""
    for joint in joints:
        if joint.damper_at("link"):
            _add_damper(sections.actuators, f"{joint.name}.damping", joint=joint.name)
        if joint.damper_at("transmission"):
            for number, there in enumerate(joint.actuator.has(VARIABLES["phi"]), 1):
                if there:
                    name = f"{joint.name}.damper_{number}"
                    add_sum(sections.tendons, name, {motor_name(joint, number): 1.0, joint.name: -1.0})
                    _add_damper(sections.actuators, f"{joint.name}.damping_{number}", tendon=name)


def _add_damper(actuators: Element, name: str, **place: str) -> None:
    """A force of minus the velocity times the control."""
    element(actuators, "general", name=name, gaintype="affine", gainprm=(0, 0, -1), **place)


KEY = "start"
"""Name of the key frame."""


class Start(NamedTuple):
    """The first step of a run.

    Attributes:
        q, dq: positions and velocities of the joints, (joints,).
        theta, dtheta: those of the motors, joint side of the gear, (joints, 2).
    """

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray


def add_start(root: Element, world: Element, robot: Robot, start: Start) -> None:
    """A key frame with positions and velocities in the order in which the world has the coordinates.

    Raises:
        InputError: a motor has no position there, since the step is infeasible or singular.
    """
    states: dict[str, tuple[float, float]] = {}
    for index, joint in enumerate(robot.joints):
        for motor in range(joint.actuator.motor_count):
            states[motor_name(joint, motor + 1)] = start.theta[index, motor], start.dtheta[index, motor]
        states[joint.name] = start.q[index], start.dq[index]
    lost = [name for name, state in states.items() if not np.isfinite(state).all()]
    if lost:
        raise InputError.one(f"no motion begins where {', '.join(lost)} has no position or velocity")
    in_order = [states[str(coordinate.get("name"))] for coordinate in world.iter("joint")]
    positions, velocities = zip(*in_order, strict=True)
    key = element(root, "keyframe")
    element(key, "key", name=KEY, qpos=map(float, positions), qvel=map(float, velocities))
