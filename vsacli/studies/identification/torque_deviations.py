"""Standard deviations of the motor torques of a fitted robot, from the covariance of its parameters.

The torques are those of inverse dynamics along the recorded motion with the stiffness found there, and their
derivatives by parameters are those of sensitivities. Links change torques only through base parameters, each of
which has the derivative by its first parameter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.variables import VARIABLES
from vsacli.compute.duals import value_of
from vsacli.robot.model import Robot
from vsacli.robot.parameters import JOINTS, parameters
from vsacli.studies.identification.conditioning import Signals
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.identified_values import TorqueDeviation
from vsacli.studies.identification.link_equations import LinkSystem
from vsacli.studies.identification.motor_equations import MotorSystem, joint_motion, motor_names
from vsacli.studies.identification.recorded_columns import TORQUE
from vsacli.studies.identification.regressor import SYMBOLS, TENSOR, derivatives_by_file
from vsacli.studies.sensitivities.slopes import derivatives_of
from vsacli.trajectory.motion import Motion

SAMPLES = 200
"""Samples of each recording at which torques are compared: ten per period of its fastest motion, or more."""

DEGREE = 5
"""Degree of the splines that give derivatives of accelerations and of the stiffness."""


def torque_deviations(
    robot: Robot, found: Sequence[Solution], records: Sequence[Signals]
) -> tuple[TorqueDeviation, ...]:
    """Return the largest standard deviations of each motor's torque, along the recordings and elsewhere.

    There is none unless the positions of all joints, and those of motors that set a stiffness, were recorded.

    Args:
        robot: fitted robot.
        found: solutions of the equations, which have the covariances.
        records: conditioned recordings.
    """
    massless = any(joint.link.mass == 0 for joint in robot.joints)
    if massless or any(joint.damper for joint in robot.joints) or not all(_complete(robot, each) for each in records):
        return ()
    motions = [_recorded_motion(robot, each) for each in records]
    torque, deviation = _largest(robot, found, motions)
    _, elsewhere = _largest(robot, found, map(_recombined, motions))
    return tuple(
        TorqueDeviation(
            motor=name,
            unit=VARIABLES[TORQUE].quantity.unit(joint.type),
            torque=float(torque[index, motor]),
            deviation=float(deviation[index, motor]),
            elsewhere=float(elsewhere[index, motor]),
        )
        for index, joint in enumerate(robot.joints)
        for motor, name in enumerate(motor_names(robot, index))
    )


def _complete(robot: Robot, signals: Signals) -> bool:
    """Return whether all positions that inverse dynamics depends on were recorded."""
    settable = [STIFFNESS.key in actuator.commanded for actuator in robot.actuators]
    return not (np.isnan(signals.q).any() or np.isnan(signals.theta[:, settable]).any())


def _recorded_motion(robot: Robot, signals: Signals) -> Motion:
    """Return the motion of a recording with its stiffness."""
    stiffness = np.full_like(signals.q, np.nan)
    for index, actuator in enumerate(robot.actuators):
        if STIFFNESS.key in actuator.commanded:
            stiffness[:, index] = value_of(actuator.carried(joint_motion(signals, index)).stiffness)
    of_time = (
        *(signals.time, signals.q, signals.dq, signals.ddq, *_derivatives(signals.time, signals.ddq)),
        *(stiffness, *_derivatives(signals.time, stiffness)),
    )
    every = max(1, len(signals.time) // SAMPLES)
    time, q, dq, ddq, d3q, d4q, *of_stiffness = (each[::every] for each in of_time)
    return Motion(time, q, dq, ddq, d3q, d4q, dict(zip(STIFFNESS.names, of_stiffness, strict=True)))


def _recombined(motion: Motion) -> Motion:
    """Return a motion with positions, velocities, and so on, that occur in another one at other times."""
    random = np.random.default_rng(0)
    shuffled = {name: random.permuted(each, axis=0) for name, each in motion.of_joints.items()}
    return Motion.of(motion.time, shuffled)


def _derivatives(time: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the first two derivatives of columns, (2, samples, columns); NaN of columns with NaN."""
    from scipy.interpolate import make_interp_spline

    there = np.isfinite(columns).all(axis=0)
    derivatives = np.full((2, *columns.shape), np.nan)
    if there.any():
        spline = make_interp_spline(time, columns[:, there], k=DEGREE)
        derivatives[:, :, there] = np.stack((spline(time, 1), spline(time, 2)))
    return derivatives


def _largest(
    robot: Robot, found: Sequence[Solution], motions: Iterable[Motion]
) -> tuple[FloatArray, FloatArray]:
    """Return the largest motor torques and their largest standard deviations, (joints, 2)."""
    paths = list(dict.fromkeys(path for each in found for path in _paths(robot, each)))
    sizes, deviations = [], []
    for motion in motions:
        part = derivatives_of(robot, motion, parameters(robot, paths))
        place = {str(each): at for at, each in enumerate(parameters(robot, paths))}
        slopes = np.moveaxis(part.over_time(TORQUE), 1, 0)  # (parameters, samples, joints, 2)
        variance = np.zeros(slopes.shape[1:])
        for each in found:
            own = np.stack(list(_slopes(robot, each, slopes, place)))
            variance += np.einsum("f...,fg,g...->...", own, each.fit.covariance, own)
        sizes.append(np.abs(part.block.tau_motor))
        deviations.append(np.sqrt(variance))
    with np.errstate(invalid="ignore"):
        torque, deviation = (np.fmax.reduce(np.concatenate(each)) for each in (sizes, deviations))
    return torque, deviation


def _of_link(name: str) -> list[str]:
    """Return the paths of the parameters of a link, in the order of `derivatives_by_file`."""
    words = ["mass", *(f"com.{axis}" for axis in range(3)), *(f"inertia.{entry}" for entry in TENSOR)]
    return [f"{JOINTS}.{name}.link.{word}" for word in words]


def _paths(robot: Robot, found: Solution) -> Iterator[str]:
    """Yield the paths of the parameters on which the unknowns of a system depend."""
    system = found.system
    if isinstance(system, MotorSystem):
        yield from map(str, system.sought)
    elif isinstance(system, LinkSystem):
        yield from map(str, system.parts)
        if system.bodies:
            yield from (path for name in robot.joint_names for path in _of_link(name))


def _slopes(
    robot: Robot, found: Solution, slopes: FloatArray, place: dict[str, int]
) -> Iterator[FloatArray]:
    """Yield the derivatives of torques by each free unknown of a system, (samples, joints, 2)."""
    system = found.system
    for number in found.free:
        if isinstance(system, MotorSystem):
            yield slopes[place[str(system.sought[number])]]
        elif isinstance(system, LinkSystem) and number >= system.bodies:
            yield slopes[place[str(system.part(number))]]
        elif isinstance(system, LinkSystem):
            index, symbol = divmod(int(system.base.kept[number]), len(SYMBOLS))
            of_file = slopes[[place[path] for path in _of_link(robot.joint_names[index])]]
            by_symbol = np.linalg.inv(derivatives_by_file(robot.joints[index].link))[:, symbol]
            yield np.tensordot(by_symbol, of_file, 1)
