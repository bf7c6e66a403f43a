"""Robots and motions for tests, built from the constructors of vsacli.robot."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from vsacli import Antagonistic, DenavitHartenberg, Inertia, Joint, Link, Motor, Robot, laws

JOINT_TYPES = {"R": "revolute", "P": "prismatic"}
ODD_GRAVITY = (3.1, -6.4, -4.7)
"""m/s^2; along no axis, so that a wrong frame or sign shows at every joint."""

RATE_SCALES = (math.pi, 5.0, 50.0, 500.0, 5000.0)
"""Half-widths of q .. d4q in `random_motion`: fast enough that velocity products outweigh gravity."""

MotionArrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def inertia_from_tensor(tensor: np.ndarray) -> Inertia:
    """The record of a symmetric 3x3 tensor."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
    return Inertia(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz)


def random_inertia(rng: np.random.Generator) -> Inertia:
    """A full tensor of a body that could exist: tr(P) 1 - P with P = integral(r r^T dm) positive definite."""
    root = rng.uniform(-0.3, 0.3, (3, 3))
    second_moments = root @ root.T
    return inertia_from_tensor(np.trace(second_moments) * np.eye(3) - second_moments)


def random_link(rng: np.random.Generator) -> Link:
    """A link with its center of mass off every axis and products of inertia."""
    x, y, z = rng.uniform(-0.3, 0.3, 3).tolist()
    return Link(mass=rng.uniform(0.5, 8), com=(x, y, z), inertia=random_inertia(rng))


def random_dh(rng: np.random.Generator) -> DenavitHartenberg:
    """A general row, or one of the special geometries (parallel, right-angled, intersecting axes)."""
    special_angles = (0.0, math.pi / 2, -math.pi / 2, math.pi)
    lengths = [rng.uniform(-1, 1) if rng.random() < 0.7 else 0.0 for _ in range(2)]
    angles = [
        rng.uniform(-3, 3) if rng.random() < 0.6 else float(rng.choice(special_angles)) for _ in range(2)
    ]
    return DenavitHartenberg(a=lengths[0], alpha=angles[0], d=lengths[1], theta=angles[1])


def alike_springs() -> tuple[laws.SpringLaw, laws.SpringLaw]:
    """The springs of Table I."""
    return (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=400, k_c=2000))


def random_actuator(rng: np.random.Generator) -> Antagonistic:
    """Motors and cubic springs that differ between the two sides."""
    first, second = (Motor(inertia=rng.uniform(0.5, 4), damping=rng.uniform(0, 0.1)) for _ in range(2))
    pull, push = (laws.Cubic(k=rng.uniform(300, 600), k_c=rng.uniform(1500, 3000)) for _ in range(2))
    return Antagonistic(motor=(first, second), spring=(pull, push))


def random_joint(rng: np.random.Generator, name: str, letter: str) -> Joint:
    """A joint of the type R or P with everything random, damping included."""
    return Joint(
        name=name,
        type=JOINT_TYPES[letter],
        dh=random_dh(rng),
        link=random_link(rng),
        damping=rng.uniform(0.1, 2),
        actuator=random_actuator(rng),
    )


def random_robot(types: str, seed: int) -> Robot:
    """A chain such as "RPR" with random geometry, inertia, damping and actuators, under odd gravity."""
    rng = np.random.default_rng(seed)
    joints = tuple(
        random_joint(rng, f"joint_{number}", letter) for number, letter in enumerate(types, start=1)
    )
    return Robot(name=f"random-{types}-{seed}", gravity=ODD_GRAVITY, joints=joints)


def robot_of_ones(types: str) -> Robot:
    """A chain whose constants are 0, 1 and -1 wherever they can be: what exact folding acts on."""
    link = Link(mass=1, com=(1, 0, -1), inertia=Inertia(xx=1, yy=1, zz=1))
    actuator = random_actuator(np.random.default_rng(1))
    joints = tuple(
        Joint(
            name=f"joint_{number}",
            type=JOINT_TYPES[letter],
            dh=DenavitHartenberg(a=1, alpha=(math.pi, math.pi / 2, 0)[number % 3], d=-1, theta=-math.pi / 2),
            link=link,
            damping=1,
            actuator=actuator,
        )
        for number, letter in enumerate(types)
    )
    return Robot(name=f"ones-{types}", gravity=(0, -1, 1), joints=joints)


def almost_square_robot() -> Robot:
    """Right angles missed by 1e-9 rad: next to what exact folding acts on, and not to be folded."""
    robot = random_robot("RPRP", seed=99)
    angle = math.pi / 2 + 1e-9
    joints = tuple(
        dataclasses.replace(joint, dh=DenavitHartenberg(a=0.5, alpha=angle, d=0.5, theta=angle))
        for joint in robot.joints
    )
    return dataclasses.replace(robot, name="almost-square", joints=joints)


def random_motion(robot: Robot, samples: int, seed: int) -> MotionArrays:
    """Unrelated random q, dq, ddq, d3q, d4q, each (samples, joints); no path, but any instant is possible."""
    rng = np.random.default_rng(seed)
    shape = (samples, len(robot.joints))
    q, dq, ddq, d3q, d4q = (rng.uniform(-scale, scale, shape) for scale in RATE_SCALES)
    return q, dq, ddq, d3q, d4q


def at_rest(robot: Robot, q: np.ndarray) -> MotionArrays:
    """The motion that stays at each row of q, shape (samples, joints)."""
    zero = np.zeros((len(q), len(robot.joints)))
    return q, zero, zero, zero, zero


def still_joint(name: str, letter: str = "R", dh: DenavitHartenberg | None = None) -> Joint:
    """A massless joint, by default without extent, that changes nothing while it is held still."""
    return Joint(
        name=name,
        type=JOINT_TYPES[letter],
        dh=dh or DenavitHartenberg(a=0, alpha=0),
        link=Link(mass=0, com=(0, 0, 0), inertia=Inertia(xx=0, yy=0, zz=0)),
        actuator=Antagonistic(motor=(Motor(inertia=1), Motor(inertia=1)), spring=alike_springs()),
    )


def with_gravity(robot: Robot, gravity: Sequence[float] | np.ndarray) -> Robot:
    """The same robot elsewhere."""
    x, y, z = map(float, gravity)
    return dataclasses.replace(robot, gravity=(x, y, z))


def vsa_3r() -> Robot:
    """The spatial 3R arm of Table I, Buondonno & De Luca (2016), with the digits printed there."""
    return Robot(
        name="vsa-3r",
        joints=(
            _table_one_joint("base", 0.0, math.pi / 2, 9.0478, (0.1299, 0.0185, 0.1299), 3.20),
            _table_one_joint("shoulder", 0.3, 0.0, 6.7858, (0.0139, 0.0578, 0.0578), 3.05),
            _table_one_joint("elbow", 0.3, 0.0, 5.0894, (0.0104, 0.0434, 0.0434), 1.98),
        ),
    )


def _table_one_joint(
    name: str, a: float, alpha: float, mass: float, moments: tuple[float, float, float], motor_inertia: float
) -> Joint:
    xx, yy, zz = moments
    motor = Motor(inertia=motor_inertia, damping=1e-4)
    return Joint(
        name=name,
        type="revolute",
        dh=DenavitHartenberg(a=a, alpha=alpha),
        link=Link(mass=mass, com=(-a / 2, 0, 0), inertia=Inertia(xx=xx, yy=yy, zz=zz)),
        damping=1e-5,
        actuator=Antagonistic(motor=(motor, motor), spring=alike_springs()),
    )
