"""A robot under a controller: the law of the motor torques, and the equations of motion of both."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import AnyArray, FloatArray
from vsacli.base.flags import Flag
from vsacli.control.gains import Gains, Integral
from vsacli.control.linearization import FeedbackLinearization
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.tabulated import Constant, Reference, Table, first_undefined
from vsacli.dynamics.dry_friction import Response
from vsacli.dynamics.forward import Plant
from vsacli.dynamics.internal_motion import internal_motions
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


class Phase(NamedTuple):
    """Full state, ([samples,] joints) and ([samples,] springs), and the integrals of the errors."""

    q: FloatArray
    dq: FloatArray
    theta: FloatArray
    dtheta: FloatArray
    integral: Integral


class Packing:
    """The layout of a `Phase` in a vector.

    Attributes:
        entries: of the vector.
        motor_velocities: places of the velocities of all motors, (motors,).
    """

    def __init__(self, drivetrain: Drivetrain) -> None:
        joints, springs = len(drivetrain.present), int(drivetrain.sprung.sum())
        ends = np.cumsum([joints, joints, springs, springs, joints, joints]).tolist()
        self._parts = [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
        self.entries: int = ends[-1]
        places: AnyArray = np.arange(self.entries)
        dq, dtheta = places[self._parts[1]], places[self._parts[3]]
        self.motor_velocities = drivetrain.of_all(dq, dtheta)

    def pack(self, q: FloatArray, dq: FloatArray, theta: FloatArray, dtheta: FloatArray) -> FloatArray:
        """Return the vector of a state at which nothing is integrated yet."""
        nothing = np.zeros_like(q)
        return self.joined(Phase(q, dq, theta, dtheta, Integral(nothing, nothing)))

    def joined(self, phase: Phase) -> FloatArray:
        """Return the vector of a state."""
        return np.concatenate((*phase[:4], *phase.integral))

    def unpack(self, vector: FloatArray) -> Phase:
        """Return the parts of vectors (..., entries), as views."""
        q, dq, theta, dtheta, *integral = (vector[..., part] for part in self._parts)
        return Phase(q, dq, theta, dtheta, Integral(*integral))


class Controller(Protocol):
    """A control law as a function of time and of the measured state.

    Attributes:
        ending: where it has no more torques to give; None if it always has.
    """

    ending: Ending | None

    def torque(self, time: float | FloatArray, phase: Phase, slip: FloatArray | None = None) -> FloatArray:
        """Motor torques, ([samples,] motors).

        Args:
            time: s.
            phase: the measured state.
            slip: direction in which each motor moves, as far as that is known apart from its velocity.
        """

    def error_rates(self, time: float, phase: Phase) -> Integral:
        """Return the rates of the integrals of the errors."""


_NO_TORQUES = "what is commanded from here on cannot be executed, so there are no torques to apply"


class Feedforward:
    """The computed torques of the inverse dynamics, whatever the robot does."""

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
        if (found := first_undefined(self._table.polynomial)) is not None:
            time, column = found
            motor = column % len(drivetrain.joint)
            self.ending = Ending(time, _NO_TORQUES, Flag.INFEASIBLE, int(drivetrain.joint[motor]))

    def torque(self, time: float | FloatArray, _phase: Phase, _slip: FloatArray | None = None) -> FloatArray:
        """Motor torques, ([samples,] motors); friction is that of the commanded motion."""
        values: FloatArray = self._table(time)
        if self._friction is None:
            return values
        motors = values.shape[-1] // 2
        smooth, velocity = values[..., :motors], values[..., motors:]
        return smooth + self._friction.torque(velocity)

    def error_rates(self, _time: float, phase: Phase) -> Integral:
        """Nothing is integrated."""
        return Integral(np.zeros_like(phase.q), np.zeros_like(phase.q))


class LinearizingFeedback:
    """Feedback linearization of the model along a reference."""

    def __init__(self, model: Robot, reference: Reference, gains: Gains) -> None:
        self._feedback = FeedbackLinearization(model, gains, reference.frame)
        self._reference = reference
        self.ending: Ending | None = None
        self._integrates = gains.integrates

    def torque(self, time: float | FloatArray, phase: Phase, slip: FloatArray | None = None) -> FloatArray:
        """Motor torques, ([samples,] motors)."""
        reference = self._reference(time)
        return self._feedback.law.torque(*phase[:4], reference, phase.integral, slip)

    def error_rates(self, time: float, phase: Phase) -> Integral:
        """Errors of position, and of stiffness where it can be commanded; zero without integral action."""
        if not self._integrates:
            return Integral(np.zeros_like(phase.q), np.zeros_like(phase.q))
        reference, plant = self._reference(time), self._feedback.plant
        error, chosen = np.zeros_like(phase.q), plant.drivetrain.chosen
        stiffness = plant.drivetrain.stiffness(phase.q, phase.theta)
        error[..., chosen] = (reference.commanded["stiffness"] - stiffness)[..., chosen]
        return Integral(reference.q - phase.q, error)


class ClosedLoop:
    """A robot whose motors obey a controller.

    Args:
        robot: the robot as it is.
        controller: law of the torques; a motor gives at most its `max_torque`.
        reference: gives the wrench that acts, and the damping.

    Attributes:
        plant: the robot's equations of motion.
        packing: of its state in a vector.
        slip: where friction of a motor is sharp the direction in which it slides now, 0 while it is held,
            (motors,), NaN where it is not; None if it is nowhere.
        held: torques that the motors are asked for whatever the state, until the controller acts again; None
            if it acts at every instant.
    """

    def __init__(self, robot: Robot, controller: Controller, reference: Reference) -> None:
        self.plant = Plant(robot, reference.frame)
        self.packing = Packing(self.plant.drivetrain)
        self.controller = controller
        self.reference = reference
        self.slip: FloatArray | None = None
        self.held: Constant | None = None

    def demand(self, time: float, vector: FloatArray) -> FloatArray:
        """Torques that the controller asks of the motors in a state."""
        return self.controller_torque(time, vector) if self.held is None else self.held(time)

    def controller_torque(self, time: float, vector: FloatArray) -> FloatArray:
        """Return the same if the controller acts in that state."""
        return self.controller.torque(time, self.packing.unpack(vector), self.slip)

    def hold(self, torques: FloatArray) -> None:
        """Let the motors be asked for these torques until others are held."""
        if self.held is None:
            self.held = Constant(torques)
        self.held.set(torques)

    def applied(self, demand: FloatArray) -> FloatArray:
        """Return the torques that the motors give for those commanded."""
        limit = self.plant.drivetrain.max_torque
        return np.clip(demand, -limit, limit)

    def derivative(self, time: float, vector: FloatArray) -> FloatArray:
        """Time derivatives of state vectors (..., entries) at a time while the controller acts."""
        phase = self.packing.unpack(vector)
        ddq, ddtheta, _ = self.response(time, phase, self.demand(time, vector), self.slip)
        integral = self.controller.error_rates(time, phase)
        return np.concatenate((phase.dq, ddq, phase.dtheta, ddtheta, *integral), axis=-1)

    def response(
        self, time: float | FloatArray, phase: Phase, demand: FloatArray, slip: FloatArray | None = None
    ) -> Response:
        """Return the response to commanded motor torques; `slip` as in `Plant.accelerations`."""
        wrench, damping = self.reference.wrench(time), self.reference.damping(time)
        return self.plant.accelerations(*phase[:4], self.applied(demand), wrench, damping, slip)
