"""What computes the motor torques of a simulated robot: from the time alone, or from its measured state."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag
from vsacli.control.gains import Gains, Integral
from vsacli.control.linearization import FeedbackLinearization
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.reference import Reference
from vsacli.control.simulation.state_vector import Phase
from vsacli.control.simulation.table import Table
from vsacli.control.simulation.tabulated import first_undefined
from vsacli.dynamics.internal_motion import internal_motions
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


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
        """What the integrals of the errors grow by per second."""


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
