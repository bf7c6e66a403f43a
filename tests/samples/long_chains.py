"""Chains of any length, of joints of all kinds."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle

import numpy as np

from samples.drives import springs
from samples.robots import random_joint
from samples.shipped import shipped_robot
from vsacli import Joint, Robot, laws

SHIPPED = ("mixed_3r", "rp_2", "measured_1r", "tendon_1r", "lwr_7r_vsa", "scara_4")
"""Rigid and elastic joints, prismatic ones, springs with tables, and limits among them."""


def random_chain(joints: int, seed: int = 1) -> Robot:
    """Revolute and prismatic joints with random constants, whose springs are solved by loops."""
    rng = np.random.default_rng(seed)
    return _chain([_random_joint(rng, number) for number in range(joints)])


def mixed_chain(joints: int, seed: int = 1) -> Robot:
    """The same with shipped joints in between."""
    rng = np.random.default_rng(seed)
    shipped = cycle(joint for name in SHIPPED for joint in shipped_robot(name).joints)
    return _chain([_random_joint(rng, number) if number % 2 else next(shipped) for number in range(joints)])


def _random_joint(rng: np.random.Generator, number: int) -> Joint:
    joint = random_joint(rng, "random", rng.choice(["R", "P"]))
    if number % 3:
        return joint
    unlike = (laws.Sinh(k=k, a=a) for k, a in rng.uniform(20, 30, (2, 2)).tolist())
    return replace(joint, actuator=springs(*unlike))


def _chain(joints: list[Joint]) -> Robot:
    named = tuple(replace(joint, name=f"joint_{number}") for number, joint in enumerate(joints))
    return Robot(name=f"chain-of-{len(named)}", gravity=(0.3, -9.7, 0.5), joints=named)
