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
from vsacli.control.simulation.tabulated import first_undefined, tabulate
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


class Controller(Protocol):
    """A control law as a function of time and of the measured state.

    Attributes:
        ending: where it has no more torques to give; None if it always has.
    """

    ending: Ending | None

    def torque(self, time: float | FloatArray, phase: Phase) -> FloatArray:
        """Motor torques, ([samples,] motors)."""

    def error_rates(self, time: float, phase: Phase) -> Integral:
        """What the integrals of the errors grow by per second."""


_NO_TORQUES = "what is commanded from here on cannot be executed, so there are no torques to apply"


class Feedforward:
    """The computed torques of the inverse dynamics, whatever the robot does."""

    def __init__(self, model: Robot, trajectory: Trajectory) -> None:
        drivetrain = Drivetrain(model.actuators)
        self._table = tabulate(
            lambda time: drivetrain.of_motors(compute_block(model, trajectory.at(time)).tau_motor),
            trajectory.breakpoints,
        )
        self.ending: Ending | None = None
        if (found := first_undefined(self._table)) is not None:
            time, motor = found
            self.ending = Ending(time, _NO_TORQUES, Flag.INFEASIBLE, int(drivetrain.joint[motor]))

    def torque(self, time: float | FloatArray, _phase: Phase) -> FloatArray:
        """Motor torques, ([samples,] motors)."""
        torque: FloatArray = self._table(time)
        return torque

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

    def torque(self, time: float | FloatArray, phase: Phase) -> FloatArray:
        """Motor torques, ([samples,] motors)."""
        return self._feedback.law.torque(
            phase.q, phase.dq, phase.theta, phase.dtheta, self._reference(time), phase.integral
        )

    def error_rates(self, time: float, phase: Phase) -> Integral:
        """Errors of position, and of stiffness where it can be commanded; zero without integral action."""
        if not self._integrates:
            return Integral(np.zeros_like(phase.q), np.zeros_like(phase.q))
        reference, plant = self._reference(time), self._feedback.plant
        error, chosen = np.zeros_like(phase.q), plant.drivetrain.chosen
        stiffness = plant.drivetrain.stiffness(phase.q, phase.theta)
        error[..., chosen] = (reference.commanded["stiffness"] - stiffness)[..., chosen]
        return Integral(reference.q - phase.q, error)
