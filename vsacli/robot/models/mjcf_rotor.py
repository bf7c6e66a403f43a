"""Motors behind springs in MJCF.

In the model of flexible joints a rotor feels nothing but its own acceleration. So it has a body of its own
with hardly any mass, and its inertia is the `armature` of its coordinate, which nothing else feels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vsacli.actuators.motor import JointMotor
from vsacli.robot.joint import Joint
from vsacli.robot.models.mujoco_bodies import LEAST
from vsacli.robot.models.xml_text import Element, Value, add, element


class Rotor(NamedTuple):
    """A motor: what its coordinate is called, and its inertia less what is coupled."""

    name: str
    motor: JointMotor
    inertia: float


def motor_name(joint: Joint, number: int) -> str:
    """Name of the coordinate of a motor, 1 or 2: that of the joint where there are no springs."""
    return f"{joint.name}.motor_{number}" if joint.actuator.sprung else joint.name


def rotors_of(joint: Joint, tendons: Element) -> list[Rotor]:
    """The motors of a joint; what couples their inertias becomes the inertia of a tendon between them.

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
    """The body of a motor in another body, with its coordinate along or about z."""
    body = element(parent, "body", name=rotor.name)
    element(body, "inertial", pos=(0, 0, 0), mass=LEAST, diaginertia=(LEAST,) * 3)
    damping, inertia = rotor.motor.damping, rotor.inertia
    element(body, "joint", name=rotor.name, axis=(0, 0, 1), armature=inertia, damping=damping, **attributes)
    return body


def add_sum(tendons: Element, name: str, weights: dict[str, float]) -> Element:
    """A tendon whose length is a weighted sum of positions."""
    tendon = element(tendons, "fixed", name=name)
    for position, weight in weights.items():
        element(tendon, "joint", joint=position, coef=weight)
    return tendon
