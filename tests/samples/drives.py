"""Single joints, steps and short runs for tests of the actuation, about the 3R arm of Table I."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from samples.moves import move
from samples.robots import vsa_3r
from vsacli import Antagonistic, Joint, Limits, Motor, Robot, Trajectory, laws
from vsacli.actuators.transmission import Command
from vsacli.dynamics.drive import drive

ALIKE = laws.Cubic(k=400, k_c=2000)
"""Either spring of Table I."""


@dataclass(frozen=True)
class Stopped(laws.Cubic):
    """A cubic spring that ends at a stop, at 30 N m to either side."""

    @property
    def domain(self) -> tuple[float, float]:
        low, high = self.deflection(np.array(self.torque_range))
        return float(low), float(high)

    @property
    def torque_range(self) -> tuple[float, float]:
        return (-30.0, 30.0)

    def closed_pair(self, _other: laws.SpringLaw) -> laws.Pair | None:
        return None


def springs(first: laws.SpringLaw, second: laws.SpringLaw, branch: str = "positive") -> Antagonistic:
    motor = Motor(inertia=3, damping=0.1)
    return Antagonistic(motor=(motor, motor), spring=(first, second), branch=branch)


def joint_with(actuator: Antagonistic | None = None, limits: Limits | None = None) -> Joint:
    joint = vsa_3r().joints[1]
    return dataclasses.replace(joint, actuator=actuator or joint.actuator, limits=limits or joint.limits)


def with_joint(robot: Robot, index: int, joint: Joint) -> Robot:
    joints = list(robot.joints)
    joints[index] = joint
    return dataclasses.replace(robot, joints=tuple(joints))


def with_branch(joint: Joint, branch: str) -> Joint:
    return dataclasses.replace(joint, actuator=dataclasses.replace(joint.actuator, branch=branch))


def lower_by_branch(joint: Joint, tau_e: np.ndarray) -> dict[str, np.ndarray]:
    return {
        branch: drive(with_branch(joint, branch), command(tau_e=tau_e)).stiffness_min
        for branch in ("positive", "negative")
    }


def command(**given: np.ndarray | float) -> Command:
    """Steps that rest under no load at 850 N m/rad, except for what is given."""
    values = {**dict.fromkeys(Command.names(["stiffness"]), 0.0), "stiffness": 850.0, **given}
    arrays = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(value, dtype=float)) for value in values.values())
    )
    return Command.of(dict(zip(values, arrays, strict=True)))


def motion(
    stiffness: tuple[float, ...] = (850.0,) * 3,
    end_stiffness: tuple[float, ...] | None = None,
    duration: float = 2.0,
    rate: float = 100,
) -> Trajectory:
    """Rest to rest from 0 to 90, 45, -60 deg."""
    ends = (0,) * 3, (math.pi / 2, math.pi / 4, -math.pi / 3)
    of_stiffness = stiffness, end_stiffness or stiffness
    return move(duration, rate, ends, stiffness=of_stiffness, name="rest-to-rest")
