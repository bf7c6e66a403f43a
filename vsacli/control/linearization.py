"""Feedback linearization, sections III-C and IV-C of the paper: (32)-(35), (60), (69)-(74).

The decoupling matrices relate motor torques to the highest derivatives of position and stiffness; the control
law inverts them in the measured state, without root finding. Robots without springs have the computed torque
(3) instead. `FeedbackLinearization` selects the law for a robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import DrivetrainState
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, check_type
from vsacli.base.signals import STIFFNESS
from vsacli.base.wrench import Wrench, WrenchFrame
from vsacli.compute.vector import add
from vsacli.control.gains import POSITION_ORDER, RIGID_ORDER, Gains, Integral, linear_control
from vsacli.dynamics.forward import Plant, State
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.trajectory import Motion


class LinkMotion(NamedTuple):
    """Elastic torque, motion of the links, and stiffness at a state, each ([samples,] joints).

    The stiffness of an elastic joint is that of its spring.
    """

    tau_e: FloatArray
    dtau_e: FloatArray
    ddq: FloatArray
    d3q: FloatArray
    stiffness: FloatArray
    dstiffness: FloatArray


class Decoupling:
    """The control law for a robot all of whose motors act through springs.

    States have no entries for absent motors, as in `Plant`.
    """

    def __init__(self, plant: Plant, gains: Gains) -> None:
        self._plant = plant
        self._gains = gains

    def torque(
        self,
        q: FloatArray,
        dq: FloatArray,
        theta: FloatArray,
        dtheta: FloatArray,
        reference: Motion,
        integral: Integral,
        slip: FloatArray | None = None,
    ) -> FloatArray:
        """Return motor torques, (..., motors); NaN at a joint whose A is singular.

        Friction is compensated by the velocities of the motors. Sharp friction is compensated by the
        direction `slip`, (motors,), if given, and not at all at rest.
        """
        drivetrain = self._plant.drivetrain
        springs = drivetrain.state(q, theta, dq, dtheta)
        link = self._link_motion(q, dq, springs, reference.wrench, reference.commanded)
        v_q = linear_control(  # (32a)
            (reference.q, reference.dq, reference.ddq, reference.d3q, reference.d4q),
            (q, dq, link.ddq, link.d3q),
            self._gains.position, self._gains.position_integral, integral.q,
        )  # fmt: skip
        v_sigma = linear_control(  # (32b)
            tuple(reference.commanded[name] for name in STIFFNESS.names),
            (link.stiffness, link.dstiffness),
            self._gains.stiffness, self._gains.stiffness_integral, integral.stiffness,
        )  # fmt: skip
        ddtau_e = self._plant.links.torque_acceleration(  # (60)
            q, dq, link.ddq, link.d3q, v_q, reference.wrench
        )
        dampers = self._plant.dampers.link_damper_torques(reference.commanded, dq, link.ddq, link.d3q)
        ddtau_e = add(ddtau_e, dampers.ddtau)
        ddtheta = springs.motor_accelerations(link.ddq, ddtau_e, v_sigma)
        rotor_torque = drivetrain.rotors.torques(ddtheta)
        torque = rotor_torque + drivetrain.damping * dtheta + springs.tau_transmission  # (73)-(74)
        friction = drivetrain.friction
        return torque if friction is None else torque + friction.torque(dtheta, slip)

    def link_motion(
        self,
        q: FloatArray,
        dq: FloatArray,
        theta: FloatArray,
        dtheta: FloatArray,
        wrench: Wrench | None,
        commanded: Mapping[str, FloatArray] = MappingProxyType({}),
    ) -> LinkMotion:
        """Return the motion of the links at a state, under a wrench and with commanded damping."""
        return self._link_motion(q, dq, self._plant.drivetrain.state(q, theta, dq, dtheta), wrench, commanded)

    def _link_motion(
        self,
        q: FloatArray,
        dq: FloatArray,
        springs: DrivetrainState,
        wrench: Wrench | None,
        commanded: Mapping[str, FloatArray],
    ) -> LinkMotion:
        links, tau_e, dtau_e = self._plant.links, springs.tau_e, springs.dtau_e
        matrix = links.mass_matrix(q)
        dampers = self._plant.dampers
        bias = add(links.bias(q, dq, wrench), dampers.link_damper_torques(commanded, dq).tau)
        ddq = links.solve(matrix, tau_e - bias)  # (34)
        rate = add(
            links.torque_rate(q, dq, ddq, wrench), dampers.link_damper_torques(commanded, dq, ddq).dtau
        )
        d3q = links.solve(matrix, dtau_e - rate)  # (35)
        return LinkMotion(tau_e, dtau_e, ddq, d3q, springs.stiffness, springs.dstiffness)


class ComputedTorque:
    """The control law for a robot all of whose motors move their links directly."""

    def __init__(self, plant: Plant, gains: Gains) -> None:
        self._plant = plant
        self._gains = gains

    def torque(
        self,
        q: FloatArray,
        dq: FloatArray,
        _theta: FloatArray,
        _dtheta: FloatArray,
        reference: Motion,
        integral: Integral,
        slip: FloatArray | None = None,
    ) -> FloatArray:
        """Return (M + B) v + n + Dm q' + friction, (..., motors); for `slip` see `Decoupling.torque`."""
        v_q = linear_control(
            (reference.q, reference.dq, reference.ddq),
            (q, dq),
            self._gains.position, self._gains.position_integral, integral.q,
        )  # fmt: skip
        links, drivetrain = self._plant.links, self._plant.drivetrain
        motor_torque = (links.mass_matrix(q) @ v_q[..., None])[..., 0] + links.bias(q, dq, reference.wrench)
        motor_torque += drivetrain.inertia * v_q + drivetrain.damping * dq
        friction = drivetrain.friction
        return motor_torque if friction is None else motor_torque + friction.torque(dq, slip)


def feedback_linearization(
    robot: Robot, state: State, reference: Motion, gains: Gains, integral: Integral | None = None
) -> FloatArray:
    """Return the motor torques that make the errors obey the linear dynamics (33), as long as A is regular.

    In a control loop use a `FeedbackLinearization`, which prepares the robot only once. Dry friction of
    motors is added at their velocities. Friction without a width is undefined at rest, and left out there.

    Args:
        robot: robot. Either all of its joints have springs, of any kinds, or none has; the latter gives the
            computed torque (3).
        state: measured state, at one instant or over samples.
        reference: commanded motion and stiffness, arrays ([samples,] joints), and the wrench that acts.
        gains: gains of the linear control (32).
        integral: time integrals of the errors, for gains with integral action; zero if None.

    Returns:
        tau_motor, ([samples,] joints, 2), N m (N), joint side of the gear; NaN where there is no motor, and
        at a joint whose A is singular.

    Raises:
        InputError: the robot mixes rigid joints with others, the gains do not fit it, or shapes are wrong.
        TypeError: an argument is of another type.
    """
    check_type("reference", reference, Motion, "trajectory.at(time) gives one")
    frame = None if reference.wrench is None else reference.wrench.frame
    return FeedbackLinearization(robot, gains, frame)(state, reference, integral)


class FeedbackLinearization:
    """The control law for a robot, gains, and the frame of the wrench that acts on it (None without one).

    Attributes:
        plant: model of the robot that the law uses.
        law: law for the torques of the motors of `plant`.
    """

    def __init__(self, robot: Robot, gains: Gains, frame: WrenchFrame | None = None) -> None:
        check_robot(robot)
        check_type("gains", gains, Gains, "Gains.from_poles([-20] * 4) makes some")
        self.plant = Plant(robot, frame)
        gains.check_fit(len(robot.joints), position_order(robot, self.plant))
        self.law = control_law(self.plant, gains)

    def __call__(self, state: State, reference: Motion, integral: Integral | None = None) -> FloatArray:
        """Return motor torques, ([samples,] joints, 2), N m (N); see `feedback_linearization`.

        The first call for a robot traces its links: 0.3 s with seven joints.
        """
        unpacked_state = self.plant.unpack_state(state)
        zero = np.zeros_like(unpacked_state[0])
        torque = self.law.torque(*unpacked_state, reference, integral or Integral(zero, zero))
        return self.plant.drivetrain.of_joints(torque)


def position_order(robot: Robot, plant: Plant) -> int:
    """Return the order of the error dynamics (33a) of a robot's position.

    Raises:
        InputError: the robot mixes rigid joints with others, or has a damped transmission; no law exists.
    """
    sprung = plant.drivetrain.sprung
    damped = [joint.name for joint in robot.joints if joint.damper_at("transmission")]
    if damped:
        raise InputError.one(
            "feedback linearization sets the fourth derivative of each joint, but motors act on the third "
            f"where a damper lies parallel to the springs ({', '.join(damped)}); use feedforward"
        )
    if sprung.any() and not sprung.all():
        raise InputError.one(_mixed_drives_text(robot, plant))
    return POSITION_ORDER if sprung.all() else RIGID_ORDER


def control_law(plant: Plant, gains: Gains) -> Decoupling | ComputedTorque:
    """Return the law for a robot whose joints all have springs, or none has."""
    return Decoupling(plant, gains) if plant.drivetrain.sprung.all() else ComputedTorque(plant, gains)


def _mixed_drives_text(robot: Robot, plant: Plant) -> str:
    drivetrain = plant.drivetrain
    rigid, sprung = (
        list(dict.fromkeys(robot.joint_names[joint] for joint in drivetrain.joint[mask]))
        for mask in (~drivetrain.sprung, drivetrain.sprung)
    )
    return (
        f"feedback linearization needs springs at all joints or at none: {_names_are(rigid)} rigid, "
        f"{_names_are(sprung)} not; give rigid joints an elastic actuator, or use the controller feedforward"
    )


def _names_are(names: list[str]) -> str:
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'}"
