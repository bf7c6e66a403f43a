"""The sizing of one motor of a robot: its demand, its use, and suitable motors of a catalog."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from vsacli.actuators.motor import JointMotor
from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named
from vsacli.base.units import TORQUE, VELOCITY
from vsacli.studies.sizing.catalog import LIMITS, CatalogMotor, Shaft
from vsacli.studies.sizing.choices import Choice
from vsacli.studies.sizing.demand import MotorDemand, Peak


@dataclass(frozen=True, eq=False)
class WorkingPoints(Published):
    """Torque and speed of a motor; values that follow from unknown constants are NaN.

    Attributes:
        torque: largest |torque|, N m.
        rms_torque: rms torque over time, N m.
        velocity: largest |speed|, rad/s.
        rms_velocity: rms speed over time, rad/s.
        power: largest positive mechanical power, W.
        current, rms_current: largest and rms current, A.
        voltage: largest |voltage|, V.
        copper_loss: mean copper loss over time, W.
        torques, velocities: torque and speed at all samples, (samples,).
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
        """Return the points from torques and velocities on the shaft, each (samples,)."""
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
        """Return the points of a motor with a gear in place of the robot's own."""
        (coefficients,) = Shaft.of([shaft]).coefficients(np.array([ratio]))
        return cls.of(demand, shaft, coefficients @ demand.signals, ratio * demand.velocity)

    @classmethod
    def as_it_is(cls, demand: MotorDemand, motor: JointMotor) -> WorkingPoints:
        """Return the points of the robot's own motor; on the joint side if its gear is unknown."""
        ratio = motor.gear_ratio or 1.0
        return cls.of(demand, Shaft.of_joint_motor(motor), demand.torque / ratio, demand.velocity * ratio)

    def shares(self, shaft: Shaft) -> dict[str, float]:
        """Return the used share of each finite limit, by name."""
        values = (self.torque.value, self.rms_torque, self.velocity.value, self.voltage)
        used_values = dict(zip(LIMITS, values, strict=True))
        return {name: used_values[name] / shaft.bounds[name] for name in shaft.limited}


@dataclass(frozen=True)
class Asked(Published):
    """The demand on any motor, on the joint side of its gear.

    Attributes:
        load: largest |torque| of springs and everything parallel to them, N m (N).
        rms_load: rms of this torque over time, N m (N).
        velocity: largest |speed|, rad/s (m/s).
        acceleration: largest |acceleration|, rad/s^2 (m/s^2).
        power: largest power delivered to the load, W.
    """

    load: Peak
    rms_load: float
    velocity: Peak
    acceleration: float
    power: float


@dataclass(frozen=True)
class OwnMotor(Published):
    """The performance of the robot's own motor.

    Attributes:
        points: working points on its shaft, or on the joint side if its gear is unknown.
        shares: used share of each of its limits, by name.
        does: whether all limits are kept.
        low, high: range of gear ratios at which they would be; NaN if it is empty, None if it is unknown, as
            for a motor without gear ratio or with smooth friction.
    """

    points: WorkingPoints
    shares: dict[str, float]
    does: bool
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, eq=False)
class MotorSizing(Published):
    """The sizing of one motor of the robot.

    Attributes:
        demand: demand on the motor, sample by sample.
        gear_ratio: gear ratio of the robot's own motor; None if unknown.
        own: use of the robot's own motor; None if no sample is feasible.
        choices: motors of the catalog in its place, sufficient ones first, sorted by the criterion.
        record: catalog entry of the first choice.
        shaft: constants of the first choice, or of the robot's own motor without a catalog.
        points: working points of that motor on its shaft.
    """

    demand: MotorDemand = field(repr=False)
    gear_ratio: float | None
    own: OwnMotor | None = None
    choices: tuple[Choice, ...] = ()
    record: CatalogMotor | None = field(default=None, repr=False)
    shaft: Shaft | None = field(default=None, repr=False)
    points: WorkingPoints | None = field(default=None, repr=False)

    shape: ClassVar = {
        **named("joint", "motor", "gear_ratio", "does"),
        "asked": "asked",
        "own": "own",
        "chosen?": "chosen",
        "choices?": "choices",
    }

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.demand.joint

    @property
    def motor(self) -> int:
        """Number of the motor, 1 or 2."""
        return self.demand.number

    @property
    def name(self) -> str:
        """Name of the joint and number of the motor."""
        return f"{self.joint} {self.motor}"

    @property
    def drive(self) -> str:
        """Motor and gear of `points`, as far as known."""
        if self.best is not None:
            return f"{self.best.motor}, gear {self.best.ratio:.4g}"
        return "joint side" if self.gear_ratio is None else f"gear {abs(self.gear_ratio):.4g}"

    @property
    def units(self) -> tuple[str, str]:
        """Units of the torques and velocities of `points`."""
        has_ratio = self.best is not None or self.gear_ratio is not None
        joint_type = "revolute" if has_ratio else self.demand.joint_type
        return TORQUE.unit(joint_type), VELOCITY.unit(joint_type)

    @property
    def best(self) -> Choice | None:
        """First choice: the best sufficient motor, or the one with the smallest violation."""
        return self.choices[0] if self.choices else None

    @property
    def does(self) -> bool:
        """Whether a motor of the catalog suffices; without a catalog, the robot's own."""
        judged_motor = self.best or self.own
        return judged_motor is not None and judged_motor.does

    @property
    def chosen(self) -> WorkingPoints | None:
        """Working points of the best motor of the catalog."""
        return self.points if self.choices else None

    @cached_property
    def asked(self) -> Asked | None:
        """Demand on any motor; None if no sample is feasible."""
        demand = self.demand
        if not demand.time.size:
            return None
        return Asked(
            load=demand.peak(demand.load),
            rms_load=demand.rms(demand.load),
            velocity=demand.peak(demand.velocity),
            acceleration=demand.peak(demand.acceleration).value,
            power=max(0.0, float((demand.load * demand.velocity).max())),
        )
