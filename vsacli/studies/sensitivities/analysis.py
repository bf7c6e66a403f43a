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
        self._done = 0
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
        weights = self._weights[self._done : self._done + len(part.time), None, None]
        spending = weights * (block.motor_power > 0)  # negative work is not subtracted
        gap = np.where(np.isfinite(part.margin), part.margin, np.inf)
        worst, joints = gap.argmin(axis=0), np.arange(gap.shape[1])
        smaller = gap[worst, joints] < self.smallest.value
        self.smallest.slopes[:, smaller] = 0.0
        for group in part.groups:
            for joint, slopes in enumerate(group.of_joints):
                if slopes is None or not group.places:
                    continue
                self._add_torque(part.time, slopes["tau_motor"], group.places, joint)
                energy = slopes.total("motor_power", spending[:, joint].T)
                self.spent[group.places, joint] += energy * self._steps[group.places]
                if smaller[joint]:
                    self.smallest.slopes[group.places, joint] = slopes[MARGIN][:, worst[joint]]
        self.smallest = self.smallest._replace(
            value=np.where(smaller, gap[worst, joints], self.smallest.value),
            time=np.where(smaller, part.time[worst], self.smallest.time),
        )
        self._done += len(part.time)

    @property
    def verdict(self) -> str:
        """Verdict on the run with unchanged parameters."""
        judged = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR, "over_limit": LIMITS}
        return next((verdict for verdict, bits in judged.items() if has_flag(self._flags, bits).any()), "ok")

    def _add_torque(self, time: FloatArray, slopes: FloatArray, places: Sequence[int], joint: int) -> None:
        changes = np.abs(slopes).reshape(len(places), -1)
        np.copyto(changes, 0.0, where=np.isnan(changes))
        worst = changes.argmax(axis=1)
        found = changes[np.arange(len(places)), worst] * self._steps[places]
        larger = found > self.largest[places, joint]
        at = np.asarray(places)[larger]
        self.largest[at, joint] = found[larger]
        self.time[at, joint] = time[worst[larger] % len(time)]
        self.motor[at, joint] = 1 + worst[larger] // len(time)


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
    robot, given = run.robot, None if tolerances is None else tolerances_of(tolerances, run.parameters)
    steps = np.array([step_of(each) for each in run.parameters])
    effects = Effects(steps, run.trajectory.times.block(0, run.trajectory.samples), len(robot.joints))
    sizes = np.zeros(len(run.parameters)) if given is None else tolerance_deviations(given)
    band = None if given is None else Band(sizes, robot.actuators)
    for part in run:
        effects.add(part)
        if band is not None:
            band.add(part)
        keep(part)
        progress(len(part.time))
    drawn = None
    if given is not None and runs:
        drawn = monte_carlo(robot, run.trajectory, run.parameters, given, runs, seed=seed, progress=progress)
    found = [
        _effect(robot, parameter, place, effects, None if given is None else float(sizes[place]))
        for place, parameter in enumerate(run.parameters)
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
        parameters=tuple(sorted(found, key=lambda each: -each.share)),
        band={} if band is None else dict(zip(robot.joint_names, band.joints(), strict=True)),
        monte_carlo=drawn,
        curves=None if band is None else band.curves(),
        units={joint.name: TORQUE.unit(joint.type) for joint in robot.joints},
    )


def _effect(
    robot: Robot, parameter: Parameter, place: int, effects: Effects, tolerance: float | None
) -> ParameterEffect:
    step = step_of(parameter)
    margins = np.where(np.isfinite(effects.smallest.value), step * effects.smallest.slopes[place], math.nan)
    joints = {
        name: JointEffect(
            torque=float(effects.largest[place, joint]),
            share=share_of_peak(float(effects.largest[place, joint]), float(effects.peak[joint])),
            time=float(effects.time[place, joint]),
            motor=int(effects.motor[place, joint]),
            margin=float(margins[joint]),
            spent=float(effects.spent[place, joint]),
        )
        for joint, name in enumerate(robot.joint_names)
        if effects.largest[place, joint] > 0 or effects.smallest.slopes[place, joint] != 0
    }
    return ParameterEffect(
        path=str(parameter),
        value=parameter.value,
        unit=parameter.unit,
        step=step,
        words=words_of(parameter),
        joints=joints,
        tolerance=tolerance,
    )
