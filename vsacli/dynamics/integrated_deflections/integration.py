"""Integration of (19) for some joints, up to the first of them that cannot be integrated further."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.dynamics.integrated_deflections.task import REASONS, STALLED, Task
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.integrate import DOP853, DenseOutput, OdeSolution

MOST_PIECES = 500
"""Pieces into which a trajectory is divided at its breakpoints; recordings have more of them."""

ROUGH_TOLERANCE = 1e-6
"""Smallest tolerance of pieces with breakpoints inside. A tighter one would fight in vain the rounding of the
spline's third derivative, 1e-16 over the cube of the sample distance. Pieces are so short that the drift of
smooth recordings is far smaller."""

CHECKS = 64
"""Times at which each step is checked, and into which the search for the end of the way divides it."""


class Pieces(NamedTuple):
    """The pieces of a trajectory that are integrated one after the other.

    Attributes:
        ends: ascending, s.
        tolerance: relative error admitted in an integration step.
    """

    ends: FloatArray
    tolerance: float

    @classmethod
    def of(cls, trajectory: Trajectory, tolerance: float) -> Pieces:
        """Between all breakpoints if they are not too many, else between some of them."""
        ends = trajectory.breakpoints[1:]
        if len(ends) <= MOST_PIECES:
            return cls(ends, tolerance)
        chosen = np.linspace(0, len(ends) - 1, MOST_PIECES + 1).round().astype(np.intp)[1:]
        return cls(ends[chosen], max(tolerance, ROUGH_TOLERANCE))


class Integration:
    """The deflections of some joints from a start on.

    Args:
        task: what they are asked to do.
        joints: their indices.
        pieces: of the whole trajectory.
        start: time of the deflections, s.
        phi: deflections, (joints, 2).

    Attributes:
        joints: as given.
        times: ends of the steps.
        stopped: why each joint that ended the integration cannot be integrated beyond the last of `times`.
    """

    def __init__(
        self, task: Task, joints: tuple[int, ...], pieces: Pieces, start: float, phi: FloatArray
    ) -> None:
        self.joints = joints
        self.times = [start]
        self.stopped: dict[int, str] = {}
        self._task = task
        self._steps: list[DenseOutput] = []
        self._tolerance = pieces.tolerance
        self._smallest = float(np.abs(phi).max(axis=1).min())
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # in steps that are refused
            self._run(pieces.ends[pieces.ends > start].tolist(), phi.ravel())

    def solution(self) -> OdeSolution:
        """The deflections as a function of time, (2 joints, samples)."""
        from scipy.integrate import OdeSolution

        return OdeSolution(self.times, self._steps)

    def _rates(self, time: float, state: Any) -> Any:
        return self._task.rates(self.joints, np.array([time]), by_joint(state[:, None])).ravel()

    def _run(self, ends: list[float], state: FloatArray) -> None:
        from scipy.integrate import DOP853

        for end in ends:
            start = self.times[-1]
            integrator = DOP853(
                self._rates,
                start,
                state,
                end,
                first_step=end - start
                if len(ends) > 1
                else None,  # pieces are short, a whole trajectory is not
                rtol=self._tolerance,
                atol=self._tolerance * self._smallest,
            )
            self._go_through(integrator)
            if self.stopped:
                return
            state = integrator.y

    def _go_through(self, integrator: DOP853[np.float64]) -> None:
        while integrator.status == "running" and not self.stopped:
            if integrator.step() is not None:
                self.stopped = {self._fastest(integrator): REASONS[STALLED]}
            else:
                step = integrator.dense_output()
                self._steps.append(step)
                self.times.append(self._end_of(step, self.times[-1], float(integrator.t)))

    def _end_of(self, step: DenseOutput, left: float, right: float) -> float:
        """The end of a step, or the first time in it, to rounding, at which a joint cannot be integrated."""
        while right - left > 4 * np.spacing(abs(right)):
            nodes = np.linspace(left, right, CHECKS + 1)
            hindrances = self._task.hindrances(self.joints, nodes[1:], by_joint(step(nodes[1:])))
            hits = np.flatnonzero(hindrances.any(axis=0))
            if not hits.size:
                break
            left, right = float(nodes[hits[0]]), float(nodes[hits[0] + 1])
            found = zip(self.joints, hindrances[:, hits[0]].tolist(), strict=True)
            self.stopped = {joint: REASONS[reason] for joint, reason in found if reason}
        return right

    def _fastest(self, integrator: DOP853[np.float64]) -> int:
        """The joint whose deflections change fastest for their size: the one that makes the steps short."""
        phi = integrator.y
        speed = np.abs(self._rates(float(integrator.t), phi)) / np.abs(phi)
        return self.joints[int(np.nan_to_num(speed, nan=np.inf).argmax()) // 2]


def by_joint(state: FloatArray) -> FloatArray:
    """The integrator's state (2 joints, samples) as (joints, 2, samples)."""
    return state.reshape(-1, 2, state.shape[1])
