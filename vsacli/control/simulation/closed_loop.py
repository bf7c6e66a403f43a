"""The equations of motion of a robot under a controller."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.controllers import Controller
from vsacli.control.simulation.reference import Reference
from vsacli.control.simulation.state_vector import Packing, Phase
from vsacli.control.simulation.table import Constant
from vsacli.dynamics.forward import Plant
from vsacli.dynamics.stiction import Response
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
        """The same if the controller acts in that state."""
        return self.controller.torque(time, self.packing.unpack(vector), self.slip)

    def hold(self, torques: FloatArray) -> None:
        """Let the motors be asked for these torques until others are held."""
        if self.held is None:
            self.held = Constant(torques)
        self.held.set(torques)

    def applied(self, demand: FloatArray) -> FloatArray:
        """What the motors give of the torques asked of them."""
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
        """What torques asked of the motors lead to; `slip` as of `Plant.accelerations`."""
        wrench, damping = self.reference.wrench(time), self.reference.damping(time)
        return self.plant.accelerations(*phase[:4], self.applied(demand), wrench, damping, slip)
