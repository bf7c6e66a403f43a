"""Random arms of one kind of drive, and the same arms with the parameters that a file might have."""

from __future__ import annotations

import numpy as np

from samples.robots import inertia_from_tensor
from vsacli import Antagonistic, DenavitHartenberg, Elastic, Friction, Joint, Link, Motor, Rigid, Robot, laws
from vsacli.actuators.actuator import Actuator
from vsacli.robot.parameters import parameters

KINDS = ("rigid", "elastic", "antagonistic")

WIDTH = 0.05
"""Width of friction, rad/s: sharp friction jumps where motors reverse, a little earlier or later."""


def random_arm(kind: str, joints: int, rng: np.random.Generator) -> Robot:
    """An arm of light links under gravity of any direction, some motors and rigid joints with friction."""
    gravity = rng.normal(size=3)
    x, y, z = map(float, 9.81 * gravity / np.linalg.norm(gravity))
    chain = tuple(_joint(kind, f"joint_{number + 1}", rng) for number in range(joints))
    return Robot(name=f"random-{kind}", gravity=(x, y, z), joints=chain)


def _joint(kind: str, name: str, rng: np.random.Generator) -> Joint:
    rubs = kind == "rigid" and rng.random() < 0.4
    return Joint(
        name=name,
        type="revolute",
        dh=DenavitHartenberg(
            a=rng.uniform(0.1, 0.4),
            alpha=float(rng.choice([0, np.pi / 2, -np.pi / 2])),
            d=rng.uniform(0, 0.2),
        ),
        link=_link(rng),
        damping=rng.uniform(0.2, 1),
        friction=_friction(rng) if rubs else None,
        actuator=random_drive(kind, rng),
    )


def _link(rng: np.random.Generator) -> Link:
    mass, root = rng.uniform(1, 4), rng.normal(size=(3, 3))
    moments = mass * root @ root.T / 300 + 1e-3 * np.eye(3)
    x, y, z = map(float, rng.uniform(-0.1, 0.1, 3) - [0.15, 0, 0])
    inertia = inertia_from_tensor(np.trace(moments) * np.eye(3) - moments)
    return Link(mass=mass, com=(x, y, z), inertia=inertia)


def _friction(rng: np.random.Generator) -> Friction:
    size = rng.uniform(0.4, 2)
    return Friction(coulomb=(size, size), width=WIDTH)


def random_drive(kind: str, rng: np.random.Generator) -> Actuator:
    """An actuator of one of the `KINDS`, some of them with friction."""
    friction = _friction(rng) if rng.random() < 0.6 else None
    motor = Motor(inertia=rng.uniform(0.2, 3), damping=rng.uniform(0.3, 2), friction=friction)
    if kind == "rigid":
        return Rigid(motor=motor)
    if kind == "antagonistic":
        spring = laws.Cubic(k=rng.uniform(300, 500), k_c=rng.uniform(1500, 2500))
        return Antagonistic(motor=(motor, motor), spring=(spring, spring))
    hardening = laws.Cubic(k=rng.uniform(300, 600), k_c=rng.uniform(1500, 3000))
    return Elastic(
        motor=motor, spring=hardening if rng.random() < 0.5 else laws.Polynomial(c1=rng.uniform(300, 900))
    )


WORDS = {"damping": 0.5, "inertia": 0.5, "coulomb": 0.5, "k": 0.3, "k_c": 0.3, "c1": 0.3}
"""By how much parameters of joints, motors and springs are off, by the last word of their paths."""


def misjudged(robot: Robot, rng: np.random.Generator) -> Robot:
    """The arm with its parameters off by up to 50 %, those of springs and centers of mass by 30 %."""
    changes: dict[str, float] = {}
    for each in parameters(robot):
        word = str(each.path[-1])
        if each.part != "link" and each.value and word in WORDS:
            changes[str(each)] = each.value * (1 + rng.uniform(-WORDS[word], WORDS[word]))
    for joint in robot.joints:
        factor, path = 1 + rng.uniform(-0.5, 0.5), f"joints.{joint.name}.link"
        changes[f"{path}.mass"] = joint.link.mass * factor
        for axis, value in enumerate(joint.link.com):
            changes[f"{path}.com.{axis}"] = value * (1 + rng.uniform(-0.3, 0.3))
        for entry, value in vars(joint.link.inertia).items():
            changes[f"{path}.inertia.{entry}"] = value * factor
    return robot.replace(changes)
