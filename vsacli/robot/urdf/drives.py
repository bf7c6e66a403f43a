"""What a URDF does not say about a robot: its motors and springs, taken from options until they are known."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.kinds import ACTUATORS, Actuator
from vsacli.actuators.laws.cubic import Cubic
from vsacli.actuators.motor import Motor
from vsacli.actuators.rigid import Rigid


@dataclass(frozen=True)
class Placeholders:
    """The actuator of every joint, and its constants, in SI units of the joint.

    Attributes:
        actuator: a key of `vsacli.actuators.kinds.ACTUATORS`.
        motor_inertia: of each motor, joint side of the gear.
        stiffness: of an elastic transmission.
        spring: k and k_c of the cubic springs of an antagonistic one.
    """

    actuator: str = "antagonistic"
    motor_inertia: float = 1.0
    stiffness: float = 1000.0
    spring: tuple[float, float] = (400.0, 2000.0)

    def of_joint(self, effort: float | None) -> Actuator:
        """The actuator of a joint that bears this effort; with two motors that bounds neither of them.

        Raises:
            InvalidRecordError: a constant is not positive.
        """
        if ACTUATORS[self.actuator] is Antagonistic:
            motor, spring = Motor(inertia=self.motor_inertia), Cubic(k=self.spring[0], k_c=self.spring[1])
            return Antagonistic(motor=(motor, motor), spring=(spring, spring))
        motor = Motor(inertia=self.motor_inertia, max_torque=effort or math.inf)
        if ACTUATORS[self.actuator] is Elastic:
            return Elastic(motor=motor, stiffness=self.stiffness)
        return Rigid(motor=motor)
