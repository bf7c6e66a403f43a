"""Possible causes of residuals: a wrong sensor, or a law that is missing in the file.

Each cause is a set of columns to add to the equations. Unknown laws of friction and springs are sums of a few
functions of velocity and deflection, which suffice to detect that something is missing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import ConditionedRecording
from vsacli.studies.identification.estimation import Equations, least_squares
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.motor_equations import LINKS, motor_names
from vsacli.studies.identification.recording_faults import MOTOR, TORQUE

INITIAL_POSITION_ERROR = 1e-4
"""Initial error of a position, rad (m), in the search for it."""

MAX_POSITION_ERROR = 0.1
"""Largest plausible error of a position, rad (m): six degrees are noticed when an arm is set up."""

MAX_TORQUE_ERROR = 0.1
"""Largest plausible bias of a torque relative to the largest measured torque, and half of the largest
plausible gain error. Other checks find larger ones; here a large one would mask a spring with another law."""

PASSES = 3
"""Number of estimates of the error; the second differs from the third by less than its standard error."""

STRIBECK_SPEED_SHARE = 0.1
"""Share of the largest speed at which Stribeck friction has fallen by a factor e: in bearings and gears it
falls within the slowest tenth of their speed (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica
30 (1994))."""

DEGREE = 4
"""Degree of the polynomial of the deflection.

Most files have linear and cubic terms; terms of even degree detect other kinds of hardening and softening.
"""


class Cause(NamedTuple):
    """A possible cause of residuals that is not in the equations.

    Attributes:
        name: motor or link whose equations it changes.
        words: sentence with placeholders for name and size; a cause with several columns has no size.
        columns: columns for each recording, (rows, columns).
        unit: unit of the size.
        largest: largest plausible size.
        neutral: value added to the size in the sentence: 1 for a gain, which is a ratio.
    """

    name: str
    words: str
    columns: Sequence[FloatArray]
    unit: str = ""
    largest: float = np.inf
    neutral: float = 0.0

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.columns[0].shape[1])


OFF = "{name}: a position off by {size}, as by a wrong zero of its encoder, {would}"
BIASED = "{name}: a torque off by {size} {would}"
GAIN = "{name}: torques that read {size} times the torque that the rest of the equations requires {would}"
FRICTION = "{name}: what is left depends on its velocity: its friction has another law"
SPRING = (
    "{name}: what is left depends on its deflection: its spring has another law, or positions were resampled"
)
DAMPING = (
    "{{name}}: what is left is proportional to its velocity, and its damping, {damping:g} in the file, is "
    "not identified: name {path} in --fit"
)
PLACE = "{name}: what is left depends on its position: a cable, a stop or a weight is not in the file"


def residual_causes(
    robot: Robot,
    solution: Solution,
    recordings: Sequence[ConditionedRecording],
    equations: Sequence[Equations],
) -> list[Cause]:
    """Return possible causes of residuals of a joint's motors, or of all links.

    Args:
        robot: robot as in its file.
        solution: solution of the equations.
        recordings: fitted recordings.
        equations: equations of the recordings at the solution.
    """
    if solution.system.title == LINKS:
        return list(_link_causes(robot, recordings, equations))
    return list(_motor_causes(robot, solution, recordings, equations))


def _motor_causes(
    robot: Robot,
    solution: Solution,
    recordings: Sequence[ConditionedRecording],
    equations: Sequence[Equations],
) -> Iterator[Cause]:
    index = robot.joint_names.index(solution.system.title)
    joint = robot.joints[index]
    position, torque = (VARIABLES[each].quantity.unit(joint.type) for each in (MOTOR, TORQUE))
    names = motor_names(robot, index)
    motor_of_name = {name: motor for motor, name in enumerate(names) if name in solution.fit.residual_rms}
    has_spring = joint.actuator.has_columns(VARIABLES["phi"])[: len(names)]
    deflections = [_deflections(has_spring, each, index) for each in recordings]
    signs = np.where(np.mean(np.hstack(deflections), axis=1) < 0, -1.0, 1.0)  # opposite signs in a pair
    signed_deflections = [signs[:, None] * each for each in deflections]
    causes_by_kind: dict[int, list[Cause]] = {}
    for name, motor in motor_of_name.items():
        row_masks = [each.group == name for each in equations]
        position_columns = _position_error_columns(solution, recordings, equations, index, motor)
        yield Cause(name, OFF, position_columns, position, MAX_POSITION_ERROR)
        yield _bias_cause(name, row_masks, equations, torque)
        motor_causes = [
            _gain_cause(name, row_masks, equations),
            *_friction_causes(
                name,
                row_masks,
                recordings,
                [each.dtheta[:, index, motor] for each in recordings],
                DAMPING.format(
                    damping=joint.actuator.motors[motor].damping,
                    path=f"joints.{joint.name}.actuator.motor*.damping",
                ),
            ),
            _filtered_cause(
                SPRING,
                name,
                row_masks,
                recordings,
                _polynomial_terms(signed_deflections, motor, float(signs[motor])),
            ),
        ]
        yield from motor_causes
        for kind, each in enumerate(motor_causes):
            causes_by_kind.setdefault(kind, []).append(each)
    if len(motor_of_name) > 1:
        for first, second in causes_by_kind.values():
            columns = [one + other for one, other in zip(first.columns, second.columns, strict=True)]
            yield first._replace(name=f"both motors of {joint.name}", columns=columns)


def _deflections(has_spring: Sequence[bool], recording: ConditionedRecording, index: int) -> FloatArray:
    """Return the deflections of motors behind a spring and the positions of others, (motors, samples)."""
    theta, q = recording.theta[:, index, : len(has_spring)].T, recording.q[:, index]
    return np.where(np.array(has_spring)[:, None], theta - q, theta)


def _link_causes(
    robot: Robot, recordings: Sequence[ConditionedRecording], equations: Sequence[Equations]
) -> Iterator[Cause]:
    for index, joint in enumerate(robot.joints):
        name = f"link of {joint.name}"
        row_masks = [each.group == name for each in equations]
        if any(each.any() for each in row_masks):
            yield _gain_cause(name, row_masks, equations)
            words = DAMPING.format(damping=joint.damping, path=f"joints.{joint.name}.damping")
            yield from _friction_causes(
                name, row_masks, recordings, [each.dq[:, index] for each in recordings], words
            )
            positions = [each.q[:, index][None] for each in recordings]
            yield _filtered_cause(PLACE, name, row_masks, recordings, _polynomial_terms(positions, 0, 1.0))


def _bias_cause(
    name: str, row_masks: Sequence[BoolArray], equations: Sequence[Equations], unit: str
) -> Cause:
    largest = max(
        float(np.max(np.abs(each.measured[there]))) for each, there in zip(equations, row_masks, strict=True)
    )
    columns = [each[:, None].astype(float) for each in row_masks]
    return Cause(name, BIASED, columns, unit, MAX_TORQUE_ERROR * largest)


def _gain_cause(name: str, row_masks: Sequence[BoolArray], equations: Sequence[Equations]) -> Cause:
    columns = [(each.predicted * there)[:, None] for each, there in zip(equations, row_masks, strict=True)]
    return Cause(name, GAIN, columns, largest=2 * MAX_TORQUE_ERROR, neutral=1.0)


def _friction_causes(
    name: str,
    row_masks: Sequence[BoolArray],
    recordings: Sequence[ConditionedRecording],
    velocities: Sequence[FloatArray],
    undamped: str,
) -> Iterator[Cause]:
    """Yield damping, then quadratic friction, then dry and Stribeck friction.

    Damping that is identified leaves nothing to explain; `undamped` words the other case.
    """
    # separate causes, since a test with fewer columns detects smaller effects
    max_speed = max(float(np.max(np.abs(each), initial=0.0)) for each in velocities) or 1.0
    scaled_velocities = [each / max_speed for each in velocities]
    yield _filtered_cause(undamped, name, row_masks, recordings, [v[None] for v in scaled_velocities])
    yield _filtered_cause(
        FRICTION, name, row_masks, recordings, [(v * np.abs(v))[None] for v in scaled_velocities]
    )
    dry = [
        np.sign(v) for v in scaled_velocities
    ]  # the law of the file, so that it adds nothing where that is fitted
    stribeck = [
        sign * np.exp(-np.abs(v) / STRIBECK_SPEED_SHARE)
        for sign, v in zip(dry, scaled_velocities, strict=True)
    ]
    yield _filtered_cause(
        FRICTION, name, row_masks, recordings, [np.stack(each) for each in zip(dry, stribeck, strict=True)]
    )


def _filtered_cause(
    words: str,
    name: str,
    row_masks: Sequence[BoolArray],
    recordings: Sequence[ConditionedRecording],
    terms: Sequence[FloatArray],
) -> Cause:
    """Return a cause from functions of the motion, (terms, samples) for each recording, filtered."""
    columns = []
    for row_mask, recording, recording_terms in zip(row_masks, recordings, terms, strict=True):
        column_block = np.zeros((len(row_mask), len(recording_terms)))
        if row_mask.any():
            column_block[row_mask] = recording.filter.applied(recording_terms.T)
        columns.append(column_block)
    return Cause(name, words, columns)


def _polynomial_terms(positions: Sequence[FloatArray], position_index: int, sign: float) -> list[FloatArray]:
    """Return Legendre polynomials of one position over the range of all, (terms, samples) per recording.

    Args:
        positions: positions in each recording, (positions, samples).
        position_index: index of the position.
        sign: sign with which the torque acts.
    """
    low, high = min(float(each.min()) for each in positions), max(float(each.max()) for each in positions)
    half_range = (high - low) / 2 or 1.0
    scaled = [(each[position_index] - low) / half_range - 1 for each in positions]
    return [sign * legendre.legvander(each, DEGREE)[:, 1:].T for each in scaled]


def _position_error_columns(
    solution: Solution,
    recordings: Sequence[ConditionedRecording],
    equations: Sequence[Equations],
    index: int,
    motor: int,
) -> list[FloatArray]:
    """Return the change of the prediction per error of a motor's position, (rows, 1) for each recording.

    Springs are nonlinear in the error, and it makes identified parameters wrong. So the slope is a secant
    over the best-fitting error, at the parameters that belong to it.
    """
    parameter_values, position_error = solution.predicting, INITIAL_POSITION_ERROR
    columns: list[FloatArray] = []
    for _ in range(PASSES):
        columns = [
            _prediction_slope(solution, parameter_values, each, (index, motor), position_error)
            for each in recordings
        ]
        extended_equations = [
            each._replace(slopes=np.hstack((each.slopes[:, solution.free], column)))
            for each, column in zip(equations, columns, strict=True)
        ]
        fit = least_squares(extended_equations, np.zeros(len(solution.free) + 1))
        if not np.isfinite(fit.standard_errors[-1]) or abs(fit.values[-1]) > MAX_POSITION_ERROR:
            break
        parameter_values = solution.predicting
        parameter_values[list(solution.free)] += fit.solution[:-1]
        position_error = float(fit.values[-1]) or INITIAL_POSITION_ERROR
    return columns


def _prediction_slope(
    solution: Solution,
    parameter_values: FloatArray,
    recording: ConditionedRecording,
    theta_index: tuple[int, int],
    position_error: float,
) -> FloatArray:
    theta = recording.theta.copy()
    theta[:, *theta_index] -= position_error
    shifted_prediction, prediction = (
        solution.system.equations(parameter_values, each).predicted
        for each in (recording._replace(theta=theta), recording)
    )
    return np.asarray((shifted_prediction - prediction) / position_error)[:, None]
