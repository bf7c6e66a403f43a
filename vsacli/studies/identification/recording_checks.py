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

ELSEWHERE = 0.5
"""Relative distance from deflections on the robot's branch above which deflections are on another one."""

FOLLOWS_BETTER = 0.25
"""Variance of a motor about another joint, relative to that about its own joint, below which it follows the
other one."""

FOLLOWS = 0.5
"""Upper bound of the variance about the followed joint, relative to the variance of that joint."""

RESTING = 1e-3
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
    robot: Robot, joints: Sequence[int], record: Record, signals: ConditionedRecording
) -> Iterator[str]:
    """Yield sentences on columns whose content does not fit their names.

    Motors should follow their joints, and torques the predictions of the robot file, apart from the errors of
    its parameters.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        record: recording as read.
        signals: conditioned recording.
    """
    sprung = [index for index in joints if robot.joints[index].actuator.sprung]
    sprung = [index for index in sprung if (TORQUE, index, MOTORS[0]) in record.columns]
    torques = [each for index in sprung for each in _torque_agreements(robot, index, record, signals)]
    if torques:
        agreements, ratios = zip(*torques, strict=True)
        yield from likely_causes(_exchanged_torques(agreements), ratios)
    for index in sprung:
        yield from _positions(robot, index, record, signals)
        yield from _branch_sentences(robot, index, signals)


def _exchanged_torques(torques: Sequence[Agreement]) -> list[Agreement]:
    """Return the torques, with the column whose prediction each follows if columns look exchanged."""
    found, units = list(torques), {torque.unit for torque in torques}
    if len(units) > 1 or len({torque.samples for torque in torques}) > 1:
        return found
    exact = [exactness(tame(torque.measured)) for torque in torques]
    predicted = [torque.computed for torque in torques]
    for row, column in exchanged([torque.measured for torque in torques], exact, lambda _row: predicted):
        found[row] = replace(torques[row], follows=torques[column].column)
    return found


def _positions(robot: Robot, index: int, record: Record, signals: ConditionedRecording) -> Iterator[str]:
    """Yield sentences on motors behind springs that do not follow their joint."""
    stride = signals.filter.stride
    actuator, q = robot.joints[index].actuator, signals.q[::stride]
    for motor, follows in enumerate(actuator.has_columns(VARIABLES["phi"])[: actuator.motor_count]):
        theta = signals.theta[::stride, index, motor]
        own = float(np.var(theta - q[:, index]))
        name, joint = (
            record.columns[place] for place in ((MOTOR, index, MOTORS[motor]), (POSITION, index, None))
        )
        if not follows:
            continue
        for words, gain in ODD_GAINS.items():
            if _follows(theta / gain, q[:, index], own / gain**2):
                yield f"columns {name!r} and {joint!r} {words}"
        scaled = _least_variance(theta, q[:, index])  # joints that move alike cannot be told apart
        for other in range(q.shape[1]):
            if other != index and _follows(theta, q[:, other], scaled):
                listed = f"{record.columns[POSITION, other, None]!r}, not {joint!r}"
                yield f"column {name!r} follows {listed}: columns look exchanged"


def _follows(theta: FloatArray, q: FloatArray, own: float) -> bool:
    """Return whether a motor follows a joint much better than with the variance `own`."""
    about = float(np.var(theta - q))
    return about < FOLLOWS_BETTER * own and about < FOLLOWS * float(np.var(q))


def _least_variance(theta: FloatArray, q: FloatArray) -> float:
    """Return the least variance of the difference of a motor from a multiple of the motion of a joint."""
    (of_motor, common), (_, of_joint) = np.cov(theta, q, bias=True)
    return float(of_motor - common**2 / of_joint) if of_joint > 0 else float(of_motor)


def _torque_agreements(
    robot: Robot, index: int, record: Record, signals: ConditionedRecording
) -> Iterator[tuple[Agreement, float]]:
    """Yield the agreement of each motor's measured torque with its prediction, and the gear ratio."""
    system = MotorSystem(robot, index)
    equations = system.of_record(system.before, signals)
    joint = robot.joints[index]
    for motor, (name, of_joint) in enumerate(
        zip(motor_names(robot, index), joint.actuator.motors, strict=True)
    ):
        rows = equations.group == name
        computed, measured = equations.predicted[rows], equations.measured[rows]
        yield (
            _torque_agreement(
                record.columns[TORQUE, index, MOTORS[motor]],
                (joint.name, MOTORS[motor], VARIABLES[TORQUE].quantity.unit(joint.type)),
                signals.time[:: signals.filter.stride],
                computed,
                measured,
            ),
            math.nan if of_joint.gear_ratio is None else of_joint.gear_ratio,
        )


def _torque_agreement(
    column: str,
    whose: tuple[str, int, str],
    time: FloatArray,
    computed: FloatArray,
    measured: FloatArray,
) -> Agreement:
    joint, motor, unit = whose
    error = measured - computed
    offset, gain, correlation = straight_line(computed, measured)
    worst, rms = int(np.argmax(np.abs(error))), float(np.sqrt(np.mean(error**2)))
    return Agreement(
        column=column,
        variable=TORQUE,
        joint=joint,
        motor=motor,
        unit=unit,
        samples=len(error),
        rms=rms,
        share=rms / float(np.sqrt(np.mean(computed**2))),
        worst=float(error[worst]),
        worst_time=float(time[worst]),
        offset=offset,
        gain=gain,
        correlation=correlation,
        lag=math.nan,
        time=time,
        computed=computed,
        measured=measured,
        still="measured" if np.ptp(measured) < RESTING * np.ptp(computed) else None,
    )


def _branch_sentences(robot: Robot, index: int, signals: ConditionedRecording) -> Iterator[str]:
    """Yield a sentence if most deflections are on another branch than that of the robot."""
    actuator = robot.joints[index].actuator
    if not actuator.commanded or actuator.opposite_branch is None:
        return
    stride = signals.filter.stride
    q, theta = signals.q[::stride, index], signals.theta[::stride, index]
    unknowns = np.stack(actuator.unknowns(theta.T - q, theta.T))
    springs = actuator.springs(unknowns, q)
    on_branch = actuator.solve(springs.tau_e, springs.stiffness, q).deflections
    off = np.linalg.norm(on_branch - unknowns, axis=0) > ELSEWHERE * np.linalg.norm(unknowns, axis=0)
    if np.mean(off) > 1 / 2:
        yield (
            f"the springs of {robot.joint_names[index]} are deflected as on the branch "
            f"{actuator.opposite_branch}: the columns of motors 1 and 2 may be exchanged, or the branch in "
            "the robot file is the other"
        )


CERTAIN_DELAY = 4.0
"""Delay in standard errors above which it is removed; at 2, one in twenty recordings would be shifted by
chance."""

WORTH_IT = 0.05
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
        size = abs(self.seconds)
        return size > CERTAIN_DELAY * self.standard_error and size * rate > WORTH_IT


def delay(found: Sequence[Solution], signals: ConditionedRecording) -> Delay:
    """Return the delay with which the equations of all systems hold best.

    Torques delayed by d are tau(t - d) = tau(t) - d tau'(t), so that d is a further unknown of each system.
    """
    rates = np.gradient(signals.tau_motor, 1 / signals.rate, axis=0)
    beside = signals._replace(tau_motor=rates, noise=None)
    identifiable = [
        each for system in found for each in _delay_of(system, signals._replace(noise=None), beside)
    ]
    values, errors = np.array([each for each in identifiable if np.isfinite(each).all()]).reshape(-1, 2).T
    if not len(values):
        return Delay(np.nan, np.nan)
    weights = 1 / errors**2
    late = Delay(float(weights @ values / weights.sum()), float(weights.sum() ** -0.5))
    # the expansion tells nothing of delays beyond a period of the highest frequency
    return late if abs(late.seconds) * signals.filter.bandwidth <= 1 else Delay(np.nan, np.nan)


def _delay_of(
    found: Solution, signals: ConditionedRecording, rates: ConditionedRecording
) -> Iterator[tuple[float, float]]:
    """Yield the delay and its standard error, unless the system has no equations."""
    equations, of_rates = found.equations(signals), found.equations(rates)
    if len(equations.measured):
        of_positions = found.equations(signals._replace(tau_motor=0 * rates.tau_motor))
        slopes = np.column_stack((equations.slopes, of_positions.measured - of_rates.measured))
        fit = least_squares([equations._replace(slopes=slopes)], np.append(found.predicting, 0.0))
        yield float(fit.values[-1]), float(fit.standard_errors[-1])


def without_delay(signals: ConditionedRecording, late: float) -> ConditionedRecording:
    """Return the recording with torques advanced by `late` seconds, while both were recorded."""
    spline = scipy.interpolate.make_interp_spline
    first, last = np.searchsorted(signals.time, (signals.time[0] - late, signals.time[-1] - late))
    covered = signals.during(slice(first, last))
    torques = covered.tau_motor.copy()
    there = np.isfinite(torques).all(axis=0)
    torques[:, there] = spline(signals.time, signals.tau_motor[:, there], k=3)(covered.time + late)
    return covered._replace(tau_motor=torques)


CERTAIN_FACTOR = 4.0
"""Difference of a factor from 1, or from another factor, in standard errors, that is significant."""

WITHIN = 3.0
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
    robot: Robot, joints: Sequence[int], motors: Sequence[Solution], signals: Sequence[ConditionedRecording]
) -> list[Gain]:
    """Return findings on joints whose parameters all differ from the file by one factor.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        motors: solutions, joint by joint.
        signals: conditioned recordings.
    """
    factors = {each.system.title: factor for each in motors if (factor := _common_factor(each, signals))}
    if not factors:
        return []
    by_links = _by_links(robot, joints, motors, signals)
    found = {each.system.title: each for each in motors}
    return [
        _said(found[name], factor, by_links.get(name), rotor=_rotor_differs(found[name]))
        for name, factor in factors.items()
    ]


def _common_factor(found: Solution, signals: Sequence[ConditionedRecording]) -> Factor | None:
    """Return the common factor of a joint's motor and spring parameters over those of the file, if any."""
    equations = [found.equations(each) for each in signals]
    slopes = np.concatenate([each.slopes[:, found.free] for each in equations])
    predicted = np.concatenate([each.predicted for each in equations])
    weight = np.concatenate([[1 / found.fit.residual_rms[name] for name in each.group] for each in equations])
    identifiable = np.flatnonzero(np.isfinite(found.fit.standard_errors))
    if not identifiable.size or found.fit.inseparable:
        return None
    split = independence(slopes * weight[:, None], SEPARABLE)
    share = split.q.T @ (predicted * weight)
    left = predicted * weight - split.q @ share
    if np.linalg.norm(left) > SEPARABLE * np.linalg.norm(share):
        return None  # other parameters contribute that a gain of the unknowns cannot change
    by_gain = np.zeros(slopes.shape[1])
    by_gain[split.kept] = np.linalg.solve(split.r, share) / split.scale[split.kept]
    return _fitted_factor(found, by_gain[identifiable], identifiable)


def _fitted_factor(found: Solution, by_gain: FloatArray, identifiable: IndexArray) -> Factor | None:
    """Return the factor that brings parameters nearest to the file, if they then agree with it."""
    of_file = found.system.before[list(found.free)][identifiable]
    difference = found.fit.values[identifiable] - of_file
    covariance = found.fit.covariance[np.ix_(identifiable, identifiable)]
    weighted = np.linalg.solve(covariance, np.column_stack((by_gain, difference)))
    information = float(by_gain @ weighted[:, 0])
    share, error = float(by_gain @ weighted[:, 1]) / information, information**-0.5
    rest = difference - share * by_gain
    off = float(rest @ np.linalg.solve(covariance, rest)) / max(len(identifiable) - 1, 1)
    factor = Factor(1 / (1 - share), error / (1 - share) ** 2)
    return factor if factor.differs(1.0) and off < WITHIN**2 else None


def _by_links(
    robot: Robot, joints: Sequence[int], motors: Sequence[Solution], signals: Sequence[ConditionedRecording]
) -> dict[str, Factor]:
    """Return the ratio of identified spring torque to that required by the links of the file, by joint."""
    system = link_system(robot, (), motors)
    if without_links(robot, joints, system, signals):
        return {}
    count = system.bodies
    equations = [system.equations(system.before, each) for each in signals]
    found = {}
    for each in motors:
        title = each.system.title
        own = [at for at, name in enumerate(system.names) if at >= count and name.split(".")[1] == title]
        of_link = [_of_link(one, f"link of {title}", system.before[:count], own) for one in equations]
        fit = least_squares(of_link, np.zeros(1 + len(own)))
        if np.isfinite(fit.standard_errors[0]):
            found[title] = Factor(float(fit.values[0]), float(fit.standard_errors[0]))
    return found


def _of_link(equations: Equations, group: str, base: FloatArray, own: Sequence[int]) -> Equations:
    """Return equations of a joint whose unknowns are the ratio to the link torque, and its resistance."""
    here = equations.group == group
    slopes = equations.slopes[here]
    assert equations.errors is not None, "as of links"
    return equations._replace(
        measured=equations.measured[here],
        predicted=np.zeros(int(here.sum())),
        slopes=np.column_stack((slopes[:, : len(base)] @ base, slopes[:, own])),
        group=equations.group[here],
        sample=equations.sample[here],
        errors=equations.errors[here],
        noise=None,
    )


def _rotor_differs(found: Solution) -> bool:
    """Return whether any motor parameter differs significantly from the file."""
    assert isinstance(found.system, MotorSystem), "of motors"
    return any(
        abs(found.fit.values[at] - found.system.before[number])
        > CERTAIN_FACTOR * found.fit.standard_errors[at]
        for at, number in enumerate(found.free)
        if group_of(found.system.sought[number]) == MOTORS_GROUP
    )


def _said(found: Solution, factor: Factor, by_links: Factor | None, *, rotor: bool) -> Gain:
    """Return the finding for a factor: torques or robot are wrong, as far as links or rotor decide it."""
    size = "large" if factor.value > 1 else "small"
    alike = f"{found.system.title}: the numbers found are {factor} times those of the file, all of them"
    carried = f"what springs carry by these numbers is {by_links} times what links as in the file need"
    if by_links and by_links.differs(1.0) and not by_links.differs(factor.value):
        return Gain(f"{alike}, and {carried}: the torques read too {size}", unreliable=True)
    if by_links and by_links.differs(factor.value) and not by_links.differs(1.0):
        return Gain(f"{alike}, but {carried}: it is springs and motors that differ", unreliable=False)
    beside = f"{carried}, which does not decide it" if by_links else "the links tell nothing of it"
    if rotor:
        reason = (
            "it is unlikely that a rotor and springs deviate by the same factor; torques that read too "
            "{size} explain it"
        )
        return Gain(f"{alike}: {reason.format(size=size)}; {beside}", unreliable=True)
    return Gain(f"{alike}: torques that read too {size} look the same; {beside}", unreliable=False)
