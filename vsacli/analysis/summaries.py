"""Summaries of a run, block by block, for the report: counts, first times, worst samples, peaks, drift."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.reach import margin, nearer_end
from vsacli.analysis.dry_friction import dry_frictions
from vsacli.analysis.joint_report import COUNTED, UNKNOWN, JointDrift, JointReport, JointUncertainty
from vsacli.base.arrays import FlagArray, FloatArray
from vsacli.base.flags import SINGULAR_MARGIN, Flag, has_flag
from vsacli.base.variables import MOTORS, VARIABLES, Block
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.inverse import DeflectionStop
from vsacli.dynamics.limits import Finding, limit_checks, worst_excess
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
        self._worst: dict[str, tuple[float, Finding]] = {}
        self._margin = (math.inf, math.nan, (math.nan, math.nan))
        self._stiffness = (math.nan, math.nan)
        self._peaks = np.full(5, np.nan)
        self._start: FloatArray | None = None
        self._end = np.full((2, len(MOTORS)), np.nan)
        self._limits = limit_checks(joint)
        self._between_samples = False
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
            damper = math.nan if block.tau_damper is None else block.tau_damper[:, index]
            self._record_first(Flag.NOT_FINITE, flags, block.time, math.nan, "tau_motor")
            self._record_first(Flag.INTERNAL_INSTABILITY, flags, block.time, damper, "tau_e")
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

    def add_bounded(self, block: Block, *, between: bool = False) -> None:
        """Merge the worst values of samples, or of minima between them, without counting their flags."""
        self._between_samples = between
        flags = block.flags[:, self._index]
        flagged = bool(flags.any())
        if "stiffness" in self._joint.actuator.commanded:
            self._add_reach(flags, block, flagged=flagged)
        elif flagged:
            self._record_first(Flag.SINGULAR, flags, block.time, 0.0, "stiffness")
        if flagged:
            self._record_limits(flags, block)

    def _add_reach(self, flags: FlagArray, block: Block, *, flagged: bool) -> None:
        """Merge margins and attainable range."""
        index = self._index
        stiffness = block.stiffness[:, index]
        corridor = block.stiffness_min[:, index], block.stiffness_max[:, index]
        # A sample whose torque cannot be carried at all is worse than any margin.
        gap = np.nan_to_num(margin(stiffness, *corridor), copy=False, nan=-np.inf)
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
        between: dict[str, Finding],
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
        start_theta, start_dtheta, torque_discontinuity = map(_motor_pair, self._start)
        end_theta, end_dtheta = map(_motor_pair, self._end) if complete else (UNKNOWN, UNKNOWN)
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
            peak_tau_motor=_motor_pair(self._peaks[1:3]),
            start_theta=start_theta,
            torque_discontinuity=torque_discontinuity,
            other_branch="infeasible" in self._worst and self._other_branch,
            energy=energy,
            between=between,
            start_dtheta=start_dtheta,
            end_theta=end_theta,
            end_dtheta=end_dtheta,
            peak_dtheta=_motor_pair(self._peaks[3:]),
            uncertainty=uncertainty,
            dry_friction=tuple(motor.report() for motor in self._dry_friction),
        )

    def _count(self, flags: FlagArray, time: FloatArray) -> None:
        for kind, bits in COUNTED.items():
            hit = has_flag(flags, bits)
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
        outside = (gap < -SINGULAR_MARGIN) & ~has_flag(flags, Flag.NOT_FINITE)
        for kind, bits in REACH.items():
            hit = has_flag(flags, bits) & (outside if kind == "infeasible" else ~outside)
            if hit.any():
                step = int(np.where(hit, -gap, -np.inf).argmax())
                value, lower, upper = (
                    float(getattr(block, name)[step, self._index])
                    for name in ("stiffness", "stiffness_min", "stiffness_max")
                )
                bound = nearer_end(value, lower, upper)
                self._keep(-gap[step], self._finding(kind, block.time[step], value, bound))

    def _record_first(
        self, flag: Flag, flags: FlagArray, time: FloatArray, values: FloatArray | float, of: str
    ) -> None:
        """Record the first sample with a flag: later ones are as bad, or follow from it."""
        hit, kind = has_flag(flags, flag), flag.label
        if hit.any() and kind not in self._worst:
            step = int(hit.argmax())
            self._first_time.setdefault(kind, float(time[step]))
            value = float(np.broadcast_to(values, time.shape)[step])
            self._keep(0.0, self._finding(kind, time[step], value, math.nan, of))

    def _record_limits(self, flags: FlagArray, block: Block) -> None:
        values = block.of_joint(self._index)
        for check in self._limits:
            # The flag of a sample may be the other motor's.
            exceeded = flags & check.flags(values, check.allowance(values))
            beyond, between = has_flag(exceeded, check.flag), self._between_samples
            worst = worst_excess(self._joint, check, values, block.time, beyond, between=between)
            if worst is not None:
                first = self._first_time.get(worst.kind, worst.first)
                self._first_time[worst.kind] = min(worst.first, first)
                self._keep(worst.excess, worst)

    def _finding(self, kind: str, time: float, value: float, bound: float, of: str = "stiffness") -> Finding:
        unit = VARIABLES[of].quantity.unit(self._joint.type)
        name, between = self._joint.name, self._between_samples
        return Finding(kind, float(time), value, bound, unit, joint=name, between=between)

    def _torque_discontinuity(self, block: Block) -> FloatArray:
        """Return the initial torque discontinuity of motors with springs, whose torques are continuous."""
        if not self._joint.actuator.sprung:
            return np.full(len(MOTORS), np.nan)
        step: FloatArray = np.abs(block.tau_motor[0, self._index] - block.tau_transmission[0, self._index])
        return step

    def _keep(self, badness: float, worst: Finding) -> None:
        if worst.kind not in self._worst or badness > self._worst[worst.kind][0]:
            self._worst[worst.kind] = (badness, worst)


class DriftSummary:
    """Drift of a joint's integrated deflections from the root of (14); `add` blocks, then call `report`."""

    def __init__(self, joint: Joint, index: int, stop: DeflectionStop | None) -> None:
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


def _motor_pair(values: FloatArray) -> tuple[float, float]:
    first, second = values.tolist()
    return first, second
