"""A motor on its own side of the gear, and its use there for a demand on the joint's side.

With the ratio n, a motor that moves by theta on the joint's side turns by n theta. On its shaft it exerts

    tau = n (J theta'' + D theta') + friction + load/n

where the load is what the springs and a damper exert against it on the joint's side. This is (73)-(74) over
n: neither the motion of the motor nor the load depend on which motor it is. So its torque is the sum of seven
signals of the motion, with coefficients that are those of motor and gear. A gear that passes on a share of
the power makes the load larger where it is driven, and smaller where it is braked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, Self

import numpy as np

from vsacli.actuators.friction import NO_FRICTION, direction_of
from vsacli.actuators.motor import JointMotor
from vsacli.base.arrays import FloatArray

LIMITS = ("torque", "continuous_torque", "velocity", "voltage")
"""Limits of a motor: peak torque or current, their root mean square, and so on."""


class Shaft(NamedTuple):
    """Constants of a motor, SI units, or (motors,) of several; bounds are infinite where there are none.

    Attributes:
        inertia: of the rotor.
        damping: viscous.
        backward, forward: dry friction while the joint side moves that way.
        offset: torque that is added.
        max_torque: of peaks, as far as torque and current go.
        continuous_torque: of the root mean square, as above.
        max_velocity: of the shaft.
        max_voltage: of the windings.
        torque_constant: torque over current; NaN if it is not known.
        resistance: of the windings; NaN if it is not known.
        efficiency: of the gear.
    """

    inertia: Any
    damping: Any
    backward: Any
    forward: Any
    offset: Any
    max_torque: Any
    continuous_torque: Any
    max_velocity: Any
    max_voltage: Any
    torque_constant: Any
    resistance: Any
    efficiency: Any

    @classmethod
    def of(cls, shafts: Iterable[Self]) -> Self:
        """Return several motors."""
        return cls(*(np.array(column, dtype=float) for column in zip(*shafts, strict=True)))

    @classmethod
    def of_joint_motor(cls, motor: JointMotor) -> Self:
        """Return the shaft of a robot's own motor, on the joint side if its gear is not known."""
        ratio = abs(motor.gear_ratio or 1.0)
        friction = motor.friction or NO_FRICTION
        constant = math.nan if motor.torque_constant is None else abs(motor.torque_constant) / ratio
        by_current = math.inf if motor.max_current is None else motor.max_current * constant
        return cls(
            inertia=motor.inertia / ratio**2,
            damping=motor.damping / ratio**2,
            backward=friction.coulomb[0] / ratio,
            forward=friction.coulomb[1] / ratio,
            offset=friction.offset / ratio,
            max_torque=min(motor.max_torque / ratio, by_current),
            continuous_torque=math.inf,
            max_velocity=motor.max_velocity * ratio,
            max_voltage=math.inf if motor.max_voltage is None else motor.max_voltage,
            torque_constant=constant,
            resistance=math.nan if motor.resistance is None else motor.resistance,
            efficiency=1.0,
        )

    @property
    def bounds(self) -> dict[str, Any]:
        """Limits by name."""
        bounds = (self.max_torque, self.continuous_torque, self.max_velocity, self.max_voltage)
        return dict(zip(LIMITS, bounds, strict=True))

    @property
    def limited(self) -> tuple[str, ...]:
        """The limits that there are, of one motor."""
        return tuple(name for name, bound in self.bounds.items() if math.isfinite(bound))

    @property
    def stall_torque(self) -> float:
        """Largest torque at rest, by torque, current and voltage."""
        by_voltage = self.max_voltage / self.volts_per_torque if self.volts_per_torque else math.inf
        return float(min(self.max_torque, by_voltage))

    @property
    def volts_per_torque(self) -> Any:
        """Resistance over torque constant, V/(N m); 0 where no voltage bounds anything."""
        return np.where(np.isfinite(self.max_voltage), self.resistance / self.torque_constant, 0.0)

    @property
    def volts_per_speed(self) -> Any:
        """The torque constant, V s/rad; 0 where no voltage bounds anything."""
        return np.where(np.isfinite(self.max_voltage), self.torque_constant, 0.0)

    @property
    def heat_per_torque(self) -> Any:
        """Copper loss over the square of the torque, W/(N m)^2; NaN if it is not known."""
        return self.resistance / self.torque_constant**2

    @property
    def inertial(self) -> FloatArray:
        """Coefficients of the seven signals in the part that grows with the ratio, (motors, 7)."""
        return self._coefficients(self.inertia, self.damping, 0, 0, 0, 0, 0)

    @property
    def frictional(self) -> FloatArray:
        """Coefficients of the part that does not depend on the ratio."""
        return self._coefficients(0, 0, -self.backward, self.forward, self.offset, 0, 0)

    @property
    def loaded(self) -> FloatArray:
        """Coefficients of the part that falls with the ratio."""
        return self._coefficients(0, 0, 0, 0, 0, 1 / self.efficiency, self.efficiency)

    def _coefficients(self, *columns: Any) -> FloatArray:
        return np.stack(np.broadcast_arrays(np.zeros_like(self.inertia), *columns)[1:], axis=-1)

    def coefficients(self, ratio: FloatArray) -> FloatArray:
        """Return the coefficients of the torque on the shaft with ratios (motors,): (motors, 7)."""
        over = np.asarray(ratio)[..., None]
        torque: FloatArray = over * self.inertial + self.frictional + self.loaded / over
        return torque


def shaft_signals(velocity: FloatArray, acceleration: FloatArray, load: FloatArray) -> FloatArray:
    """Return the seven signals of a demand, (7, samples), from those of the joint side, each (samples,).

    Acceleration, velocity, whether it moves backward, and forward, one, the load where it is driven, and
    where it is braked. At rest a load counts as driven.
    """
    direction = direction_of(velocity)
    driven = direction * load >= 0
    return np.stack(
        (
            acceleration,
            velocity,
            (direction < 0).astype(float),
            (direction > 0).astype(float),
            np.ones_like(load),
            np.where(driven, load, 0.0),
            np.where(driven, 0.0, load),
        )
    )
