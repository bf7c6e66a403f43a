"""A robot under a controller: control laws for the motor torques, and the equations of motion of both."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import AnyArray, FloatArray
from vsacli.base.flags import Flag
from vsacli.control.gains import Gains, Integral
from vsacli.control.linearization import FeedbackLinearization
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.tabulated import ConstantTable, Table, TabulatedReference
from vsacli.dynamics.dry_friction import Response
from vsacli.dynamics.forward import Plant
from vsacli.dynamics.internal_motion import internal_motions
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


class Phase(NamedTuple):
    """Full state: q, dq ([samples,] joints), theta, dtheta ([samples,] springs), integrals of the errors."""

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray
    integral: Integral


class Packing:
    """The layout of a `Phase` in a vector.

    Attributes:
        entries: number of entries of the vector.
        motor_velocities: indices of the velocities of all motors, (motors,).
    """

    def __init__(self, drivetrain: Drivetrain) -> None:
        joint_count, spring_count = len(drivetrain.present), int(drivetrain.sprung.sum())
        ends = np.cumsum(
            [joint_count, joint_count, spring_count, spring_count, joint_count, joint_count]
        ).tolist()
        self._slices = [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
        self.entries: int = ends[-1]
        indices: AnyArray = np.arange(self.entries)
        dq, dtheta = indices[self._slices[1]], indices[self._slices[3]]
        self.motor_velocities = drivetrain.of_all_motors(dq, dtheta)

    def pack(self, q: FloatArray, dq: FloatArray, theta: FloatArray, dtheta: FloatArray) -> FloatArray:
        """Return the vector of a state with zero integrals of the errors."""
        zero = np.zeros_like(q)
        return self.pack_phase(Phase(q, dq, theta, dtheta, Integral(zero, zero)))

    def pack_phase(self, phase: Phase) -> FloatArray:
        """Return the vector of a state."""
        return np.concatenate((*phase[:4], *phase.integral))

    def unpack(self, vector: FloatArray) -> Phase:
        """Return the parts of vectors (..., entries), as views."""
        q, dq, theta, dtheta, *integral = (vector[..., entries] for entries in self._slices)
        return Phase(q, dq, theta, dtheta, Integral(*integral))


class Controller(Protocol):
    """A control law as a function of time and measured state.

    Attributes:
        ending: end of the run at which its torques become undefined; None if they always exist.
    """

    ending: Ending | None

    def torque(self, time: float | FloatArray, phase: Phase, slip: FloatArray | None = None) -> FloatArray:
        """Return commanded motor torques, ([samples,] motors), N m (N).

        Args:
            time: time, s.
            phase: measured state.
            slip: direction in which each motor with sharp friction slides, (motors,); None if unknown.
        """

    def error_rates(self, time: float, phase: Phase) -> Integral:
        """Return the rates of the integrals of the errors."""


_NO_TORQUES = "what is commanded from here on cannot be executed, so there are no torques to apply"


class Feedforward:
    """Feedforward of the torques of the inverse dynamics, independent of the measured state."""

    def __init__(self, model: Robot, trajectory: Trajectory) -> None:
        internal = internal_motions(model, trajectory)
        drivetrain = Drivetrain(model.actuators)
        self._friction = drivetrain.friction

        def columns(time: FloatArray) -> FloatArray:
            inside = internal.at(time - trajectory.start)
            block = compute_block(model, trajectory.at(time), internal=inside)
            torque, velocity = map(drivetrain.of_motors, (block.tau_motor, block.dtheta))
            if self._friction is None:
                return torque
            return np.concatenate((torque - self._friction.torque(velocity), velocity), axis=-1)

        ends = np.union1d(trajectory.breakpoints, trajectory.start + internal.breakpoints)
        self._table = Table.of(columns, ends if internal.joints else trajectory.breakpoints)
        self.ending: Ending | None = None
        if (undefined := self._table.first_undefined) is not None:
            time, column = undefined
            motor = column % len(drivetrain.joint)
            self.ending = Ending(time, _NO_TORQUES, Flag.INFEASIBLE, int(drivetrain.joint[motor]))

    def torque(self, time: float | FloatArray, _phase: Phase, _slip: FloatArray | None = None) -> FloatArray:
        """See `Controller.torque`; friction is that of the commanded motion."""
        values: FloatArray = self._table(time)
        if self._friction is None:
            return values
        motor_count = values.shape[-1] // 2
        torque_without_friction, velocity = values[..., :motor_count], values[..., motor_count:]
        return torque_without_friction + self._friction.torque(velocity)

    def error_rates(self, _time: float, phase: Phase) -> Integral:
        """Return zeros, since nothing is integrated."""
        return Integral(np.zeros_like(phase.q), np.zeros_like(phase.q))


class LinearizingFeedback:
    """Feedback linearization by a model, along a reference."""

    def __init__(self, model: Robot, reference: TabulatedReference, gains: Gains) -> None:
        self._feedback = FeedbackLinearization(model, gains, reference.frame)
        self._reference = reference
        self.ending: Ending | None = None
        self._integrates = gains.integrates

    def torque(self, time: float | FloatArray, phase: Phase, slip: FloatArray | None = None) -> FloatArray:
        """See `Controller.torque`."""
        reference = self._reference(time)
        return self._feedback.law.torque(*phase[:4], reference, phase.integral, slip)

    def error_rates(self, time: float, phase: Phase) -> Integral:
        """Return the errors of position, and of stiffness where commanded; zeros without integral action."""
        if not self._integrates:
            return Integral(np.zeros_like(phase.q), np.zeros_like(phase.q))
        reference, plant = self._reference(time), self._feedback.plant
        stiffness_error, stiffness_joints = np.zeros_like(phase.q), plant.drivetrain.chosen
        stiffness = plant.drivetrain.stiffness(phase.q, phase.theta)
        stiffness_error[..., stiffness_joints] = (reference.commanded["stiffness"] - stiffness)[
            ..., stiffness_joints
        ]
        return Integral(reference.q - phase.q, stiffness_error)


class ClosedLoop:
    """A robot whose motors obey a controller.

    Args:
        robot: true robot.
        controller: law of the torques; a motor exerts at most its `max_torque`.
        reference: source of the wrench that acts, and of the damping.

    Attributes:
        plant: equations of motion of the robot.
        packing: layout of the state in a vector.
        slip: direction in which a motor with sharp friction slides, 0 while it sticks, NaN for other motors,
            (motors,); None if no motor has sharp friction.
        held: torques commanded in any state until the controller acts again; None if it acts all the time.
    """

    def __init__(self, robot: Robot, controller: Controller, reference: TabulatedReference) -> None:
        self.plant = Plant(robot, reference.frame)
        self.packing = Packing(self.plant.drivetrain)
        self.controller = controller
        self.reference = reference
        self.slip: FloatArray | None = None
        self.held: ConstantTable | None = None

    def demand(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the motor torques that are commanded in a state."""
        return self.controller_torque(time, vector) if self.held is None else self.held(time)

    def controller_torque(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the motor torques that the controller commands if it acts in this state."""
        return self.controller.torque(time, self.packing.unpack(vector), self.slip)

    def hold(self, torques: FloatArray) -> None:
        """Command these torques until others are held."""
        if self.held is None:
            self.held = ConstantTable(torques)
        self.held.set(torques)

    def derivative(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the time derivatives of state vectors, (..., entries), while the controller acts."""
        phase = self.packing.unpack(vector)
        ddq, ddtheta, _ = self.response(time, phase, self.demand(time, vector), self.slip)
        integral = self.controller.error_rates(time, phase)
        return np.concatenate((phase.dq, ddq, phase.dtheta, ddtheta, *integral), axis=-1)

    def response(
        self, time: float | FloatArray, phase: Phase, demand: FloatArray, slip: FloatArray | None = None
    ) -> Response:
        """Return the response to commanded motor torques; `slip` as in `Plant.accelerations`."""
        wrench, damping = self.reference.wrench(time), self.reference.damping(time)
        torque = self.plant.drivetrain.limited(demand)
        return self.plant.accelerations(*phase[:4], torque, wrench, damping, slip)
