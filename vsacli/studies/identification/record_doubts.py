"""Records held against the robot: wrong units, turned signs, exchanged columns and motors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import FloatArray
from vsacli.base.variables import MOTORS, VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.motor_equations import motor_equations, motor_names
from vsacli.studies.identification.record_columns import MOTOR, POSITION, TORQUE
from vsacli.studies.identification.records import Record
from vsacli.studies.identification.signals import Signals
from vsacli.studies.measured.agreement import Agreement, straight_line
from vsacli.studies.measured.slips import slips

ELSEWHERE = 0.5
"""Distance, over the size of the deflections, from which on they are on another branch."""


def model_doubts(robot: Robot, joints: Sequence[int], record: Record, signals: Signals) -> Iterator[str]:
    """Sentences on what looks as if columns were not what their names say.

    Motors follow their joints, and torques what the robot file predicts, but for what is to be found.

    Args:
        robot: as its file has it.
        joints: indices of those that were recorded.
        record: as it was read.
        signals: the same, conditioned.
    """
    agreements, ratios = [], []
    for index in joints:
        for agreement, motor in (
            *_positions(robot, index, record, signals),
            *_torques(robot, index, record, signals),
        ):
            agreements.append(agreement)
            ratio = robot.joints[index].actuator.motors[motor].gear_ratio
            ratios.append(np.nan if ratio is None else ratio)
    yield from slips(agreements, ratios)
    for index in joints:
        yield from _branch(robot, index, signals)


def _positions(robot: Robot, index: int, record: Record, signals: Signals) -> Iterator[tuple[Agreement, int]]:
    """Motors behind springs beside their joint."""
    actuator = robot.joints[index].actuator
    follows = actuator.has(VARIABLES["phi"]) if actuator.sprung else []
    for motor, there in enumerate(follows):
        if there:
            arrays = signals.q[:, index], signals.theta[:, index, motor]
            yield _agreement(robot, index, motor, MOTOR, record, signals, *arrays), motor


def _torques(robot: Robot, index: int, record: Record, signals: Signals) -> Iterator[tuple[Agreement, int]]:
    """Torques as measured beside those that the robot file predicts."""
    if not robot.joints[index].actuator.sprung:
        return
    equations = motor_equations(robot, index, (), np.array([]), signals)
    for motor, name in enumerate(motor_names(robot, index)):
        rows = equations.group == name
        arrays = equations.predicted[rows], equations.measured[rows]
        yield _agreement(robot, index, motor, TORQUE, record, signals, *arrays), motor


def _agreement(
    robot: Robot,
    index: int,
    motor: int,
    variable: str,
    record: Record,
    signals: Signals,
    computed: FloatArray,
    measured: FloatArray,
) -> Agreement:
    joint, error = robot.joints[index], measured - computed
    offset, gain, correlation = straight_line(computed, measured)
    worst = int(np.argmax(np.abs(error)))
    size = float(np.sqrt(np.mean(error**2)))
    return Agreement(
        column=record.columns.get((variable, index, MOTORS[motor]), f"{joint.name}.{POSITION}"),
        variable=variable,
        joint=joint.name,
        motor=MOTORS[motor],
        unit=VARIABLES[variable].quantity.unit(joint.type),
        samples=len(error),
        rms=size,
        share=size / float(np.sqrt(np.mean(computed**2))),
        worst=float(error[worst]),
        worst_time=float(signals.time[0]),
        offset=offset,
        gain=gain,
        correlation=correlation,
        lag=np.nan,
        time=signals.time,
        computed=computed,
        measured=measured,
    )


def _branch(robot: Robot, index: int, signals: Signals) -> Iterator[str]:
    """Deflections that carry what they do on another branch than that of the preload."""
    actuator = robot.joints[index].actuator
    if not actuator.commanded or actuator.opposite_preload is None:
        return
    q, theta = (signals.filter.applied(each[:, index]) for each in (signals.q, signals.theta))
    drivetrain = Drivetrain([actuator])
    phi = drivetrain.deflections(q[:, None], theta).T
    carried = actuator.carried({"q": q, "theta": theta.T, "phi": phi})
    on_branch = actuator.solve(carried.tau_e, carried.stiffness, q).deflections
    off = np.linalg.norm(on_branch - phi, axis=0) > ELSEWHERE * np.linalg.norm(phi, axis=0)
    if np.mean(off) > 1 / 2:
        yield (
            f"the springs of {robot.joint_names[index]} are deflected as with the preload "
            f"{actuator.opposite_preload}: the columns of motors 1 and 2 may be exchanged, or the preload in "
            "the robot file is the other"
        )
