"""The check every run makes of itself: do the numbers satisfy what they were computed from?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.arrays import BoolArray, FloatArray
from vsacli.feasibility import has
from vsacli.flags import Flag
from vsacli.robot import Robot
from vsacli.steps import compute_block
from vsacli.trajectory import Trajectory
from vsacli.variables import Block

SPRING_BOUND = 1e-11
"""Bound on the scaled residual of (14); solutions reach 1e-15, and 1e-12 is asked of them."""

LADDER_BOUND = 1e-8
"""Bound on derivative errors relative to their peak: a hundred times what rounding leaves, a millionth of 1 %."""

RUNGS = (("tau_e", "dtau_e"), ("dtau_e", "ddtau_e"), ("theta", "dtheta"), ("dtheta", "ddtheta"))
"""Pairs of a variable and its derivative."""

PROBES = 200
"""About how many times are probed."""

STEP_SCALES = np.array([1.0, 1 / 6, 1 / 36])
"""Difference steps tried at each time; the best counts, since a wrong derivative is wrong at every step."""

WEIGHTS = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60
"""Central first difference of sixth order over the offsets -3..3."""

SMALL_JOINT = 1e-3
"""Share of the largest joint's peak against which smaller joints are measured: what is below may be nothing
but rounding of the larger torques."""


@dataclass(frozen=True)
class SelfCheck:
    """Outcome of the self-check.

    Attributes:
        spring_residual: largest scaled residual of (14).
        ladder: largest relative error of a derivative against differences of what it derives.
    """

    spring_residual: float
    ladder: float

    @property
    def passed(self) -> bool:
        """Whether both are within their bounds."""
        return self.spring_residual <= SPRING_BOUND and self.ladder <= LADDER_BOUND


def spring_residual(robot: Robot, block: Block) -> float:
    """Largest scaled residual of (14) on the regular steps, from the laws evaluated at phi.

    Scaled as |sum tau_k - tau_e| / sum |tau_k| and |sum sigma_k - sigma| / sigma.
    """
    worst = 0.0
    for index, joint in enumerate(robot.joints):
        regular = ~has(block.flags[:, index], Flag.INFEASIBLE | Flag.SINGULAR)
        phi, tau_e = block.phi[regular, index], block.tau_e[regular, index]
        stiffness = block.stiffness[regular, index]
        tau = np.stack([law.torque(phi[:, side]) for side, law in enumerate(joint.actuator.spring)])
        sigma = np.stack([law.stiffness(phi[:, side]) for side, law in enumerate(joint.actuator.spring)])
        torque_error = np.abs(tau.sum(axis=0) - tau_e)
        size = np.maximum(np.abs(tau).sum(axis=0), np.finfo(float).tiny)
        worst = max(
            worst,
            np.max(torque_error / size, initial=0.0),
            np.max(np.abs(sigma.sum(axis=0) - stiffness) / stiffness, initial=0.0),
        )
    return float(worst)


def ladder(robot: Robot, trajectory: Trajectory) -> float:
    """Largest error of dtau_e, ddtau_e, dtheta, ddtheta against first differences, relative to their peaks.

    Differences are taken at about 200 times with steps of their own, over which the trajectory is analytic.
    Motor motion is compared where no step of the difference is infeasible, singular or near-singular.
    """
    times, reach = trajectory.check_points(PROBES)
    steps = STEP_SCALES[:, None] * np.minimum(reach / 3, trajectory.duration / 500)
    grid = times + steps[:, None, :] * np.arange(-3, 4)[None, :, None]
    block = compute_block(robot, trajectory.at(grid.ravel()))
    troubled = has(block.flags, Flag.INFEASIBLE | Flag.SINGULAR | Flag.NEAR_SINGULAR)
    regular: BoolArray = ~np.any(troubled.reshape(*grid.shape, -1), axis=1)
    return max(
        _rung_error(
            getattr(block, value).reshape(*grid.shape, len(robot.joints), -1),
            getattr(block, derivative).reshape(*grid.shape, len(robot.joints), -1),
            steps,
            regular if value.endswith("theta") else np.ones_like(regular),
            trajectory.duration,
        )
        for value, derivative in RUNGS
    )


def _rung_error(
    values: FloatArray, derivatives: FloatArray, steps: FloatArray, compared: BoolArray, duration: float
) -> float:
    """Error of a derivative; arrays (scales, offsets, times, joints, motors), `compared` without the 2nd and last."""
    difference = np.einsum("o,sotjm->stjm", WEIGHTS, values) / steps[:, :, None, None]
    error = np.where(compared[..., None], np.abs(difference - derivatives[:, 3]), np.inf).min(axis=0)
    valid: BoolArray = np.any(compared, axis=0)
    peak = np.maximum(_peak(derivatives[0, 3], valid), _peak(values[0, 3], valid) / duration)
    scale = np.maximum(peak, SMALL_JOINT * peak.max())
    error = np.where(valid[..., None], error, 0.0)
    return float(np.max(np.divide(error, scale, out=np.zeros_like(error), where=scale > 0)))


def _peak(values: FloatArray, valid: BoolArray) -> FloatArray:
    peak: FloatArray = np.max(np.abs(values), axis=0, where=valid[..., None], initial=0.0)
    return peak
