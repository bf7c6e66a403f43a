"""Forward dynamics: accelerations from motor torques, (5), for any mixture of actuators."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import BoolArray, FloatArray, checked_shape
from vsacli.base.errors import InputError, check_type
from vsacli.base.signals import DAMPING
from vsacli.base.wrench import Wrench, WrenchFrame, check_wrench
from vsacli.compute.engine import KEPT_PROGRAMS
from vsacli.compute.vector import add
from vsacli.dynamics.dampers import Dampers
from vsacli.dynamics.dry_friction import Response, response_with_friction
from vsacli.dynamics.rigid_body import link_dynamics
from vsacli.robot.model import Robot, check_robot


@dataclass(frozen=True)
class State:
    """Full state of a robot, at one instant or over samples; SI units.

    Attributes:
        q, dq: Position and velocity of the joints, ([samples,] joints).
        theta, dtheta: Position and velocity of the motors, joint side of the gear, ([samples,] joints, 2);
            ignored where there is no motor, and at a rigid drive, whose motor moves with the joint.
    """

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray


class Rates(NamedTuple):
    """Time derivatives of the four parts of a `State`, of the same shapes; NaN where there is no motor."""

    dq: FloatArray
    ddq: FloatArray
    dtheta: FloatArray
    ddtheta: FloatArray


def mass_matrix(robot: Robot, q: npt.ArrayLike) -> FloatArray:
    """Compute the mass matrix M(q) of the links, without rotors, ([samples,] joints, joints).

    Args:
        robot: Robot.
        q: Joint positions, ([samples,] joints), rad (m).

    Raises:
        InputError: The shape of q does not fit the robot.
        TypeError: Robot is of another type.
    """
    check_robot(robot)
    return link_dynamics(robot).mass_matrix(checked_shape("q", q, len(robot.joints)))


def state_derivative(
    robot: Robot,
    state: State,
    tau_motor: npt.ArrayLike,
    wrench: Wrench | None = None,
    *,
    damping: npt.ArrayLike | None = None,
) -> Rates:
    """Compute the time derivative of the full state under motor torques: (5) solved for q'' and theta''.

    A motor at rest stays at rest as long as its sharp dry friction (width 0) can hold it.

    Args:
        robot: Robot.
        state: State of the robot, at one instant or over samples.
        tau_motor: Torque of each motor, ([samples,] joints, 2), N m (N), joint side of the gear.
        wrench: Wrench of the environment on the tools, see `Wrench`; zero if None.
        damping: Damping of the dampers, ([samples,] joints); their minimum if None.

    Raises:
        InputError: Shapes do not fit, or the mass matrix is not positive definite.
        TypeError: Robot or state is of another type.
    """
    check_robot(robot)
    if wrench is not None:
        check_wrench(wrench, robot.tool_names)
    plant = plant_of(robot, None if wrench is None else wrench.frame)
    q, dq, theta, dtheta = plant.unpack_state(state)
    torque = plant.drivetrain.of_motors(checked_shape("tau_motor", tau_motor, len(robot.joints), 2))
    minima = [joint.damper.range[0] if joint.damper else 0.0 for joint in robot.joints]
    commanded = {name: np.zeros_like(q) for name in DAMPING.names}
    commanded[DAMPING.key] = checked_shape(
        DAMPING.key, np.broadcast_to(minima, q.shape) if damping is None else damping, len(robot.joints)
    )
    ddq, ddtheta, _ = plant.accelerations(q, dq, theta, dtheta, torque, wrench, commanded)
    merge_by_joint = plant.drivetrain.of_motors_by_joint
    return Rates(dq, ddq, merge_by_joint(dtheta, dq), merge_by_joint(ddtheta, ddq))


@lru_cache(KEPT_PROGRAMS)
def plant_of(robot: Robot, frame: WrenchFrame | None = None) -> Plant:
    """Return the plant of a robot, prepared once for many calls; see `Plant`.

    Prepared for each call, `state_derivative` of a 7R takes 3 times as long.
    """
    return Plant(robot, frame)


class Plant:
    """A robot prepared for fast evaluation of its equations of motion.

    Args:
        robot: Robot.
        frame: Frame of the wrench on the tools; None without a wrench.

    Attributes:
        links: Links and joints.
        drivetrain: Motors and springs.
        dampers: Dampers with commanded damping.
    """

    def __init__(self, robot: Robot, frame: WrenchFrame | None = None) -> None:
        self.drivetrain = Drivetrain(robot.actuators)
        self.links = link_dynamics(robot, frame)
        self.dampers = Dampers(robot, self.drivetrain)
        self._rigid_inertia = self.drivetrain.of_rigid_joints(self.drivetrain.inertia)
        self._rigid_matrix = np.diag(self._rigid_inertia)
        self._rigid_damping = self.drivetrain.of_rigid_joints(self.drivetrain.damping)
        self._sprung_damping = self.drivetrain.damping[self.drivetrain.sprung]

    def unpack_state(self, state: State) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return q, q' of the joints and theta, theta' of the motors with springs.

        Raises:
            InputError: a part of the state has a shape that does not fit the robot.
            TypeError: State is of another type.
        """
        check_type("state", state, State, "make one by State(q, dq, theta, dtheta)")
        joints = len(self.drivetrain.present)
        q, dq = checked_shape("q", state.q, joints), checked_shape("dq", state.dq, joints)
        sprung = self.drivetrain.sprung
        theta, dtheta = (
            self.drivetrain.of_motors(checked_shape(name, values, joints, 2))[..., sprung]
            for name, values in (("theta", state.theta), ("dtheta", state.dtheta))
        )
        if len({array.shape[:-1] for array in (q, dq, theta, dtheta)}) > 1:
            raise InputError.one("q, dq, theta, dtheta must have the same number of samples")
        return q, dq, theta, dtheta

    def accelerations(
        self,
        q: FloatArray,
        dq: FloatArray,
        theta: FloatArray,
        dtheta: FloatArray,
        torque: FloatArray,
        wrench: Wrench | None,
        commanded: Mapping[str, FloatArray],
        slip: FloatArray | None = None,
    ) -> Response:
        """Compute the accelerations of the joints and of the motors with springs, by (5).

        A motor with sharp friction at rest stays at rest as long as its friction can hold it.

        Args:
            q: Position of the joints, (..., joints).
            dq: Velocity of the joints.
            theta: Position of the motors with springs, (..., springs).
            dtheta: Velocity of the motors with springs.
            torque: Torques of all motors, (..., motors).
            wrench: Wrench of the environment, if the plant was made for one.
            commanded: Damping, by name, (..., joints); counts if there are dampers.
            slip: Direction in which each motor with sharp friction slides, 0 while it is held, (motors,).
                If None, a motor at rest is held as long as its friction suffices.
        """
        tau_e, spring = self.drivetrain.torques(q, theta)
        damper = self.dampers.parallel_torques(commanded, dq, dtheta)
        resistance = add(self.links.bias(q, dq, wrench), self.dampers.link_damper_torques(commanded, dq).tau)
        matrix = self.links.mass_matrix(q) + self._rigid_matrix
        laws, velocity = self.drivetrain.friction, self.drivetrain.of_all_motors(dq, dtheta)

        def accelerate(
            torque: FloatArray, held: BoolArray | None
        ) -> tuple[FloatArray, FloatArray, FloatArray]:
            applied = add(tau_e, damper.links) + self.drivetrain.of_rigid_joints(torque)
            joint_torque = applied - resistance - self._rigid_damping * dq  # (5a)
            motor_drive = torque[..., self.drivetrain.sprung] - self._sprung_damping * dtheta
            motor_torque = motor_drive - add(spring, damper.motors)  # (5b), (5c)
            return self._solve_accelerations(matrix, joint_torque, motor_torque, held)

        if laws is None:
            ddq, ddtheta, _ = accelerate(torque, None)
            return Response(ddq, ddtheta, None)
        return response_with_friction(laws, torque, velocity, slip, accelerate)

    def _solve_accelerations(
        self, matrix: FloatArray, joint_torque: FloatArray, motor_torque: FloatArray, held: BoolArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return accelerations under torques on joints and on motors with springs; see `AccelerationLaw`."""
        rotors = self.drivetrain.rotors
        if held is None or not held.any():
            no_holding = np.zeros((*motor_torque.shape[:-1], len(self.drivetrain.joint)))
            return self.links.solve(matrix, joint_torque), rotors.accelerations(motor_torque), no_holding
        held_joints = self.drivetrain.of_rigid_joints(held.astype(np.float64)) > 0
        decoupled = held_joints[..., :, None] | held_joints[..., None, :]
        free_matrix = np.where(decoupled, np.eye(joint_torque.shape[-1]), matrix)
        ddq = self.links.solve(free_matrix, np.where(held_joints, 0.0, joint_torque))
        holding_joints = joint_torque - (matrix @ ddq[..., None])[..., 0]
        ddtheta, holding_motors = rotors.accelerations_with_held(
            motor_torque, held[..., self.drivetrain.sprung]
        )
        holding = self.drivetrain.of_all_motors(holding_joints, holding_motors)
        return ddq, ddtheta, np.where(held, holding, 0.0)

    def link_torque(
        self, dq: FloatArray, ddq: FloatArray, tau_e: FloatArray, torque: FloatArray
    ) -> FloatArray:
        """Return tau_e (6), (..., joints); for a rigid drive the motor torque minus that of its own rotor.

        Args:
            dq: Velocity of the joints, (..., joints).
            ddq: Acceleration of the joints.
            tau_e: Torques of the springs, (..., joints), 0 where there are none.
            torque: Torques of all motors minus their dry friction, (..., motors).
        """
        rotor_torque = self._rigid_inertia * ddq + self._rigid_damping * dq
        return tau_e + self.drivetrain.of_rigid_joints(torque) - rotor_torque
