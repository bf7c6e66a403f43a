"""The equations of motion of a robot under a controller."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.controllers import Controller
from vsacli.control.simulation.reference import Reference
from vsacli.control.simulation.state_vector import Packing, Phase
from vsacli.dynamics.forward import Plant
from vsacli.robot.model import Robot


class ClosedLoop:
    """A robot whose motors obey a controller.

    Args:
        robot: the robot as it is.
        controller: what computes the torques; a motor gives at most its `max_torque`.
        reference: gives the wrench that acts, and the damping.

    Attributes:
        plant: the robot's equations of motion.
        packing: of its state in a vector.
    """

    def __init__(self, robot: Robot, controller: Controller, reference: Reference) -> None:
        self.plant = Plant(robot, reference.frame)
        self.packing = Packing(self.plant.drivetrain)
        self.controller = controller
        self.reference = reference

    def demand(self, time: float, vector: FloatArray) -> FloatArray:
        """Torques that the controller asks of the motors in a state."""
        return self.controller.torque(time, self.packing.unpack(vector))

    def applied(self, demand: FloatArray) -> FloatArray:
        """What the motors give of the torques asked of them."""
        limit = self.plant.drivetrain.max_torque
        return np.clip(demand, -limit, limit)

    def derivative(self, time: float, vector: FloatArray) -> FloatArray:
        """Time derivatives of state vectors (..., entries) at a time while the controller acts."""
        return self.derivative_under(self.demand(time, vector), time, vector)

    def derivative_under(self, demand: FloatArray, time: float, vector: FloatArray) -> FloatArray:
        """The same under torques asked of the motors."""
        phase = self.packing.unpack(vector)
        ddq, ddtheta = self.accelerations(time, phase, demand)
        integral = self.controller.error_rates(time, phase)
        return np.concatenate((phase.dq, ddq, phase.dtheta, ddtheta, *integral), axis=-1)

    def accelerations(
        self, time: float | FloatArray, phase: Phase, demand: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Of the joints and of the motors with springs, under torques asked of the motors."""
        wrench, damping = self.reference.wrench(time), self.reference.damping(time)
        return self.plant.accelerations(*phase[:4], self.applied(demand), wrench, damping)
