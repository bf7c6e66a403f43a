"""Summaries of a run, block by block, for the report: counts, first times, worst samples, peaks, drift."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vsacli.actuators.reach import margin, nearer_end
from vsacli.analysis.dry_friction import dry_frictions
from vsacli.analysis.joint_report import COUNTED, UNKNOWN, JointDrift, JointReport, JointUncertainty, Worst
from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.flags import SINGULAR_MARGIN, Flag, has
from vsacli.base.variables import MOTORS, VARIABLES, Block
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.inverse import Stop
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint

REACH = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR, "near_singular": Flag.NEAR_SINGULAR}
"""Kinds of trouble whose worst sample is the one with the smallest margin."""


class JointSummary:
    """Summary of one joint; `add` blocks in order, then call `report`."""

    def __init__(self, joint: Joint, index: int) -> None:
        self._joint = joint
        self._index = index
        self._steps = dict.fromkeys(COUNTED, 0)
        self._first_time: dict[str, float] = {}
        self._worst: dict[str, tuple[float, Worst]] = {}
        self._margin = (math.inf, math.nan, (math.nan, math.nan))
        self._stiffness = (math.nan, math.nan)
        self._peaks = np.full(5, np.nan)
        self._start: FloatArray | None = None
        self._end = np.full((2, len(MOTORS)), np.nan)
        self._limits = limit_checks(joint)
        self._other_branch = "stiffness" in joint.actuator.commanded
        self._dry_friction = dry_frictions(joint.actuator.motors)

    def add(self, block: Block) -> None:
        """Merge a block."""
        index = self._index
        flags = block.flags[:, index]
        stiffness = block.stiffness[:, index]

        if self._start is None:
            self._start = np.stack((*_motors_at(block, 0, index), self._torque_discontinuity(block)))
        self._end = np.stack(_motors_at(block, -1, index))
        if flags.any():
            self._count(flags, block.time)
            self._record_not_finite(flags, block.time)
            self._record_instability(flags, block)
        self.add_bounded(block)
        least, most = self._stiffness
        self._stiffness = (
            np.fmin(least, np.fmin.reduce(stiffness)),
            np.fmax(most, np.fmax.reduce(stiffness)),
        )
        rows = block.tau_e[:, index], *block.tau_motor[:, index].T, *block.dtheta[:, index].T
        for motor in self._dry_friction:
            motor.add(block.time, block.dtheta[:, index, motor.number - 1])
        self._peaks = np.fmax(self._peaks, [np.fmax.reduce(np.abs(row)) for row in rows])

    def add_bounded(self, block: Block) -> None:
        """Merge the worst values of samples, or of minima between them, without counting their flags."""
        flags = block.flags[:, self._index]
        flagged = bool(flags.any())
        if "stiffness" in self._joint.actuator.commanded:
            self._add_reach(flags, block, flagged=flagged)
        elif flagged:
            self._record_without_stiffness(flags, block.time)
        if flagged:
            self._record_limits(flags, block)

    def _add_reach(self, flags: FlagArray, block: Block, *, flagged: bool) -> None:
        """Merge margins and attainable range."""
        index = self._index
        stiffness = block.stiffness[:, index]
        corridor = block.stiffness_min[:, index], block.stiffness_max[:, index]
        # A sample whose torque cannot be carried at all is worse than any margin.
        gap = np.nan_to_num(margin(stiffness, *corridor), nan=-np.inf)
        self._record_margin(gap, block.time, corridor)
        if flagged:
            self._record_reach(flags, gap, block)
        outside = gap < -SINGULAR_MARGIN
        if self._other_branch and outside.any():
            demand = block.tau_e[outside, index], stiffness[outside], block.q[outside, index]
            self._other_branch = bool(self._joint.actuator.other_branch(*demand).all())

    def report(
        self,
        energy: JointEnergy,
        between: dict[str, Worst],
        uncertainty: JointUncertainty | None,
        *,
        complete: bool,
    ) -> JointReport:
        """Return the report of the joint; at least one block must have been added.

        Args:
            energy: Energy of the joint.
            between: Clearances that are lower between the samples than at them.
            uncertainty: Uncertainty of the joint; None if no signal was recorded.
            complete: Whether the last sample that was added is the last of the trajectory.
        """
        assert self._start is not None
        least, time, attainable = self._margin
        start_theta, start_dtheta, torque_discontinuity = map(_pair, self._start)
        end_theta, end_dtheta = map(_pair, self._end) if complete else (UNKNOWN, UNKNOWN)
        return JointReport(
            name=self._joint.name,
            type=self._joint.type,
            actuator=self._joint.actuator_type,
            samples=dict(self._steps),
            first_time=dict(self._first_time),
            worst={kind: worst for kind, (_, worst) in self._worst.items()},
            margin=least if math.isfinite(least) else math.nan,
            margin_time=time,
            attainable=attainable,
            commanded_min=float(self._stiffness[0]),
            commanded_max=float(self._stiffness[1]),
            peak_tau_e=float(self._peaks[0]),
            peak_tau_motor=_pair(self._peaks[1:3]),
            start_theta=start_theta,
            torque_discontinuity=torque_discontinuity,
            other_branch="infeasible" in self._worst and self._other_branch,
            energy=energy,
            between=between,
            start_dtheta=start_dtheta,
            end_theta=end_theta,
            end_dtheta=end_dtheta,
            peak_dtheta=_pair(self._peaks[3:]),
            uncertainty=uncertainty,
            dry_friction=tuple(motor.report() for motor in self._dry_friction),
        )

    def _count(self, flags: FlagArray, time: FloatArray) -> None:
        for kind, bits in COUNTED.items():
            hit = has(flags, bits)
            if hit.any():
                self._steps[kind] += int(hit.sum())
                self._first_time.setdefault(kind, float(time[hit.argmax()]))

    def _record_margin(
        self, gap: FloatArray, time: FloatArray, corridor: tuple[FloatArray, FloatArray]
    ) -> None:
        step = int(gap.argmin())
        if gap[step] < self._margin[0]:
            self._margin = (
                float(gap[step]),
                float(time[step]),
                (float(corridor[0][step]), float(corridor[1][step])),
            )

    def _record_reach(self, flags: FlagArray, gap: FloatArray, block: Block) -> None:
        """Record the worst sample of each kind; none where integrated deflections end inside the range."""
        outside = (gap < -SINGULAR_MARGIN) & ~has(flags, Flag.NOT_FINITE)
        for kind, bits in REACH.items():
            hit = has(flags, bits) & (outside if kind == "infeasible" else ~outside)
            for step in _worst_step(hit, -gap):
                value, lower, upper = (
                    float(getattr(block, name)[step, self._index])
                    for name in ("stiffness", "stiffness_min", "stiffness_max")
                )
                bound = nearer_end(value, lower, upper)
                unit = VARIABLES["stiffness"].quantity.unit(self._joint.type)
                self._keep(-gap[step], Worst(kind, float(block.time[step]), value, bound, unit))

    def _record_not_finite(self, flags: FlagArray, time: FloatArray) -> None:
        """Record the first sample: values that are not finite are equally bad."""
        hit, label = has(flags, Flag.NOT_FINITE), Flag.NOT_FINITE.label
        if hit.any() and label not in self._first_time:
            self._first_time[label] = first = float(time[hit.argmax()])
            unit = VARIABLES["tau_motor"].quantity.unit(self._joint.type)
            self._keep(0.0, Worst(label, first, math.nan, math.nan, unit))

    def _record_without_stiffness(self, flags: FlagArray, time: FloatArray) -> None:
        """Record the first singular sample of a spring without a commanded stiffness."""
        hit = has(flags, Flag.SINGULAR)
        if hit.any():
            unit = VARIABLES["stiffness"].quantity.unit(self._joint.type)
            self._keep(0.0, Worst("singular", float(time[hit.argmax()]), 0.0, math.nan, unit))

    def _record_instability(self, flags: FlagArray, block: Block) -> None:
        """Record the first sample: the instability grows from there on."""
        hit, label = has(flags, Flag.INTERNAL_INSTABILITY), Flag.INTERNAL_INSTABILITY.label
        if hit.any() and label not in self._first_time:
            step = int(hit.argmax())
            self._first_time[label] = first = float(block.time[step])
            unit, torque = (
                VARIABLES["tau_e"].quantity.unit(self._joint.type),
                block.tau_damper[step, self._index],
            )
            self._keep(0.0, Worst(label, first, float(torque), math.nan, unit))

    def _record_limits(self, flags: FlagArray, block: Block) -> None:
        values = block.of_joint(self._index)
        for check in self._limits:
            excess, label = check.worst(values, flags), check.flag.label
            if excess is not None:
                first, time = float(block.time[excess.first]), float(block.time[excess.step])
                self._first_time[label] = min(first, self._first_time.get(label, first))  # either motor
                unit = check.unit(self._joint.type)
                worst = Worst(label, time, excess.value, excess.bound, unit, check.motor)
                self._keep(excess.size, worst)

    def _torque_discontinuity(self, block: Block) -> FloatArray:
        """Return the initial torque discontinuity of motors with springs, whose torques are continuous."""
        if not self._joint.actuator.sprung:
            return np.full(len(MOTORS), np.nan)
        step: FloatArray = np.abs(block.tau_motor[0, self._index] - block.tau_transmission[0, self._index])
        return step

    def _keep(self, badness: float, worst: Worst) -> None:
        if worst.kind not in self._worst or badness > self._worst[worst.kind][0]:
            self._worst[worst.kind] = (badness, worst)


class DriftSummary:
    """Drift of a joint's integrated deflections from the root of (14); `add` blocks, then call `report`."""

    def __init__(self, joint: Joint, index: int, stop: Stop | None) -> None:
        self._joint = joint
        self._index = index
        self._stop = stop
        self._largest, self._time = math.nan, math.nan

    def add(self, block: Block) -> None:
        """Merge a block; samples without deflections are left out."""
        demand = block.tau_e[:, self._index], block.stiffness[:, self._index], block.q[:, self._index]
        root = self._joint.actuator.solve(*demand).deflections
        drift = np.fmax.reduce(np.abs(block.phi[:, self._index].T - root))
        integrated = np.flatnonzero(~np.isnan(drift))
        if integrated.size:
            step = integrated[drift[integrated].argmax()]
            if not drift[step] <= self._largest:
                self._largest, self._time = float(drift[step]), float(block.time[step])

    def report(self) -> JointDrift:
        """Return the drift so far."""
        unit = VARIABLES["phi"].quantity.unit(self._joint.type)
        return JointDrift(self._joint.name, self._largest, self._time, unit, self._stop)


def _motors_at(block: Block, step: int, joint: int) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity of the motors of a joint at a sample."""
    return block.theta[step, joint], block.dtheta[step, joint]


def _pair(values: FloatArray) -> tuple[float, float]:
    first, second = values.tolist()
    return first, second


def _worst_step(hit: BoolArray, badness: FloatArray) -> Iterator[int]:
    """Yield the sample with the largest badness among those hit, if there is one."""
    if hit.any():
        yield int(np.where(hit, badness, -np.inf).argmax())
