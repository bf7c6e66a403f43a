"""Standard deviations of the motor torques of a fitted robot, from the covariance of its parameters.

The torques are those of inverse dynamics along the recorded motion with the stiffness found there, and their
derivatives by parameters are those of sensitivities. Links change torques only through base parameters, each
of which has the derivative by its first parameter.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.variables import VARIABLES
from vsacli.compute.duals import value_of
from vsacli.robot.model import Robot
from vsacli.robot.parameters import JOINTS, parameters
from vsacli.studies.identification.conditioning import ConditionedRecording, spline_derivatives
from vsacli.studies.identification.fitted_system import Solution, SystemOfEquations
from vsacli.studies.identification.identified_values import TorqueDeviation
from vsacli.studies.identification.link_equations import LinkSystem
from vsacli.studies.identification.motor_equations import MotorSystem, joint_motion, motor_names
from vsacli.studies.identification.recorded_columns import TORQUE
from vsacli.studies.identification.regressor import SYMBOLS, TENSOR, derivatives_by_file
from vsacli.studies.sensitivities.slopes import derivatives_of
from vsacli.trajectory.motion import Motion

SAMPLES = 200
"""Samples of each recording at which torques are compared: ten per period of its fastest motion, or more."""

OF_LINK = ("mass", *(f"com.{axis}" for axis in range(3)), *(f"inertia.{entry}" for entry in TENSOR))
"""Ends of the paths of a link's parameters, in the order of `derivatives_by_file`."""


def torque_deviations(
    robot: Robot, found: Sequence[Solution], records: Sequence[ConditionedRecording]
) -> tuple[TorqueDeviation, ...]:
    """Return the largest standard deviations of each motor's torque, along the recordings and elsewhere.

    There is none unless the positions of all joints, and those of motors that set a stiffness, were recorded.

    Args:
        robot: fitted robot.
        found: solutions of the equations, which have the covariances.
        records: conditioned recordings.
    """
    settable = [STIFFNESS.key in actuator.commanded for actuator in robot.actuators]
    positions = [part for each in records for part in (each.q, each.theta[:, settable])]
    massless = any(joint.link.mass == 0 for joint in robot.joints)
    if massless or any(joint.damper for joint in robot.joints) or any(np.isnan(e).any() for e in positions):
        return ()
    motions = [_recorded_motion(robot, each) for each in records]
    torque, deviation = _largest_deviations(robot, found, motions)
    _, elsewhere = _largest_deviations(robot, found, map(_recombined, motions))
    return tuple(
        TorqueDeviation(name, VARIABLES[TORQUE].quantity.unit(joint.type), *map(float, of_motor))
        for joint, *of_joint in zip(robot.joints, torque, deviation, elsewhere, strict=True)
        for name, *of_motor in zip(motor_names(robot, robot.joints.index(joint)), *of_joint, strict=False)
    )


def _recorded_motion(robot: Robot, signals: ConditionedRecording) -> Motion:
    """Return the motion of a recording with its stiffness."""
    stiffness = np.full_like(signals.q, np.nan)
    for index, actuator in enumerate(robot.actuators):
        if STIFFNESS.key in actuator.commanded:
            stiffness[:, index] = value_of(actuator.springs_of(joint_motion(signals, index)).stiffness)
    of_time = (
        *(signals.time, signals.q, signals.dq, signals.ddq, *spline_derivatives(signals.time, signals.ddq)),
        *(stiffness, *spline_derivatives(signals.time, stiffness)),
    )
    every = max(1, len(signals.time) // SAMPLES)
    time, q, dq, ddq, d3q, d4q, *of_stiffness = (each[::every] for each in of_time)
    return Motion(time, q, dq, ddq, d3q, d4q, dict(zip(STIFFNESS.names, of_stiffness, strict=True)))


def _recombined(motion: Motion) -> Motion:
    """Return a motion with positions, velocities, and so on, that occur in another one at other times."""
    random = np.random.default_rng(0)
    shuffled = {name: random.permuted(each, axis=0) for name, each in motion.of_joints.items()}
    return Motion.of(motion.time, shuffled)


def _largest_deviations(
    robot: Robot, found: Sequence[Solution], motions: Iterable[Motion]
) -> tuple[FloatArray, FloatArray]:
    """Return the largest motor torques and their largest standard deviations, (joints, 2)."""
    weights = [[_by_file(robot, each.system, number) for number in each.free] for each in found]
    chosen = parameters(robot, list({path: None for each in weights for one in each for path in one}))
    place = {str(each): at for at, each in enumerate(chosen)}
    sizes, deviations = [], []
    for motion in motions:
        part = derivatives_of(robot, motion, chosen)
        slopes = np.moveaxis(part.over_time(TORQUE), 1, 0)  # (parameters, samples, joints, 2)
        variance = np.zeros(slopes.shape[1:])
        for solution, of_system in zip(found, weights, strict=True):
            own = np.array([sum(w * slopes[place[path]] for path, w in one.items()) for one in of_system])
            variance += np.einsum("f...,fg,g...->...", own, solution.fit.covariance, own)
        sizes.append(np.abs(part.block.tau_motor))
        deviations.append(np.sqrt(variance))
    torque, deviation = (np.fmax.reduce(np.concatenate(each)) for each in (sizes, deviations))
    return torque, deviation


def _by_file(robot: Robot, system: SystemOfEquations, number: int) -> dict[str, float]:
    """Return the derivatives of parameters of the file, by path, by an unknown of a system."""
    if isinstance(system, MotorSystem):
        return {str(system.sought[number]): 1.0}
    assert isinstance(system, LinkSystem), "of motors or links"
    if number >= system.bodies:
        return {str(system.part(number)): 1.0}
    index, symbol = divmod(int(system.base.kept[number]), len(SYMBOLS))
    joint = robot.joints[index]
    weights = np.linalg.inv(derivatives_by_file(joint.link))[:, symbol]
    paths = (f"{JOINTS}.{joint.name}.link.{end}" for end in OF_LINK)
    return {path: float(weight) for path, weight in zip(paths, weights, strict=True) if weight}
