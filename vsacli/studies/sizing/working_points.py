"""What a motor does on its own side of the gear: torque, speed, power, current, at most and on average."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.actuators.motor import JointMotor
from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named
from vsacli.studies.sizing.motor_demand import MotorDemand
from vsacli.studies.sizing.peak import Peak
from vsacli.studies.sizing.shaft import LIMITS, Shaft


@dataclass(frozen=True, eq=False)
class WorkingPoints(Published):
    """Torque over speed of a motor; NaN where it follows from constants that are not known.

    Attributes:
        torque: largest in size, N m.
        rms_torque: root mean square over time.
        velocity: largest speed, rad/s.
        rms_velocity: root mean square over time.
        power: largest mechanical power that it gives, W; one that is taken back does not count.
        current, rms_current: as the torque, A.
        voltage: largest in size, V.
        copper_loss: mean over time, W.
        torques, velocities: at all steps, (samples,).
    """

    torque: Peak
    rms_torque: float
    velocity: Peak
    rms_velocity: float
    power: float
    current: float
    rms_current: float
    voltage: float
    copper_loss: float
    torques: FloatArray = field(repr=False)
    velocities: FloatArray = field(repr=False)

    shape: ClassVar = {
        **named("torque", "rms_torque", "velocity", "rms_velocity", "power", "current", "rms_current"),
        **named("voltage", "copper_loss"),
    }

    @classmethod
    def of(
        cls, demand: MotorDemand, shaft: Shaft, torques: FloatArray, velocities: FloatArray
    ) -> WorkingPoints:
        """From torques and velocities on the shaft, each (samples,)."""
        peak, rms = demand.peak(torques), demand.rms(torques)
        voltages = shaft.resistance / shaft.torque_constant * torques + shaft.torque_constant * velocities
        return cls(
            torque=peak,
            rms_torque=rms,
            velocity=demand.peak(velocities),
            rms_velocity=demand.rms(velocities),
            power=max(0.0, float((torques * velocities).max())),
            current=peak.value / shaft.torque_constant,
            rms_current=rms / shaft.torque_constant,
            voltage=float(np.abs(voltages).max()),
            copper_loss=float(shaft.heat_per_torque * rms**2),
            torques=torques,
            velocities=velocities,
        )

    @classmethod
    def with_gear(cls, demand: MotorDemand, shaft: Shaft, ratio: float) -> WorkingPoints:
        """Of a motor with a gear, in the place of the robot's own."""
        (coefficients,) = Shaft.of([shaft]).coefficients(np.array([ratio]))
        return cls.of(demand, shaft, coefficients @ demand.signals, ratio * demand.velocity)

    @classmethod
    def as_it_is(cls, demand: MotorDemand, motor: JointMotor) -> WorkingPoints:
        """Of the robot's own motor; on the joint's side if its gear is not known."""
        ratio = motor.gear_ratio or 1.0
        return cls.of(demand, Shaft.of_joint_motor(motor), demand.torque / ratio, demand.velocity * ratio)

    def shares(self, shaft: Shaft) -> dict[str, float]:
        """What it uses of each limit that there is."""
        values = (self.torque.value, self.rms_torque, self.velocity.value, self.voltage)
        used = dict(zip(LIMITS, values, strict=True))
        return {name: used[name] / shaft.bounds[name] for name in shaft.limited}
