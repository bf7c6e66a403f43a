"""Motors, springs and dampers of the joints in MJCF.

A motor without springs moves with its joint. Springs are tendons: weighted sums of positions, with the
coefficients of a polynomial as stiffness; or they lie between a lever and the link.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.spring_elements import SpringElement
from vsacli.base.variables import VARIABLES
from vsacli.robot.joint import Joint
from vsacli.robot.models.mjcf_lever import add_lever, add_lever_spring
from vsacli.robot.models.mjcf_rotor import Rotor, add_rotors, add_sum, motor_name, rotors_of
from vsacli.robot.models.xml_text import Element, add, element

POLYNOMIAL_TERMS = 3
"""Of a spring's torque in MuJoCo: phi, phi^2 as it stands, phi^3."""

SLACK = (-1e6, 0.0)
"""Lengths of a tendon at which it does not pull."""


class Sections(NamedTuple):
    """Where the parts of a drive go."""

    world: Element
    tendons: Element
    actuators: Element


def has_springs_of(joint: Joint) -> bool:
    """Whether MJCF has springs such as those of a joint; also if it has none."""
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
    """By a motor whose rotor is a part of the joint."""
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
