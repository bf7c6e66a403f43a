"""What a constant error of a sensor would explain of what equations leave: a wrong zero, a biased torque."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.estimation.equations import Equations
from vsacli.studies.identification.estimation.least_squares import least_squares
from vsacli.studies.identification.estimation.solution import Solution, rms
from vsacli.studies.identification.motors.motor_equations import motor_names
from vsacli.studies.identification.records.record_columns import MOTOR, TORQUE
from vsacli.studies.identification.records.signals import Signals

STEP = 1e-4
"""Change of a position, rad (m), by which torques are differentiated over it."""

EXPLAINED = 0.5
"""Share of what is left that must remain at most, for an offset to be worth a word."""

CERTAIN = 4.0
"""Standard errors from which on an offset is one."""


class _Explanation(NamedTuple):
    """Offsets of the motors of a joint with their standard errors, and the share of what is left then."""

    words: str
    variable: str
    offsets: FloatArray
    errors: FloatArray
    left: float


def offsets(robot: Robot, found: Solution, records: Sequence[Signals]) -> Iterator[str]:
    """Sentences on offsets that would explain most of what the equations of a joint's motors leave.

    Args:
        robot: the robot.
        found: the numbers of the motors of a joint.
        records: to which they were fitted.
    """
    index = robot.joint_names.index(found.system.title)
    exact = [each._replace(noise=None) for each in records]
    equations = [found.equations(each) for each in exact]
    motors = range(robot.joints[index].actuator.motor_count)
    positions = [
        np.stack([_by_position(found, each, index, motor) for motor in motors], axis=-1) for each in exact
    ]
    names = motor_names(robot, index)
    torques = [1.0 * (each.group[:, None] == np.array(names)) for each in equations]
    zero = "a position off by {}, as by a wrong zero of its encoder,"
    explanations = [
        _explanation(found, equations, positions, zero, MOTOR),
        _explanation(found, equations, torques, "a torque off by {}", TORQUE),
    ]
    best = min(explanations, key=lambda each: each.left)
    if best.left < EXPLAINED:
        unit = VARIABLES[best.variable].quantity.unit(robot.joint_types[index])
        for name, offset, error in zip(names, best.offsets, best.errors, strict=True):
            if abs(offset) > CERTAIN * error:
                words = best.words.format(f"{offset:+.3g} +- {error:.1g} {unit}")
                yield f"{name}: {words} would explain most of what is left"


def _by_position(found: Solution, signals: Signals, index: int, motor: int) -> FloatArray:
    """Derivative of what is predicted by the error of a motor's position, (rows,)."""
    ends = []
    for sign in (-1, 1):
        theta = signals.theta.copy()
        theta[:, index, motor] += sign * STEP
        ends.append(found.equations(signals._replace(theta=theta)).predicted)
    return np.asarray((ends[0] - ends[1]) / (2 * STEP))


def _explanation(
    found: Solution,
    equations: Sequence[Equations],
    columns: Sequence[FloatArray],
    words: str,
    variable: str,
) -> _Explanation:
    """The numbers once more with further unknowns, whose columns are given, (rows, motors) of each record."""
    further = columns[0].shape[1]
    longer = [
        each._replace(slopes=np.hstack((each.slopes, columns_)))
        for each, columns_ in zip(equations, columns, strict=True)
    ]
    present = np.append(found.predicting, np.zeros(further))
    fit = least_squares(longer, present)
    left = [each.measured - each.predicted for each in equations]
    rest = [each - more.slopes @ (fit.solution - present) for each, more in zip(left, longer, strict=True)]
    share = rms(np.concatenate(rest)) / rms(np.concatenate(left))
    return _Explanation(words, variable, fit.values[-further:], fit.standard_errors[-further:], share)
