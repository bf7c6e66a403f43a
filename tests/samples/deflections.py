"""Motions of an arm whose deflections are integrated from those of the first step on."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from samples.moves import move
from samples.robots import vsa_3r
from vsacli import Result, Robot, Trajectory, inverse_dynamics
from vsacli.dynamics.integrated_deflections import IntegratedDeflections, integrate_deflections

ARM = dataclasses.replace(vsa_3r(), joints=vsa_3r().joints[:2])
"""Base and shoulder: the base carries nothing while the arm is still, the shoulder the weight of its link."""

DRIFT = 1e-11
"""Drift, rad or m: each of about 40 integration steps may err by 1e-12 of deflections of about 0.1."""

COARSE = 1e-8
"""Tolerance where only the course of things matters, to save time."""

MOTOR_VARIABLES = ("phi", "dphi", "theta", "dtheta", "ddtheta", "tau_transmission", "tau_motor", "det_A")


def motion(
    start: tuple[float, float] = (850.0, 850.0), end: tuple[float, float] | None = None, rate: float = 100
) -> Trajectory:
    """Rest to rest of base and shoulder, in 2 s."""
    ends = (0.0, 0.0), (math.pi / 2, math.pi / 4)
    return move(2.0, rate, ends, stiffness=(start, end or start), name="rest-to-rest")


def integrated(robot: Robot, trajectory: Trajectory, tolerance: float = 1e-12) -> Result:
    return inverse_dynamics(
        robot, trajectory, deflection_solver=integrate_deflections(robot, trajectory, tolerance)
    )


def drifts(result: Result) -> list[float]:
    return [drift.largest for drift in result.report.drifts]


@dataclass(frozen=True)
class Dip:
    """Stiffness of two joints, of which the first dips to a floor at 1.3 s and rises again."""

    floor: float
    bend: float = 60.0
    bottom: float = 1.3
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    components: int = 2

    @property
    def breakpoints(self) -> np.ndarray:
        return np.array([0.0, 2.0])

    def at(self, time: np.ndarray) -> np.ndarray:
        away = time - self.bottom
        dip = [self.floor + self.bend * away**2, 2 * self.bend * away, np.full_like(time, 2 * self.bend)]
        steady = [np.full_like(time, 1000.0), np.zeros_like(time), np.zeros_like(time)]
        return np.stack([np.stack([first, other]) for first, other in zip(dip, steady, strict=True)])

    def samples(self, _start: int, _stop: int, time: np.ndarray, /) -> np.ndarray:
        return self.at(time)

    @property
    def known_between(self) -> bool:
        return True

    @property
    def estimate(self) -> None:
        return None

    def stretched(self, factor: float) -> Dip:
        raise AssertionError(f"nobody stretches this by {factor}")


def dipping(floor: float) -> Trajectory:
    """The arm keeps still; joint 1, which carries nothing, reaches 2K = 800 N m/rad and up."""
    plain = motion()
    still = dataclasses.replace(plain.position, end=plain.position.start)
    return Trajectory(plain.times, still, {"stiffness": Dip(floor)}, name="dip")


def softening() -> Trajectory:
    """The shoulder becomes softer than its load allows, the base stiffer."""
    return motion(end=(1275.0, 790.0))


@cache
def softened() -> IntegratedDeflections:
    """The deflections of `softening`, coarsely integrated; not to be changed."""
    return integrate_deflections(ARM, softening(), COARSE)
