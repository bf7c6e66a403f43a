"""What trajectories ask of a motor, whichever it is, on the joint's side of its gear."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.studies.sizing.peak import Peak
from vsacli.studies.sizing.shaft import shaft_signals


@dataclass(frozen=True, eq=False)
class MotorDemand:
    """What is asked of a motor on the joint's side of its gear, at all steps that can be done; (samples,).

    Attributes:
        joint, joint_type: whose motor it is.
        number: 1 or 2.
        trajectories: their names.
        run: index of the trajectory that the step belongs to.
        time: of the step in it, s.
        weight: time that the step stands for in means over time, s.
        velocity, acceleration: of the motor.
        load: what springs, a damper and a coupled rotor exert against it.
        torque: of the motor that the robot file has.
    """

    joint: str
    joint_type: str
    number: int
    trajectories: tuple[str, ...]
    run: IndexArray = field(repr=False)
    time: FloatArray = field(repr=False)
    weight: FloatArray = field(repr=False)
    velocity: FloatArray = field(repr=False)
    acceleration: FloatArray = field(repr=False)
    load: FloatArray = field(repr=False)
    torque: FloatArray = field(repr=False)

    @property
    def name(self) -> str:
        """Of the motor."""
        return f"{self.joint} {self.number}"

    def peak(self, values: FloatArray) -> Peak:
        """The largest size of values, (samples,)."""
        step = int(np.abs(values).argmax())
        return Peak(float(abs(values[step])), self.trajectories[int(self.run[step])], float(self.time[step]))

    def rms(self, values: FloatArray) -> float:
        """Root mean square over time of values, (samples,)."""
        return float(np.sqrt(self.mean(values * values)))

    @cached_property
    def signals(self) -> FloatArray:
        """The seven that the torque on a shaft is a sum of, (7, samples)."""
        return shaft_signals(self.velocity, self.acceleration, self.load)

    def mean(self, values: FloatArray) -> FloatArray:
        """Over time, of the last axis; over the steps if no two that follow each other can be done."""
        weight = self.weight if self.weight.any() else np.ones_like(self.weight)
        mean: FloatArray = values @ weight / weight.sum()
        return mean

    @cached_property
    def moments(self) -> FloatArray:
        """Means over time of the products of the signals, (7, 7), with which squares of torques average."""
        return self.mean(self.signals[:, None] * self.signals)

    @cached_property
    def top_speed(self) -> float:
        """Largest speed."""
        return float(np.abs(self.velocity).max(initial=0.0))
