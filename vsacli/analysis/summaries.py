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
        self._sample_counts = dict.fromkeys(COUNTED, 0)
        self._first_time: dict[str, float] = {}
        self._worst: dict[str, tuple[float, Finding]] = {}
        self._margin = (math.inf, math.nan, (math.nan, math.nan))
        self._stiffness = (math.nan, math.nan)
        self._peaks = np.full(5, np.nan)
        self._start_values: FloatArray | None = None
        self._end_values = np.full((2, len(MOTORS)), np.nan)
        self._limit_checks = limit_checks(joint)
        self._between_samples = False
        self._other_branch = "stiffness" in joint.actuator.commanded
        self._dry_friction = dry_frictions(joint.actuator.motors)

    def add(self, block: Block) -> None:
        """Merge a block."""
        index = self._index
        flags = block.flags[:, index]
        stiffness = block.stiffness[:, index]

        if self._start_values is None:
            self._start_values = np.stack((*_motors_at(block, 0, index), self._torque_discontinuity(block)))
        self._end_values = np.stack(_motors_at(block, -1, index))
        if flags.any():
            self._count(flags, block.time)
            damper = math.nan if block.tau_damper is None else block.tau_damper[:, index]
            self._record_first(Flag.NOT_FINITE, flags, block.time, math.nan, "tau_motor")
            self._record_first(Flag.INTERNAL_INSTABILITY, flags, block.time, damper, "tau_e")
        self.add_bounded(block)
        min_stiffness, max_stiffness = self._stiffness
        self._stiffness = (
            np.fmin(min_stiffness, np.fmin.reduce(stiffness)),
            np.fmax(max_stiffness, np.fmax.reduce(stiffness)),
        )
        magnitudes = block.tau_e[:, index], *block.tau_motor[:, index].T, *block.dtheta[:, index].T
        for motor in self._dry_friction:
            motor.add(block.time, block.dtheta[:, index, motor.number - 1])
        self._peaks = np.fmax(self._peaks, [np.fmax.reduce(np.abs(magnitude)) for magnitude in magnitudes])

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
        attainable = block.stiffness_min[:, index], block.stiffness_max[:, index]
        # A sample whose torque cannot be carried at all is worse than any margin.
        margins = np.nan_to_num(margin(stiffness, *attainable), copy=False, nan=-np.inf)
        self._record_margin(margins, block.time, attainable)
        if flagged:
            self._record_reach(flags, margins, block)
        outside = margins < -SINGULAR_MARGIN
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
        assert self._start_values is not None
        min_margin, time, attainable = self._margin
        start_theta, start_dtheta, torque_discontinuity = map(_motor_pair, self._start_values)
        end_theta, end_dtheta = map(_motor_pair, self._end_values) if complete else (UNKNOWN, UNKNOWN)
        return JointReport(
            name=self._joint.name,
            type=self._joint.type,
            actuator=self._joint.actuator_type,
            samples=dict(self._sample_counts),
            first_time=dict(self._first_time),
            worst={kind: worst for kind, (_, worst) in self._worst.items()},
            margin=min_margin if math.isfinite(min_margin) else math.nan,
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
            is_flagged = has_flag(flags, bits)
            if is_flagged.any():
                self._sample_counts[kind] += int(is_flagged.sum())
                self._first_time.setdefault(kind, float(time[is_flagged.argmax()]))

    def _record_margin(
        self, margins: FloatArray, time: FloatArray, attainable: tuple[FloatArray, FloatArray]
    ) -> None:
        sample = int(margins.argmin())
        if margins[sample] < self._margin[0]:
            self._margin = (
                float(margins[sample]),
                float(time[sample]),
                (float(attainable[0][sample]), float(attainable[1][sample])),
            )

    def _record_reach(self, flags: FlagArray, margins: FloatArray, block: Block) -> None:
        """Record the worst sample of each kind; none where integrated deflections end inside the range."""
        outside = (margins < -SINGULAR_MARGIN) & ~has_flag(flags, Flag.NOT_FINITE)
        for kind, bits in REACH.items():
            is_flagged = has_flag(flags, bits) & (outside if kind == "infeasible" else ~outside)
            if is_flagged.any():
                sample = int(np.where(is_flagged, -margins, -np.inf).argmax())
                value, lower, upper = (
                    float(getattr(block, name)[sample, self._index])
                    for name in ("stiffness", "stiffness_min", "stiffness_max")
                )
                bound = nearer_end(value, lower, upper)
                self._keep_worse(-margins[sample], self._finding(kind, block.time[sample], value, bound))

    def _record_first(
        self, flag: Flag, flags: FlagArray, time: FloatArray, values: FloatArray | float, variable: str
    ) -> None:
        """Record the first sample with a flag: later ones are as bad, or follow from it."""
        is_flagged, kind = has_flag(flags, flag), flag.label
        if is_flagged.any() and kind not in self._worst:
            sample = int(is_flagged.argmax())
            self._first_time.setdefault(kind, float(time[sample]))
            value = float(np.broadcast_to(values, time.shape)[sample])
            self._keep_worse(0.0, self._finding(kind, time[sample], value, math.nan, variable))

    def _record_limits(self, flags: FlagArray, block: Block) -> None:
        values = block.of_joint(self._index)
        for limit in self._limit_checks:
            # The flag of a sample may be the other motor's.
            exceeded = flags & limit.flags(values, limit.allowance(values))
            is_beyond, between = has_flag(exceeded, limit.flag), self._between_samples
            worst = worst_excess(self._joint, limit, values, block.time, is_beyond, between=between)
            if worst is not None:
                first_time = self._first_time.get(worst.kind, worst.first)
                self._first_time[worst.kind] = min(worst.first, first_time)
                self._keep_worse(worst.excess, worst)

    def _finding(
        self, kind: str, time: float, value: float, bound: float, variable: str = "stiffness"
    ) -> Finding:
        unit = VARIABLES[variable].quantity.unit(self._joint.type)
        name, between = self._joint.name, self._between_samples
        return Finding(kind, float(time), value, bound, unit, joint=name, between=between)

    def _torque_discontinuity(self, block: Block) -> FloatArray:
        """Return the initial torque discontinuity of motors with springs, whose torques are continuous."""
        if not self._joint.actuator.sprung:
            return np.full(len(MOTORS), np.nan)
        jump: FloatArray = np.abs(block.tau_motor[0, self._index] - block.tau_transmission[0, self._index])
        return jump

    def _keep_worse(self, excess: float, worst: Finding) -> None:
        if worst.kind not in self._worst or excess > self._worst[worst.kind][0]:
            self._worst[worst.kind] = (excess, worst)


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
        root_deflections = self._joint.actuator.solve(*demand).deflections
        drift = np.fmax.reduce(np.abs(block.phi[:, self._index].T - root_deflections))
        integrated = np.flatnonzero(~np.isnan(drift))
        if integrated.size:
            sample = integrated[drift[integrated].argmax()]
            if not drift[sample] <= self._largest:
                self._largest, self._time = float(drift[sample]), float(block.time[sample])

    def report(self) -> JointDrift:
        """Return the drift so far."""
        unit = VARIABLES["phi"].quantity.unit(self._joint.type)
        return JointDrift(self._joint.name, self._largest, self._time, unit, self._stop)


def _motors_at(block: Block, sample: int, joint: int) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity of the motors of a joint at a sample."""
    return block.theta[sample, joint], block.dtheta[sample, joint]


def _motor_pair(values: FloatArray) -> tuple[float, float]:
    first, second = values.tolist()
    return first, second
