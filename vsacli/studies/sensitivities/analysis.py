"""Sensitivity of a whole run: ranking, and what tolerances make of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from vsacli.base.units import TORQUE
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.studies.sensitivities.band import Band
from vsacli.studies.sensitivities.effects import Effects
from vsacli.studies.sensitivities.monte_carlo import monte_carlo
from vsacli.studies.sensitivities.parameter_steps import step_of, words_of
from vsacli.studies.sensitivities.sensitivity_report import JointEffect, ParameterEffect, Sensitivity
from vsacli.studies.sensitivities.sensitivity_run import SensitivityRun
from vsacli.studies.sensitivities.slopes import Derivatives
from vsacli.studies.sensitivities.tolerances import deviations, tolerances_of
from vsacli.trajectory.trajectory import Trajectory


def sensitivity(
    robot: Robot,
    trajectory: Trajectory,
    parameters: Sequence[str] = (),
    tolerances: str | None = None,
    *,
    runs: int = 0,
    seed: int = 0,
) -> Sensitivity:
    """How much motor torques, margins and energy depend on each number of a robot.

    Derivatives are exact to rounding: of the recursion by dual numbers, of the deflections by the implicit
    function theorem. Results of a change are its size times the derivative.

    Args:
        robot: the robot.
        trajectory: for this robot.
        parameters: only numbers whose paths fit one of these, e.g. `joints.*.link.mass`; all if empty.
        tolerances: how uncertain the numbers are: a share such as `5%`, or the path of a YAML file with a
            distribution for paths, such as `joints.*.link.mass: {normal: 2 %}`.
        runs: how many robots are drawn from the tolerances and run as well.
        seed: of these draws.

    Raises:
        InputError: the trajectory does not fit the robot, a pattern fits no number, or a tolerance is none.
    """
    return analysed(SensitivityRun(robot, trajectory, parameters), tolerances, runs=runs, seed=seed)


def analysed(
    run: SensitivityRun,
    tolerances: str | None,
    *,
    runs: int,
    seed: int,
    progress: Callable[[int], None] = lambda _: None,
    keep: Callable[[Derivatives], None] = lambda _: None,
) -> Sensitivity:
    """As `sensitivity`, of a run that was made already.

    Args:
        run: the run.
        tolerances: as there.
        runs: as there.
        seed: as there.
        progress: is told how many further steps, and robots, are done.
        keep: gets the derivatives, block by block.

    Raises:
        InputError: a tolerance is none.
    """
    robot, given = run.robot, None if tolerances is None else tolerances_of(tolerances, run.parameters)
    steps = np.array([step_of(each) for each in run.parameters])
    effects = Effects(steps, run.trajectory.times.block(0, run.trajectory.samples), len(robot.joints))
    sizes = np.zeros(len(run.parameters)) if given is None else deviations(given)
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
            share=_share(float(effects.largest[place, joint]), float(effects.peak[joint])),
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


def _share(change: float, peak: float) -> float:
    return change / peak if peak > 0 else math.nan
