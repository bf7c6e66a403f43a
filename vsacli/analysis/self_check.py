"""The check every run makes of itself: do the numbers satisfy what they were computed from?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.analysis.ladder import LADDER_BOUND
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag, has
from vsacli.base.json_records import Stored, named
from vsacli.base.variables import Block
from vsacli.robot.model import Robot

SPRING_BOUND = 1e-11
"""Bound on the scaled residual of (14); solutions reach 1e-15, and 1e-12 is asked of them."""

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
    """

    spring_residual: float
    ladder: float
    spring_bound: float = SPRING_BOUND
    ladder_bound: float = LADDER_BOUND

    shape: ClassVar = {**named("passed", "spring_residual", "ladder"), "bound": "ladder_bound"}

    @property
    def passed(self) -> bool:
        """Whether both are within their bounds."""
        return self.spring_residual <= self.spring_bound and self.ladder <= self.ladder_bound


def spring_residual(robot: Robot, block: Block) -> float:
    """Largest scaled residual of (14) on the regular steps, from the laws evaluated at phi.

    Scaled as |sum tau_k - tau_e| / sum |tau_k| and |sum sigma_k - sigma| / sigma. An elastic joint has one
    law; a rigid one has none, and so no residual.
    """
    errors = []
    for index, joint in enumerate(robot.joints):
        if not joint.actuator.sprung:
            continue
        regular = ~has(block.flags[:, index], Flag.INFEASIBLE | Flag.SINGULAR)
        of_joint = {name: values[..., regular] for name, values in block.of_joint(index).items()}
        tau_e, stiffness = of_joint["tau_e"], of_joint["stiffness"]
        carried = joint.actuator.carried(of_joint)
        size = np.maximum(carried.size, np.finfo(float).tiny)
        missing = np.abs(carried.tau_e - tau_e)
        if joint.damper_at("transmission"):  # whose torque may be zero where nothing else is small
            size = np.maximum(size, np.maximum(size, np.abs(tau_e)).max(initial=0.0))
            missing = np.abs(carried.tau_e + of_joint["tau_damper"] - tau_e)
            missing = np.maximum(missing - _rounding_of_damper(of_joint), 0.0)
        errors += [missing / size, np.abs(carried.stiffness - stiffness) / stiffness]
    return float(np.max(np.concatenate([np.zeros(1), *errors])))


def _rounding_of_damper(of_joint: Mapping[str, FloatArray]) -> FloatArray:
    """What rounding leaves of the torque of a damper, whose velocity is the difference theta' - q'."""
    rounding: FloatArray = 4 * np.finfo(float).eps * of_joint["damping"] * np.abs(of_joint["dq"])
    return rounding
