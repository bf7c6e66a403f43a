"""Recordings compared with the robot: misnamed columns, delayed torques, and torque gains.

Before a fit, `model_doubts` finds wrong units and signs, exchanged columns and exchanged motors. After it,
`delay` finds by how much torques lag behind positions, and `gain_findings` finds joints whose parameters all
differ from the file by one factor.

Equations of motors are linear in inertias, dampings, friction and spring coefficients: torques that read 3 %
too large make all of these 3 % too large, without a residual. No motion distinguishes such a gain from a
joint whose parameters differ like that. The links of the file do: the identified spring torque is compared
with the torque that these links require.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.variables import MOTORS, VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import ConditionedRecording
from vsacli.studies.identification.estimation import SEPARABLE, Equations, least_squares
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.identification_text import rounded_by_error
from vsacli.studies.identification.independence import independence
from vsacli.studies.identification.link_equations import link_system, without_links
from vsacli.studies.identification.motor_equations import MOTORS as MOTORS_GROUP
from vsacli.studies.identification.motor_equations import MotorSystem, group_of, motor_names
from vsacli.studies.identification.recording_faults import MOTOR, POSITION, TORQUE
from vsacli.studies.identification.recordings import Record
from vsacli.studies.measured.agreement import Agreement, straight_line
from vsacli.studies.measured.likely_causes import exchanged, likely_causes
from vsacli.studies.measured.pairing import exactness, tame

OTHER_BRANCH_DISTANCE = 0.5
"""Relative distance from deflections on the robot's branch above which deflections are on another one."""

FOLLOWS_BETTER = 0.25
"""Variance of a motor about another joint, relative to that about its own joint, below which it follows the
other one."""

FOLLOWS = 0.5
"""Upper bound of the variance about the followed joint, relative to the variance of that joint."""

CONSTANT_RANGE_SHARE = 1e-3
"""Share of the predicted range below which a measured torque is constant."""

ODD_GAINS: Mapping[str, float] = MappingProxyType(
    {
        "run against each other: one has the wrong sign": -1.0,
        "look as if the first were in degrees, or the second marked so": 180 / math.pi,
        "look as if the second were in degrees, or the first marked so": math.pi / 180,
    }
)
"""Ratios of a motor's motion to its joint's, by the likely mistake."""


def model_doubts(
    robot: Robot, joints: Sequence[int], record: Record, recording: ConditionedRecording
) -> Iterator[str]:
    """Yield sentences on columns whose content does not fit their names.

    Motors should follow their joints, and torques the predictions of the robot file, apart from the errors of
    its parameters.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        record: recording as read.
        recording: conditioned recording.
    """
    sprung_joints = [index for index in joints if robot.joints[index].actuator.sprung]
    sprung_joints = [index for index in sprung_joints if (TORQUE, index, MOTORS[0]) in record.columns]
    torques = [
        each for index in sprung_joints for each in _torque_agreements(robot, index, record, recording)
    ]
    if torques:
        agreements, ratios = zip(*torques, strict=True)
        yield from likely_causes(_with_exchanged_columns(agreements), ratios)
    for index in sprung_joints:
        yield from _position_sentences(robot, index, record, recording)
        yield from _branch_sentences(robot, index, recording)


def _with_exchanged_columns(torques: Sequence[Agreement]) -> list[Agreement]:
    """Return the torques, with the column whose prediction each follows if columns look exchanged."""
    agreements, units = list(torques), {torque.unit for torque in torques}
    if len(units) > 1 or len({torque.samples for torque in torques}) > 1:
        return agreements
    exact_values = [exactness(tame(torque.measured)) for torque in torques]
    predicted = [torque.computed for torque in torques]
    for row, column in exchanged(
        [torque.measured for torque in torques], exact_values, lambda _row: predicted
    ):
        agreements[row] = replace(torques[row], follows=torques[column].column)
    return agreements


def _position_sentences(
    robot: Robot, index: int, record: Record, recording: ConditionedRecording
) -> Iterator[str]:
    """Yield sentences on motors behind springs that do not follow their joint."""
    stride = recording.filter.stride
    actuator, q = robot.joints[index].actuator, recording.q[::stride]
    for motor, follows in enumerate(actuator.has_columns(VARIABLES["phi"])[: actuator.motor_count]):
        theta = recording.theta[::stride, index, motor]
        own_variance = float(np.var(theta - q[:, index]))
        name, joint = (
            record.columns[place] for place in ((MOTOR, index, MOTORS[motor]), (POSITION, index, None))
        )
        if not follows:
            continue
        for words, gain in ODD_GAINS.items():
            if _follows_better(theta / gain, q[:, index], own_variance / gain**2):
                yield f"columns {name!r} and {joint!r} {words}"
        scaled_variance = _least_variance(theta, q[:, index])  # joints that move alike cannot be told apart
        for other in range(q.shape[1]):
            if other != index and _follows_better(theta, q[:, other], scaled_variance):
                other_column = f"{record.columns[POSITION, other, None]!r}, not {joint!r}"
                yield f"column {name!r} follows {other_column}: columns look exchanged"


def _follows_better(theta: FloatArray, q: FloatArray, own_variance: float) -> bool:
    """Return whether a motor follows a joint much better than with the variance `own_variance`."""
    variance = float(np.var(theta - q))
    return variance < FOLLOWS_BETTER * own_variance and variance < FOLLOWS * float(np.var(q))


def _least_variance(theta: FloatArray, q: FloatArray) -> float:
    """Return the least variance of the difference of a motor from a multiple of the motion of a joint."""
    (motor_variance, covariance), (_, joint_variance) = np.cov(theta, q, bias=True)
    return (
        float(motor_variance - covariance**2 / joint_variance)
        if joint_variance > 0
        else float(motor_variance)
    )


def _torque_agreements(
    robot: Robot, index: int, record: Record, recording: ConditionedRecording
) -> Iterator[tuple[Agreement, float]]:
    """Yield the agreement of each motor's measured torque with its prediction, and the gear ratio."""
    system = MotorSystem(robot, index)
    equations = system.of_record(system.before, recording)
    joint = robot.joints[index]
    for motor, (name, motor_parameters) in enumerate(
        zip(motor_names(robot, index), joint.actuator.motors, strict=True)
    ):
        row_mask = equations.group == name
        computed, measured = equations.predicted[row_mask], equations.measured[row_mask]
        yield (
            _torque_agreement(
                record.columns[TORQUE, index, MOTORS[motor]],
                (joint.name, MOTORS[motor], VARIABLES[TORQUE].quantity.unit(joint.type)),
                recording.time[:: recording.filter.stride],
                computed,
                measured,
            ),
            math.nan if motor_parameters.gear_ratio is None else motor_parameters.gear_ratio,
        )


def _torque_agreement(
    column: str,
    joint_motor_unit: tuple[str, int, str],
    time: FloatArray,
    computed: FloatArray,
    measured: FloatArray,
) -> Agreement:
    joint, motor, unit = joint_motor_unit
    error = measured - computed
    offset, gain, correlation = straight_line(computed, measured)
    worst_index, rms = int(np.argmax(np.abs(error))), float(np.sqrt(np.mean(error**2)))
    return Agreement(
        column=column,
        variable=TORQUE,
        joint=joint,
        motor=motor,
        unit=unit,
        samples=len(error),
        rms=rms,
        share=rms / float(np.sqrt(np.mean(computed**2))),
        worst=float(error[worst_index]),
        worst_time=float(time[worst_index]),
        offset=offset,
        gain=gain,
        correlation=correlation,
        lag=math.nan,
        time=time,
        computed=computed,
        measured=measured,
        still="measured" if np.ptp(measured) < CONSTANT_RANGE_SHARE * np.ptp(computed) else None,
    )


def _branch_sentences(robot: Robot, index: int, recording: ConditionedRecording) -> Iterator[str]:
    """Yield a sentence if most deflections are on another branch than that of the robot."""
    actuator = robot.joints[index].actuator
    if not actuator.commanded or actuator.opposite_branch is None:
        return
    stride = recording.filter.stride
    q, theta = recording.q[::stride, index], recording.theta[::stride, index]
    unknowns = np.stack(actuator.unknowns(theta.T - q, theta.T))
    springs = actuator.springs(unknowns, q)
    branch_deflections = actuator.solve(springs.tau_e, springs.stiffness, q).deflections
    is_off_branch = np.linalg.norm(
        branch_deflections - unknowns, axis=0
    ) > OTHER_BRANCH_DISTANCE * np.linalg.norm(unknowns, axis=0)
    if np.mean(is_off_branch) > 1 / 2:
        yield (
            f"the springs of {robot.joint_names[index]} are deflected as on the branch "
            f"{actuator.opposite_branch}: the columns of motors 1 and 2 may be exchanged, or the branch in "
            "the robot file is the other"
        )


CERTAIN_DELAY = 4.0
"""Delay in standard errors above which it is removed; at 2, one in twenty recordings would be shifted by
chance."""

MIN_DELAY_SAMPLES = 0.05
"""Delay in samples above which it is removed."""


class Delay(NamedTuple):
    """The delay of the torques of a recording behind its positions.

    Attributes:
        seconds: delay, s; negative if torques are early, NaN if unidentifiable.
        standard_error: standard error of the delay, s.
    """

    seconds: float
    standard_error: float

    def matters(self, rate: float) -> bool:
        """Return whether the delay is to be removed from a recording with a sample rate in Hz."""
        magnitude = abs(self.seconds)
        return magnitude > CERTAIN_DELAY * self.standard_error and magnitude * rate > MIN_DELAY_SAMPLES


def delay(solutions: Sequence[Solution], recording: ConditionedRecording) -> Delay:
    """Return the delay with which the equations of all systems hold best.

    Torques delayed by d are tau(t - d) = tau(t) - d tau'(t), so that d is a further unknown of each system.
    """
    rates = np.gradient(recording.tau_motor, 1 / recording.rate, axis=0)
    torque_rates = recording._replace(tau_motor=rates, noise=None)
    identifiable = [
        each
        for system in solutions
        for each in _estimated_delays(system, recording._replace(noise=None), torque_rates)
    ]
    values, errors = np.array([each for each in identifiable if np.isfinite(each).all()]).reshape(-1, 2).T
    if not len(values):
        return Delay(np.nan, np.nan)
    weights = 1 / errors**2
    late = Delay(float(weights @ values / weights.sum()), float(weights.sum() ** -0.5))
    # the expansion tells nothing of delays beyond a period of the highest frequency
    return late if abs(late.seconds) * recording.filter.bandwidth <= 1 else Delay(np.nan, np.nan)


def _estimated_delays(
    solution: Solution, recording: ConditionedRecording, torque_rates: ConditionedRecording
) -> Iterator[tuple[float, float]]:
    """Yield the delay and its standard error, unless the system has no equations."""
    equations, rate_equations = solution.equations(recording), solution.equations(torque_rates)
    if len(equations.measured):
        position_equations = solution.equations(recording._replace(tau_motor=0 * torque_rates.tau_motor))
        slopes = np.column_stack((equations.slopes, position_equations.measured - rate_equations.measured))
        fit = least_squares([equations._replace(slopes=slopes)], np.append(solution.predicting, 0.0))
        yield float(fit.values[-1]), float(fit.standard_errors[-1])


def without_delay(recording: ConditionedRecording, delay_seconds: float) -> ConditionedRecording:
    """Return the recording with torques advanced by `delay_seconds` seconds, while both were recorded."""
    spline = scipy.interpolate.make_interp_spline
    first, last = np.searchsorted(
        recording.time, (recording.time[0] - delay_seconds, recording.time[-1] - delay_seconds)
    )
    covered = recording.during(slice(first, last))
    torques = covered.tau_motor.copy()
    is_recorded = np.isfinite(torques).all(axis=0)
    torques[:, is_recorded] = spline(recording.time, recording.tau_motor[:, is_recorded], k=3)(
        covered.time + delay_seconds
    )
    return covered._replace(tau_motor=torques)


CERTAIN_FACTOR = 4.0
"""Difference of a factor from 1, or from another factor, in standard errors, that is significant."""

MAX_DEVIATION_ERRORS = 3.0
"""Largest rms deviation of parameters from a common factor, in standard errors."""


class Factor(NamedTuple):
    """A ratio with its standard error."""

    value: float
    error: float

    def differs(self, other: float) -> bool:
        """Return whether the factor differs significantly from another one."""
        return abs(self.value - other) > CERTAIN_FACTOR * self.error

    def __str__(self) -> str:
        return f"{rounded_by_error(self.value, self.error)} +- {self.error:.2g}"


class Gain(NamedTuple):
    """A finding on the gain of a joint's torques.

    Attributes:
        sentence: finding as a sentence.
        unreliable: whether the torques, rather than the robot, are likely wrong.
    """

    sentence: str
    unreliable: bool


def gain_findings(
    robot: Robot,
    joints: Sequence[int],
    motors: Sequence[Solution],
    recordings: Sequence[ConditionedRecording],
) -> list[Gain]:
    """Return findings on joints whose parameters all differ from the file by one factor.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        motors: solutions, joint by joint.
        recordings: conditioned recordings.
    """
    factors = {each.system.title: factor for each in motors if (factor := _common_factor(each, recordings))}
    if not factors:
        return []
    link_factors = _factors_by_links(robot, joints, motors, recordings)
    solutions = {each.system.title: each for each in motors}
    return [
        _gain_finding(
            solutions[name], factor, link_factors.get(name), rotor_differs=_rotor_differs(solutions[name])
        )
        for name, factor in factors.items()
    ]


def _common_factor(solution: Solution, recordings: Sequence[ConditionedRecording]) -> Factor | None:
    """Return the common factor of a joint's motor and spring parameters over those of the file, if any."""
    equations = [solution.equations(each) for each in recordings]
    slopes = np.concatenate([each.slopes[:, solution.free] for each in equations])
    predicted = np.concatenate([each.predicted for each in equations])
    weight = np.concatenate(
        [[1 / solution.fit.residual_rms[name] for name in each.group] for each in equations]
    )
    identifiable = np.flatnonzero(np.isfinite(solution.fit.standard_errors))
    if not identifiable.size or solution.fit.inseparable:
        return None
    split = independence(slopes * weight[:, None], SEPARABLE)
    projection = split.q.T @ (predicted * weight)
    remainder = predicted * weight - split.q @ projection
    if np.linalg.norm(remainder) > SEPARABLE * np.linalg.norm(projection):
        return None  # other parameters contribute that a gain of the unknowns cannot change
    gain_direction = np.zeros(slopes.shape[1])
    gain_direction[split.kept] = np.linalg.solve(split.r, projection) / split.scale[split.kept]
    return _fitted_factor(solution, gain_direction[identifiable], identifiable)


def _fitted_factor(solution: Solution, gain_direction: FloatArray, identifiable: IndexArray) -> Factor | None:
    """Return the factor that brings parameters nearest to the file, if they then agree with it."""
    file_values = solution.system.before[list(solution.free)][identifiable]
    difference = solution.fit.values[identifiable] - file_values
    covariance = solution.fit.covariance[np.ix_(identifiable, identifiable)]
    weighted = np.linalg.solve(covariance, np.column_stack((gain_direction, difference)))
    information = float(gain_direction @ weighted[:, 0])
    share, error = float(gain_direction @ weighted[:, 1]) / information, information**-0.5
    remainder = difference - share * gain_direction
    deviation = float(remainder @ np.linalg.solve(covariance, remainder)) / max(len(identifiable) - 1, 1)
    factor = Factor(1 / (1 - share), error / (1 - share) ** 2)
    return factor if factor.differs(1.0) and deviation < MAX_DEVIATION_ERRORS**2 else None


def _factors_by_links(
    robot: Robot,
    joints: Sequence[int],
    motors: Sequence[Solution],
    recordings: Sequence[ConditionedRecording],
) -> dict[str, Factor]:
    """Return the ratio of identified spring torque to that required by the links of the file, by joint."""
    system = link_system(robot, (), motors)
    if without_links(robot, joints, system, recordings):
        return {}
    base_count = system.bodies
    equations = [system.equations(system.before, solution) for solution in recordings]
    factors = {}
    for solution in motors:
        title = solution.system.title
        resistance_indices = [
            at for at, name in enumerate(system.names) if at >= base_count and name.split(".")[1] == title
        ]
        ratio_equations = [
            _ratio_equations(one, f"link of {title}", system.before[:base_count], resistance_indices)
            for one in equations
        ]
        fit = least_squares(ratio_equations, np.zeros(1 + len(resistance_indices)))
        if np.isfinite(fit.standard_errors[0]):
            factors[title] = Factor(float(fit.values[0]), float(fit.standard_errors[0]))
    return factors


def _ratio_equations(
    equations: Equations, group: str, base: FloatArray, resistance_indices: Sequence[int]
) -> Equations:
    """Return equations of a joint whose unknowns are the ratio to the link torque, and its resistance."""
    row_mask = equations.group == group
    slopes = equations.slopes[row_mask]
    assert equations.errors is not None, "as of links"
    return equations._replace(
        measured=equations.measured[row_mask],
        predicted=np.zeros(int(row_mask.sum())),
        slopes=np.column_stack((slopes[:, : len(base)] @ base, slopes[:, resistance_indices])),
        group=equations.group[row_mask],
        sample=equations.sample[row_mask],
        errors=equations.errors[row_mask],
        noise=None,
    )


def _rotor_differs(solution: Solution) -> bool:
    """Return whether any motor parameter differs significantly from the file."""
    assert isinstance(solution.system, MotorSystem), "of motors"
    return any(
        abs(solution.fit.values[free_index] - solution.system.before[index])
        > CERTAIN_FACTOR * solution.fit.standard_errors[free_index]
        for free_index, index in enumerate(solution.free)
        if group_of(solution.system.sought[index]) == MOTORS_GROUP
    )


def _gain_finding(
    solution: Solution, factor: Factor, link_factor: Factor | None, *, rotor_differs: bool
) -> Gain:
    """Return the finding for a factor: torques or robot are wrong, as far as links or rotor decide it."""
    direction = "large" if factor.value > 1 else "small"
    common_factor_clause = (
        f"{solution.system.title}: the numbers found are {factor} times those of the file, all of them"
    )
    link_clause = f"what springs carry by these numbers is {link_factor} times what links as in the file need"
    if link_factor and link_factor.differs(1.0) and not link_factor.differs(factor.value):
        return Gain(
            f"{common_factor_clause}, and {link_clause}: the torques read too {direction}", unreliable=True
        )
    if link_factor and link_factor.differs(factor.value) and not link_factor.differs(1.0):
        return Gain(
            f"{common_factor_clause}, but {link_clause}: it is springs and motors that differ",
            unreliable=False,
        )
    decision_clause = (
        f"{link_clause}, which does not decide it" if link_factor else "the links tell nothing of it"
    )
    if rotor_differs:
        reason = (
            "it is unlikely that a rotor and springs deviate by the same factor; torques that read too "
            "{size} explain it"
        )
        return Gain(
            f"{common_factor_clause}: {reason.format(size=direction)}; {decision_clause}", unreliable=True
        )
    return Gain(
        f"{common_factor_clause}: torques that read too {direction} look the same; {decision_clause}",
        unreliable=False,
    )
