"""Tasks for the tests of fixes, and what their closed bounds say."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from samples.moves import move
from samples.robots import vsa_3r
from vsacli import (
    Antagonistic,
    DenavitHartenberg,
    Flag,
    Inertia,
    Joint,
    Limits,
    Link,
    Motor,
    Robot,
    Trajectory,
    inverse_dynamics,
    laws,
)
from vsacli.base.outputs import Outputs
from vsacli.base.signals import WRENCH
from vsacli.studies.search import Fix, write_fixed
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.profile import WrenchProfile

PAPER_END = (math.pi / 2, math.pi / 4, -math.pi / 3)
BASE, SHOULDER, ELBOW = range(3)
K, K_C = 400.0, 2000.0
"""Constants of the springs of Table I."""

CUBIC = laws.Cubic(k=K, k_c=K_C)


def rest_to_rest(
    duration: float,
    stiffness: float | tuple[float, ...] = 850.0,
    *,
    start: tuple[float, ...] = (0.0, 0.0, 0.0),
    end: tuple[float, ...] = PAPER_END,
    rate: float = 250.0,
) -> Trajectory:
    """A polynomial of degree 7 at constant stiffness."""
    values = stiffness if isinstance(stiffness, tuple) else (stiffness,) * len(end)
    return move(duration, rate, (start, end), stiffness=(values, values), name="test")


def changed(
    joint: int,
    *,
    robot: Robot | None = None,
    limits: Limits | None = None,
    motor: Any = None,
    spring: Any = None,
) -> Robot:
    """The 3R arm of the paper, or another robot, with one joint changed."""
    robot = robot or vsa_3r()
    joints = list(robot.joints)
    old = joints[joint]
    motors = tuple(dataclasses.replace(each, **(motor or {})) for each in old.actuator.motor)
    actuator = dataclasses.replace(old.actuator, motor=motors, spring=spring or old.actuator.spring)
    joints[joint] = dataclasses.replace(old, actuator=actuator, limits=limits or old.limits)
    return dataclasses.replace(robot, joints=tuple(joints))


def pendulum(spring: laws.SpringLaw = CUBIC, letter: str = "R", mass: float = 5.0) -> Robot:
    """One joint: a point mass 0.5 m from a horizontal axis, or on a vertical slide."""
    turning = letter == "R"
    joint = Joint(
        name="swing" if turning else "lift",
        type="revolute" if turning else "prismatic",
        dh=DenavitHartenberg(a=0.5 if turning else 0.0, alpha=0.0),
        link=Link(mass=mass, com=(0.0, 0.0, 0.0), inertia=Inertia(xx=0.0, yy=0.0, zz=0.0)),
        actuator=Antagonistic(motor=(Motor(inertia=0.5), Motor(inertia=0.5)), spring=(spring, spring)),
    )
    gravity = (0.0, -9.81, 0.0) if turning else (0.0, 0.0, -9.81)
    return Robot(name="pendulum", gravity=gravity, joints=(joint,))


def lowest_stiffness(tau_e: np.ndarray) -> np.ndarray:
    """Closed bound of two springs of Table I, solved by bisection on the deflection they share."""
    low, high = np.zeros_like(tau_e), np.full_like(tau_e, 1.0)
    for _ in range(60):
        middle = (low + high) / 2
        less = 2 * (K * middle + K_C * middle**3) < np.abs(tau_e)
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return 2 * K + 6 * K_C * low**2


def smallest_margin(robot: Robot, trajectory: Trajectory) -> float:
    """Over all steps and joints, from the closed bound."""
    result = inverse_dynamics(robot, trajectory)
    return float(np.min((result.stiffness - lowest_stiffness(result.tau_e)) / result.stiffness))


def accepted(robot: Robot, trajectory: Trajectory, min_margin: float = 0.01) -> bool:
    """The rule, read off the corridor and the flags of a run."""
    result = inverse_dynamics(robot, trajectory)
    room = np.minimum(result.stiffness - result.stiffness_min, result.stiffness_max - result.stiffness)
    narrow = np.any(room / result.stiffness < min_margin)  # NaN where a joint has no corridor
    return not narrow and not np.any(result.flags & ~np.uint32(Flag.NEAR_SINGULAR))


def pushed(trajectory: Trajectory, frame: str = "base") -> Trajectory:
    """The same motion while something pushes on the end effector more and more."""
    push = RestToRest(
        signal=WRENCH,
        span=trajectory.times.span,
        degree=3,
        start=(0.0,) * 6,
        end=(5.0, -4.0, -10.0, 0.5, 1.0, -0.3),
    )
    return Trajectory(
        trajectory.times,
        trajectory.position,
        trajectory.commanded,
        wrench=WrenchProfile(push, frame),
        name="pushed",
    )


def written(fix: Fix, path: Path, *, overwrite: bool = False) -> tuple[Path, ...]:
    """The files of a fix."""
    with Outputs(overwrite=overwrite) as outputs:
        write_fixed(fix, path, outputs)
    return outputs.paths
