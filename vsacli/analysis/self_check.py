"""The check every run makes of itself: do the numbers satisfy what they were computed from?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.analysis.ladder import LADDER_BOUND, PROBES
from vsacli.base.arrays import AnyArray, evenly, of_joint
from vsacli.base.json_records import Stored, named
from vsacli.base.variables import Block
from vsacli.dynamics.balances import BALANCED, balances, damped_joints
from vsacli.robot.model import Robot

SPRING_BOUND = 1e-11
"""Bound on the scaled residual of (14); solutions reach 1e-15, and 1e-12 is asked of them."""

SHAFT_BOUND = 1e-11
"""The same of the balances of motors and windings, whose terms are sums of a few products: 2e-15 is seen."""

DRIFT_BOUND = 1e-6
"""The same where the deflections are followed by integration: below what spring constants are known to."""


@dataclass(frozen=True)
class SelfCheck(Stored):
    """Outcome of the self-check.

    Attributes:
        spring_residual: largest scaled residual of (14); NaN, like `ladder`, if a number is missing.
        ladder: largest relative error of a derivative against differences of what it derives.
        spring_bound: bound on the residual of (14).
        ladder_bound: bound on the error of a derivative, where it is nearest to its bound.
        shaft_residual: largest scaled residual of the balances of motors and windings, NaN likewise; 0 in
            results of before these were balanced.
    """

    spring_residual: float
    ladder: float
    spring_bound: float = SPRING_BOUND
    ladder_bound: float = LADDER_BOUND
    shaft_residual: float = 0.0

    shape: ClassVar = {
        **named("passed", "spring_residual", "shaft_residual", "ladder"),
        "bound": "ladder_bound",
    }

    @property
    def passed(self) -> bool:
        """Whether all are within their bounds."""
        springs_and_shafts = self.spring_residual <= self.spring_bound and self.shaft_residual <= SHAFT_BOUND
        return springs_and_shafts and self.ladder <= self.ladder_bound


class BalanceCheck:
    """The residuals of (14) and of the shafts over a run; `add` its blocks in order.

    The program that computes a step also computes its residuals, which covers all steps, but would be wrong
    with the program. So at `PROBES` steps they are computed apart from it, by NumPy, from the variables
    that it found. A program has no path that depends on values, but for its branches, loops and tables. If
    one of these, or all of it, is wrong, so is a stretch of the run, and one that takes more than a 199th of
    the steps is met.
    """

    def __init__(self, robot: Robot, samples: int) -> None:
        self._joints = robot.joints
        self._probed = evenly(samples, PROBES)
        self._excerpts: list[dict[str, AnyArray]] = []
        self._samples = 0
        self._error, self._shaft_error = 0.0, 0.0
        self._damped_error, self._damped_size = np.zeros((2, len(damped_joints(robot.joints))))

    def add(self, block: Block) -> None:
        """Merge a block of `BalancedDynamics`."""
        first, last = np.searchsorted(self._probed, (self._samples, self._samples + len(block.time)))
        probed = self._probed[first:last] - self._samples
        self._excerpts.append(
            {name: array[probed] for name, array in block.arrays().items() if name in BALANCED}
        )
        self._samples += len(block.time)
        self._error = np.maximum(self._error, block.spring_error.max())
        self._shaft_error = np.maximum(self._shaft_error, block.shaft_error.max())
        self._damped_error = np.maximum(self._damped_error, block.damped_error.max(axis=0))
        self._damped_size = np.maximum(self._damped_size, block.damped_size.max(axis=0))

    def residuals(self) -> tuple[float, float]:
        """The largest of springs and of shafts, scaled; NaN if a number is missing at a regular step."""
        probed = {name: np.concatenate([each[name] for each in self._excerpts]) for name in self._excerpts[0]}
        of_joints = [of_joint(probed, index) for index in range(len(self._joints))]
        apart = balances(self._joints, of_joints)
        error = np.max(apart["spring_error"], initial=self._error)
        damped_error = np.max([self._damped_error, *np.transpose(apart["damped_error"])], axis=0)
        size = np.maximum(self._damped_size, np.finfo(float).tiny)
        of_springs = float(np.max(damped_error / size, initial=error))
        return of_springs, float(np.max(apart["shaft_error"], initial=self._shaft_error))
