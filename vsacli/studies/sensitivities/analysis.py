"""Sensitivity of a whole run: effects of small parameter changes, their ranking, the effect of tolerances.

`Effects` accumulates the derivatives of `slopes` block by block; `band` and `tolerances` add the uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.analysis.tool_report import unjudged_tools_text
from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.base.flags import LIMITS, Flag, has_flag
from vsacli.base.units import TORQUE
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.studies.sensitivities.band import Band, share_of_peak
from vsacli.studies.sensitivities.joint_derivatives import MARGIN
from vsacli.studies.sensitivities.sensitivity_report import JointEffect, ParameterEffect, Sensitivity
from vsacli.studies.sensitivities.slopes import Derivatives, SensitivityRun
from vsacli.studies.sensitivities.tolerances import (
    monte_carlo,
    step_of,
    tolerance_deviations,
    tolerances_of,
    words_of,
)
from vsacli.trajectory.trajectory import Trajectory


class Smallest(NamedTuple):
    """The smallest margin of each joint, and its derivatives.

    Attributes:
        value: smallest margin so far, (joints,); infinite if there is none.
        time: time of the smallest margin, (joints,) in s.
        slopes: derivatives of the smallest margin, (parameters, joints).
    """

    value: FloatArray
    time: FloatArray
    slopes: FloatArray


class Effects:
    """Effects of parameter changes, accumulated over a run; `add` its blocks in order.

    Infeasible and singular samples, at which a value or its derivative does not exist, do not count.

    Attributes:
        peak: largest |tau_motor| of each joint, (joints,).
        largest: largest |change of tau_motor| of each joint by each parameter's change, (parameters, joints).
        time, motor: time in s and motor, 1 or 2, of the largest change, (parameters, joints).
        smallest: smallest margins.
        spent: change of the positive motor work by each parameter's change, (parameters, joints), J.
        failed: number of infeasible or singular samples, counted for each joint.
        left_out: number of samples at which any joint is infeasible or singular.
    """

    def __init__(self, steps: FloatArray, times: FloatArray, joints: int) -> None:
        """Start with no samples.

        Args:
            steps: change of each parameter.
            times: times of all samples of the run, s.
            joints: number of joints.
        """
        shape = (len(steps), joints)
        self._steps = steps
        self._weights = trapezoidal_weights(times)
        self._sample_count = 0
        self.peak = np.zeros(joints)
        self.largest, self.time, self.spent = np.zeros((3, *shape))
        self.motor = np.ones(shape, dtype=int)
        self.smallest = Smallest(np.full(joints, np.inf), np.zeros(joints), np.zeros(shape))
        self.failed = self.left_out = 0
        self._flags = np.zeros(1, dtype=FLAG_TYPE)

    def add(self, part: Derivatives) -> None:
        """Include the next block."""
        block = part.block
        self._flags |= np.bitwise_or.reduce(block.flags, axis=None)
        failed = has_flag(block.flags, Flag.INFEASIBLE | Flag.SINGULAR)
        self.failed += int(np.count_nonzero(failed))
        self.left_out += int(np.count_nonzero(failed.any(axis=1)))
        self.peak = np.fmax(self.peak, np.fmax.reduce(np.abs(block.tau_motor), axis=(0, 2)))
        weights = self._weights[self._sample_count : self._sample_count + len(part.time), None, None]
        work_weights = weights * (block.motor_power > 0)  # negative work is not subtracted
        margins = np.where(np.isfinite(part.margin), part.margin, np.inf)
        worst_samples, joints = margins.argmin(axis=0), np.arange(margins.shape[1])
        is_smaller = margins[worst_samples, joints] < self.smallest.value
        self.smallest.slopes[:, is_smaller] = 0.0
        for group in part.groups:
            for joint, slopes in enumerate(group.of_joints):
                if slopes is None or not group.places:
                    continue
                self._add_torque(part.time, slopes["tau_motor"], group.places, joint)
                energy = slopes.total("motor_power", work_weights[:, joint].T)
                self.spent[group.places, joint] += energy * self._steps[group.places]
                if is_smaller[joint]:
                    self.smallest.slopes[group.places, joint] = slopes[MARGIN][:, worst_samples[joint]]
        self.smallest = self.smallest._replace(
            value=np.where(is_smaller, margins[worst_samples, joints], self.smallest.value),
            time=np.where(is_smaller, part.time[worst_samples], self.smallest.time),
        )
        self._sample_count += len(part.time)

    @property
    def verdict(self) -> str:
        """Verdict on the run with unchanged parameters."""
        bits_by_verdict = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR, "over_limit": LIMITS}
        return next(
            (verdict for verdict, bits in bits_by_verdict.items() if has_flag(self._flags, bits).any()), "ok"
        )

    def _add_torque(
        self, time: FloatArray, slopes: FloatArray, parameter_indices: Sequence[int], joint: int
    ) -> None:
        changes = np.abs(slopes).reshape(len(parameter_indices), -1)
        np.copyto(changes, 0.0, where=np.isnan(changes))
        worst_indices = changes.argmax(axis=1)
        largest_changes = (
            changes[np.arange(len(parameter_indices)), worst_indices] * self._steps[parameter_indices]
        )
        is_larger = largest_changes > self.largest[parameter_indices, joint]
        index_array = np.asarray(parameter_indices)[is_larger]
        self.largest[index_array, joint] = largest_changes[is_larger]
        self.time[index_array, joint] = time[worst_indices[is_larger] % len(time)]
        self.motor[index_array, joint] = 1 + worst_indices[is_larger] // len(time)


def sensitivity(
    robot: Robot,
    trajectory: Trajectory,
    parameters: Sequence[str] = (),
    tolerances: str | None = None,
    *,
    runs: int = 0,
    seed: int = 0,
) -> Sensitivity:
    """Return the sensitivity of motor torques, margins and energy to each parameter of a robot.

    Derivatives are exact to rounding: dual numbers differentiate the recursion, the implicit function theorem
    the deflections. The effect of a change is its size times the derivative.

    Args:
        robot: robot that executes the motion.
        trajectory: trajectory for this robot.
        parameters: patterns of parameter paths, e.g. `joints.*.link.mass`; all parameters if empty.
        tolerances: uncertainty of the parameters: a share such as `5%`, or the path of a YAML file with a
            distribution for paths, such as `joints.*.link.mass: {normal: 2 %}`.
        runs: number of robots to draw from the tolerances and run (Monte Carlo).
        seed: seed of these draws.

    Raises:
        InputError: the trajectory does not fit the robot, a pattern matches no parameter, or a tolerance is
            invalid.
    """
    return analyzed(SensitivityRun(robot, trajectory, parameters), tolerances, runs=runs, seed=seed)


def analyzed(
    run: SensitivityRun,
    tolerances: str | None,
    *,
    runs: int,
    seed: int,
    progress: Callable[[int], None] = lambda _: None,
    keep: Callable[[Derivatives], None] = lambda _: None,
) -> Sensitivity:
    """Return the sensitivity for an existing run; see `sensitivity`.

    Args:
        run: run with derivatives.
        tolerances: see `sensitivity`.
        runs: see `sensitivity`.
        seed: see `sensitivity`.
        progress: function to call with the number of further samples, or drawn robots, that are done.
        keep: function to call with the derivatives of each block.

    Raises:
        InputError: a tolerance is invalid.
    """
    robot, parameter_tolerances = (
        run.robot,
        None if tolerances is None else tolerances_of(tolerances, run.parameters),
    )
    steps = np.array([step_of(each) for each in run.parameters])
    effects = Effects(steps, run.trajectory.times.block(0, run.trajectory.samples), len(robot.joints))
    deviations = (
        np.zeros(len(run.parameters))
        if parameter_tolerances is None
        else tolerance_deviations(parameter_tolerances)
    )
    band = None if parameter_tolerances is None else Band(deviations, robot.actuators)
    for part in run:
        effects.add(part)
        if band is not None:
            band.add(part)
        keep(part)
        progress(len(part.time))
    monte_carlo_results = None
    if parameter_tolerances is not None and runs:
        monte_carlo_results = monte_carlo(
            robot, run.trajectory, run.parameters, parameter_tolerances, runs, seed=seed, progress=progress
        )
    parameter_effects = [
        _effect(
            robot,
            parameter,
            index,
            effects,
            None if parameter_tolerances is None else float(deviations[index]),
        )
        for index, parameter in enumerate(run.parameters)
    ]
    return Sensitivity(
        robot=robot.name,
        trajectory=run.trajectory.name,
        verdict=effects.verdict,
        failed=effects.failed,
        samples=run.trajectory.samples,
        left_out=effects.left_out,
        warnings=(
            *robot.warnings,
            *run.trajectory.warnings,
            *([unjudged_tools_text(robot.limited_tools)] if robot.limited_tools else []),
        ),
        parameters=tuple(sorted(parameter_effects, key=lambda each: -each.share)),
        band={} if band is None else dict(zip(robot.joint_names, band.joints(), strict=True)),
        monte_carlo=monte_carlo_results,
        curves=None if band is None else band.curves(),
        units={joint.name: TORQUE.unit(joint.type) for joint in robot.joints},
    )


def _effect(
    robot: Robot, parameter: Parameter, index: int, effects: Effects, tolerance: float | None
) -> ParameterEffect:
    parameter_change = step_of(parameter)
    margins = np.where(
        np.isfinite(effects.smallest.value), parameter_change * effects.smallest.slopes[index], math.nan
    )
    joints = {
        name: JointEffect(
            torque=float(effects.largest[index, joint]),
            share=share_of_peak(float(effects.largest[index, joint]), float(effects.peak[joint])),
            time=float(effects.time[index, joint]),
            motor=int(effects.motor[index, joint]),
            margin=float(margins[joint]),
            spent=float(effects.spent[index, joint]),
        )
        for joint, name in enumerate(robot.joint_names)
        if effects.largest[index, joint] > 0 or effects.smallest.slopes[index, joint] != 0
    }
    return ParameterEffect(
        path=str(parameter),
        value=parameter.value,
        unit=parameter.unit,
        step=parameter_change,
        words=words_of(parameter),
        joints=joints,
        tolerance=tolerance,
    )
