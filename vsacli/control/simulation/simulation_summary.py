"""The summary of a simulation, accumulated block by block: findings of each joint, flags, final stiffness."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import AnyArray, FloatArray, by_joint, of_joint
from vsacli.base.flags import LIMITS, has_flag
from vsacli.base.simulation_variables import COMMANDS
from vsacli.base.units import STIFFNESS
from vsacli.control.simulation.history import History
from vsacli.control.simulation.joint_tracking import Deviation, GoalTolerance, JointTracking
from vsacli.dynamics.energy import EnergyMeter, Flow, JointEnergy, efforts
from vsacli.dynamics.limits import Finding, keep_worse, limit_checks, worst_excess
from vsacli.dynamics.losses import positive_part, trapezoidal_integrals
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

STIFFNESS_SHARE = 0.01
"""Error of the stiffness at the end without a warning, as a share of the largest commanded stiffness."""

FINAL_SHARE = 0.1
"""Share of a run at its end in which the position should stay within the goal tolerance."""

SELDOM_SHARE = 0.1
"""Share of the samples in this part above which errors beyond the tolerance are a warning: the last error
of an oscillation may be small by chance."""


class Summary:
    """The summary of a run: `add` its blocks in order, then read it. It does not depend on the division.

    Args:
        robot: robot of the run.
        goal: largest position error of the joints at the end of the run.
        span: times of the first and last sample of the trajectory, s.

    Attributes:
        samples: number of samples so far.
        flags: flags of any joint at any sample.
    """

    def __init__(self, robot: Robot, goal: GoalTolerance, span: tuple[float, float]) -> None:
        self._robot, self._goal = robot, goal
        self._final_start = span[1] - FINAL_SHARE * (span[1] - span[0])
        self._final_errors: list[FloatArray] = []
        self.samples = self.flags = 0
        self._joints = [_JointTrackingSummary(joint, index) for index, joint in enumerate(robot.joints)]
        self._energy = _EnergySummary()
        self._max_stiffness: FloatArray = np.full(len(robot.joints), -np.inf)
        self._final_stiffness: tuple[FloatArray, FloatArray] = self._max_stiffness, self._max_stiffness

    def add(self, block: History) -> None:
        """Add the next block."""
        self.samples += len(block.time)
        self.flags |= int(np.bitwise_or.reduce(block.flags, axis=None))
        for joint in self._joints:
            joint.add(block)
        self._energy.add(block)
        self._max_stiffness = np.maximum(self._max_stiffness, block.stiffness_ref.max(axis=0))
        self._final_stiffness = block.stiffness_error[-1].copy(), block.stiffness_ref[-1].copy()
        self._final_errors.append(np.abs(block.q_error[block.time >= self._final_start]))

    def joints(self) -> tuple[JointTracking, ...]:
        """Return the findings of each joint; at least one block must have been added."""
        energies = self._energy.report(self._robot)
        return tuple(map(_JointTrackingSummary.report, self._joints, energies, [self._goal] * len(energies)))

    def unsettled_warnings(self, joints: Sequence[JointTracking]) -> Iterator[str]:
        """Yield a warning for each joint that ends on target but was often off it shortly before."""
        errors = np.concatenate(self._final_errors)
        for index, joint in enumerate(joints):
            share_beyond = float(np.mean(errors[:, index] > joint.tolerance))
            if share_beyond > SELDOM_SHARE and not joint.off_course:
                yield (
                    f"{joint.name}: q error exceeds the goal tolerance of {joint.tolerance:.3g} "
                    f"{joint.unit} in {100 * share_beyond:.0f} % of the last tenth, though not at the end"
                )

    def stiffness_warnings(self) -> Iterator[str]:
        """Yield a warning for each joint whose stiffness at the end differs from the command."""
        errors, commanded = self._final_stiffness
        is_off = (
            np.abs(errors) > STIFFNESS_SHARE * self._max_stiffness
        )  # False for rigid joints, whose error is NaN
        for index in np.flatnonzero(is_off):
            joint = self._robot.joints[index]
            unit = STIFFNESS.unit(joint.type)
            yield (
                f"{joint.name}: final stiffness error {errors[index]:.3g} {unit} "
                f"(commanded: {commanded[index]:.4g} {unit})"
            )


class _JointTrackingSummary:
    """Findings of one joint, accumulated."""

    def __init__(self, joint: Joint, index: int) -> None:
        self._joint, self._index = joint, index
        self._checks = [check for check in limit_checks(joint) if check.flag in LIMITS]
        self._worst: dict[str, Finding] = {}
        self._q = self._stiffness = Deviation(math.nan, math.nan, math.nan)
        self._peaks: FloatArray = np.full(2, np.nan)
        self._q_min, self._q_max = math.inf, -math.inf
        self._samples_over_limit = 0

    def add(self, block: History) -> None:
        """Add the next block."""
        index, time, flags = self._index, block.time, block.flags[:, self._index]
        self._q = Deviation.of(time, block.q_error[:, index]).after(self._q)
        self._stiffness = Deviation.of(time, block.stiffness_error[:, index]).after(self._stiffness)
        self._peaks = np.fmax(self._peaks, np.fmax.reduce(np.abs(block.tau_motor[:, index]), axis=0))
        self._q_min = min(self._q_min, float(block.q_ref[:, index].min()))
        self._q_max = max(self._q_max, float(block.q_ref[:, index].max()))
        self._samples_over_limit += int(np.count_nonzero(has_flag(flags, LIMITS)))
        names = {check.variable: _limited_variable(check.variable) for check in self._checks}
        values = of_joint({variable: getattr(block, name) for variable, name in names.items()}, index)
        for check in self._checks:
            keep_worse(
                self._worst, worst_excess(self._joint, check, values, time, has_flag(flags, check.flag))
            )

    def report(self, energy: JointEnergy, goal: GoalTolerance) -> JointTracking:
        """Return the findings, with the energy of the joint."""
        first, second = self._peaks.tolist()
        return JointTracking(
            name=self._joint.name,
            type=self._joint.type,
            q=self._q,
            stiffness=self._stiffness,
            peak_tau_motor=(first, second),
            samples_over_limit=self._samples_over_limit,
            worst=dict(self._worst),
            energy=energy,
            tolerance=goal.of(self._q_max - self._q_min),
        )


def _limited_variable(variable: str) -> str:
    """Return the variable that a limit bounds: the commanded torque, else the simulated value."""
    return COMMANDS[variable] if variable == "tau_motor" else variable


class _EnergySummary:
    """Energy of each joint, accumulated."""

    def __init__(self) -> None:
        self._meter = EnergyMeter()
        self._previous_samples: dict[str, AnyArray] = {}

    def add(self, block: History) -> None:
        """Add the next block."""
        time, work, power, tau_transmission, elastic_energy = (
            self._with_previous_sample(block, name)
            for name in ("time", "motor_energy", "motor_power", "tau_transmission", "elastic_energy")
        )
        intervals, interval_work = np.diff(time), np.diff(work)
        losses = [
            None
            if getattr(block, name) is None
            else trapezoidal_integrals(intervals, self._with_previous_sample(block, name))
            for name in ("dissipated_power", "copper_loss")
        ]
        torques = np.moveaxis(tau_transmission, 1, 0)
        squared_efforts = efforts(intervals, torques[..., :-1], torques[..., 1:])
        self._meter.add_stored(elastic_energy)
        self._meter.add(
            Flow(
                intervals,
                interval_work,
                positive_part(intervals, power, interval_work),
                *squared_efforts,
                *losses,
            )
        )

    def report(self, robot: Robot) -> list[JointEnergy]:
        """Return the energy of each joint."""
        return self._meter.report(robot)

    def _with_previous_sample(self, block: History, name: str) -> FloatArray:
        """Return (..., samples + 1) from (samples, ...), led by the last sample of the block before.

        The first block is led by its own first sample, which may be its only one.
        """
        rows = by_joint(getattr(block, name))
        extended = np.concatenate((self._previous_samples.get(name, rows[..., :1]), rows), axis=-1)
        self._previous_samples[name] = extended[..., -1:].copy()
        return extended
