"""Records held against the robot: wrong units, turned signs, exchanged columns and motors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import FloatArray
from vsacli.base.variables import MOTORS, VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.motors.motor_equations import motor_equations, motor_names
from vsacli.studies.identification.records.record_columns import MOTOR, POSITION, TORQUE
from vsacli.studies.identification.records.records import Record
from vsacli.studies.identification.records.signals import Signals
from vsacli.studies.measured.agreement import Agreement, straight_line
from vsacli.studies.measured.exchange import exchanged
from vsacli.studies.measured.likeness import exactness
from vsacli.studies.measured.pairing import tame
from vsacli.studies.measured.slips import slips

ELSEWHERE = 0.5
"""Distance, over the size of the deflections, from which on they are on another branch."""

FOLLOWS_BETTER = 0.25
"""Variance of a motor about what it may follow, over that about its joint, below which it does follow it."""

FOLLOWS = 0.5
"""The same over the variance of what it follows."""

RESTING = 1e-3
"""Share of the predicted range below which a measured torque does not move."""

ODD_GAINS: Mapping[str, float] = MappingProxyType(
    {
        "run against each other: one has the wrong sign": -1.0,
        "look as if the first were in degrees, or the second marked so": 180 / math.pi,
        "look as if the second were in degrees, or the first marked so": math.pi / 180,
    }
)
"""Of a motor's motion over its joint's, by what they look like."""


def model_doubts(robot: Robot, joints: Sequence[int], record: Record, signals: Signals) -> Iterator[str]:
    """Sentences on what looks as if columns were not what their names say.

    Motors follow their joints, and torques what the robot file predicts, but for what is to be found.

    Args:
        robot: as its file has it.
        joints: indices of those that were recorded.
        record: as it was read.
        signals: the same, conditioned.
    """
    sprung = [index for index in joints if robot.joints[index].actuator.sprung]
    sprung = [index for index in sprung if (TORQUE, index, MOTORS[0]) in record.columns]
    torques = [each for index in sprung for each in _torques(robot, index, record, signals)]
    if torques:
        agreements, ratios = zip(*torques, strict=True)
        yield from slips(_followed(agreements), ratios)
    for index in sprung:
        yield from _positions(robot, index, record, signals)
        yield from _branch(robot, index, signals)


def _followed(torques: Sequence[Agreement]) -> list[Agreement]:
    """Torques with the columns whose predictions they follow, where columns look exchanged."""
    found, units = list(torques), {torque.unit for torque in torques}
    if len(units) > 1 or len({torque.samples for torque in torques}) > 1:
        return found
    exact = [exactness(tame(torque.measured)) for torque in torques]
    predicted = [torque.computed for torque in torques]
    for row, column in exchanged([torque.measured for torque in torques], exact, lambda _row: predicted):
        found[row] = replace(torques[row], follows=torques[column].column)
    return found


def _positions(robot: Robot, index: int, record: Record, signals: Signals) -> Iterator[str]:
    """Motors behind springs that follow something else than their joint."""
    stride = signals.filter.stride
    actuator, q = robot.joints[index].actuator, signals.q[::stride]
    for motor, follows in enumerate(actuator.has(VARIABLES["phi"])[: actuator.motor_count]):
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
        for other in range(q.shape[1]):
            if other != index and _follows(theta, q[:, other], own):
                listed = f"{record.columns[POSITION, other, None]!r}, not {joint!r}"
                yield f"column {name!r} follows {listed}: columns look exchanged"


def _follows(theta: FloatArray, q: FloatArray, own: float) -> bool:
    """Whether a motor follows a joint, and much better than its own, about which its variance is given."""
    about = float(np.var(theta - q))
    return about < FOLLOWS_BETTER * own and about < FOLLOWS * float(np.var(q))


def _torques(robot: Robot, index: int, record: Record, signals: Signals) -> Iterator[tuple[Agreement, float]]:
    """Torques as measured beside those that the robot file predicts, and the gear ratio."""
    equations = motor_equations(robot, index, (), np.array([]), signals)
    joint = robot.joints[index]
    for motor, (name, of_joint) in enumerate(
        zip(motor_names(robot, index), joint.actuator.motors, strict=True)
    ):
        rows = equations.group == name
        computed, measured = equations.predicted[rows], equations.measured[rows]
        yield (
            _agreement(
                record.columns[TORQUE, index, MOTORS[motor]],
                (joint.name, MOTORS[motor], VARIABLES[TORQUE].quantity.unit(joint.type)),
                signals.time[:: signals.filter.stride],
                computed,
                measured,
            ),
            math.nan if of_joint.gear_ratio is None else of_joint.gear_ratio,
        )


def _agreement(
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


def _branch(robot: Robot, index: int, signals: Signals) -> Iterator[str]:
    """Deflections that carry what they do on another branch than that of the preload."""
    actuator = robot.joints[index].actuator
    if not actuator.commanded or actuator.opposite_preload is None:
        return
    stride = signals.filter.stride
    q, theta = signals.q[::stride, index], signals.theta[::stride, index]
    phi = Drivetrain([actuator]).deflections(q[:, None], theta).T
    carried = actuator.carried({"q": q, "theta": theta.T, "phi": phi})
    on_branch = actuator.solve(carried.tau_e, carried.stiffness, q).deflections
    off = np.linalg.norm(on_branch - phi, axis=0) > ELSEWHERE * np.linalg.norm(phi, axis=0)
    if np.mean(off) > 1 / 2:
        yield (
            f"the springs of {robot.joint_names[index]} are deflected as with the preload "
            f"{actuator.opposite_preload}: the columns of motors 1 and 2 may be exchanged, or the preload in "
            "the robot file is the other"
        )
