"""Energy over a run: work of the motors, elastic energy, and what it takes to hold a stiffness."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.base.json_records import Stored, named
from vsacli.base.variables import VARIABLES, Block
from vsacli.dynamics.dampers import motor_torques
from vsacli.dynamics.losses import LossMeter
from vsacli.dynamics.quadrature import integrals, positive_part, work_on_each_other
from vsacli.robot.model import Robot


@dataclass(frozen=True)
class JointEnergy(Stored):
    """Energy of a joint over a run; but for the peak, NaN if the torques of a step do not exist.

    The torques of two springs split: tau_1^2 + tau_2^2 = tau_e^2/2 + (tau_1 - tau_2)^2/2. The first part
    is the least with which two motors carry the load, half of it each. The second, co-contraction, moves
    nothing: it is what the stiffness takes.

    With other springs between the motors and the link, or between the motors, they do not split like this.

    Attributes:
        elastic_peak: largest energy in the springs, J, over the steps where it exists.
        spent: integral of the positive part of each motor's power, summed over the motors, J.
        recovered: that of the negative part, J; spent - recovered is the work of the motors.
        co_contraction: root mean square over time of (tau_1 - tau_2)/2, N m (N); NaN where
            torques do not split.
        load: that of tau_e/2, likewise.
        dissipated: what friction and damping of joint and motors took, J; None if nothing has dry friction.
        copper_loss: heat in the windings of its motors, J; None if no resistance is given.
    """

    elastic_peak: float
    spent: float
    recovered: float
    co_contraction: float
    load: float
    dissipated: float | None = None
    copper_loss: float | None = None

    shape: ClassVar = {
        **named("elastic_peak", "spent", "recovered", "co_contraction", "load", "co_contraction_share"),
        "dissipated?": "dissipated",
        "copper_loss?": "copper_loss",
    }

    @property
    def co_contraction_share(self) -> float:
        """Share of the co-contraction in the time integral of tau_1^2 + tau_2^2; NaN if that is zero."""
        squared = self.co_contraction**2 + self.load**2
        return self.co_contraction**2 / squared if squared else math.nan


class Flow(NamedTuple):
    """Energy that flows over consecutive steps; of the motors (joints, 2, ...), NaN where there is none.

    Attributes:
        intervals: lengths of time between the steps, (samples - 1,), s.
        work: of each motor in each interval, (joints, 2, samples - 1), J.
        motor_power: (joints, 2, samples), W.
        tau_spring: (joints, 2, samples), N m (N).
        elastic_energy: (joints, samples), J.
        dissipated: taken by friction and damping in each interval, (joints, samples - 1), J; None if there is
            no dry friction.
        copper: heat in the windings in each interval, (joints, 2, samples - 1), J; None if it is not known.
    """

    intervals: FloatArray
    work: FloatArray
    motor_power: FloatArray
    tau_spring: FloatArray
    elastic_energy: FloatArray
    dissipated: FloatArray | None = None
    copper: FloatArray | None = None


class EnergyMeter:
    """Sums up energy; `add` what flows, each time from the last step of the time before, then `report`.

    Sums run from step to step, so that they do not depend on how the steps are divided.
    """

    def __init__(self) -> None:
        self._work, self._spent = _Sum(), _Sum()
        self._duration, self._load, self._co_contraction = _Sum(), _Sum(), _Sum()
        self._peak: FloatArray | float = math.nan
        self._dissipated, self._copper = _Sum(), _Sum()

    def add(self, flow: Flow) -> FloatArray:
        """Merge a flow; returns the work of each motor up to the end of each interval, in its place."""
        intervals = flow.intervals
        self._duration.add(intervals.copy())
        self._peak = np.fmax(self._peak, np.fmax.reduce(flow.elastic_energy, axis=-1))
        tau_1, tau_2 = flow.tau_spring[:, 0], flow.tau_spring[:, 1]
        for total, effort in ((self._load, tau_1 + tau_2), (self._co_contraction, tau_1 - tau_2)):
            effort *= effort
            total.add(intervals / 8 * (effort[:, 1:] + effort[:, :-1]))
        self._spent.add(positive_part(intervals, flow.motor_power, flow.work))
        if flow.dissipated is not None:
            self._dissipated.add(flow.dissipated)
        if flow.copper is not None:
            self._copper.add(flow.copper)
        return self._work.add(flow.work)

    def report(self, robot: Robot) -> list[JointEnergy]:
        """What was found of each joint of a robot; something must have been added."""
        there = [[side < joint.actuator.motor_count for side in range(SIDES)] for joint in robot.joints]
        work, spent = (np.sum(total.value, axis=1, where=there) for total in (self._work, self._spent))
        duration = float(self._duration.value)
        shared = [joint.actuator.co_contracts for joint in robot.joints]
        efforts = [
            np.where(shared, _mean_root(total.value, duration), np.nan)
            for total in (self._co_contraction, self._load)
        ]
        found = np.array((self._peak, spent, spent - work, *efforts))
        lost = zip(self._dissipated_of(robot), self._copper_of(robot), strict=True)
        return [
            replace(JointEnergy(*each), dissipated=dissipated, copper_loss=copper_loss)
            for each, (dissipated, copper_loss) in zip(found.T.tolist(), lost, strict=True)
        ]

    def _dissipated_of(self, robot: Robot) -> list[float | None]:
        if not robot.has(VARIABLES["dissipated_power"]):
            return [None] * len(robot.joints)
        return list(map(float, np.asarray(self._dissipated.value)))

    def _copper_of(self, robot: Robot) -> Iterator[float | None]:
        for index, joint in enumerate(robot.joints):
            heated = joint.has(VARIABLES["copper_loss"])
            yield float(np.sum(np.asarray(self._copper.value)[index, heated])) if any(heated) else None


class RunEnergy:
    """The energy of a run of the inverse dynamics; `add` its blocks in order, then ask for the `report`."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._inertia, self._damping = _motor_constants(robot)
        self._coupling = np.array([joint.actuator.coupled_rotors for joint in robot.joints])
        self._meter = EnergyMeter()
        lossy = any(robot.has(VARIABLES[name]) for name in ("dissipated_power", "copper_loss"))
        self._losses = LossMeter(robot) if lossy else None
        self._last: _Rows | None = None

    def add(self, block: Block) -> FloatArray:
        """Merge a block; returns the variable `motor_energy` at its steps, (samples, joints, 2)."""
        rows = self._rows(block)
        joined = rows.after(rows.at(0) if self._last is None else self._last)
        self._last = rows.at(-1)
        intervals = np.diff(joined.time)
        work = integrals(intervals, joined.passed_on, joined.rate)
        work += np.diff(joined.kinetic)
        coupled = np.flatnonzero(self._coupling)
        if coupled.size:
            motion = joined.dtheta[coupled], joined.ddtheta[coupled]
            work[coupled] += self._coupling[coupled, None, None] * work_on_each_other(intervals, *motion)
        flow = Flow(intervals, work, joined.motor_power, joined.tau_spring, joined.elastic_energy)
        if self._losses is not None:
            lost = self._losses.add(block)
            work += lost.motor_friction
            flow = flow._replace(dissipated=lost.dissipated, copper=lost.copper)
        return over_time(self._meter.add(flow))

    def _rows(self, block: Block) -> _Rows:
        dtheta, ddtheta, tau_spring = map(by_joint, (block.dtheta, block.ddtheta, block.tau_spring))
        torque = self._damping * dtheta
        torque += tau_spring
        rate = self._damping * ddtheta
        rate += spring_rates(self._robot, block)
        if dampers := motor_torques(self._robot, block):
            torque += dampers[0]
            rate += dampers[1]
        rate *= dtheta
        rate += torque * ddtheta
        torque *= dtheta
        return _Rows(
            time=block.time,
            dtheta=dtheta,
            ddtheta=ddtheta,
            kinetic=self._inertia / 2 * dtheta**2,
            passed_on=torque,
            rate=rate,
            motor_power=by_joint(block.motor_power),
            tau_spring=tau_spring,
            elastic_energy=by_joint(block.elastic_energy),
        )

    def report(self) -> list[JointEnergy]:
        """What was found of each joint; at least one block must have been added."""
        return self._meter.report(self._robot)


class _Rows(NamedTuple):
    """What the work of motors follows from: B theta'^2/2, and the power passed on or lost, with its rate."""

    time: FloatArray
    dtheta: FloatArray
    ddtheta: FloatArray
    kinetic: FloatArray
    passed_on: FloatArray
    rate: FloatArray
    motor_power: FloatArray
    tau_spring: FloatArray
    elastic_energy: FloatArray

    def at(self, step: int) -> _Rows:
        """One step, the last if -1."""
        return _Rows(*(values[..., [step]] for values in self))

    def after(self, step: _Rows) -> _Rows:
        """The same with a step before."""
        pairs = zip(step, self, strict=True)
        return _Rows(*(np.concatenate((one, rest), axis=-1) for one, rest in pairs))


def spring_rates(robot: Robot, block: Block) -> FloatArray:
    """Rates of tau_spring, (joints, 2, samples), NaN where there is no motor."""
    rates = np.full((len(robot.joints), SIDES, len(block.time)), np.nan)
    for index, joint in enumerate(robot.joints):
        rates[index, : joint.actuator.motor_count] = joint.actuator.spring_rates(block.of_joint(index))
    return rates


class _Sum:
    """A running sum along the last axis."""

    def __init__(self) -> None:
        self.value: FloatArray | float = 0.0

    def add(self, pieces: FloatArray) -> FloatArray:
        """The sum up to each of the pieces, in their place."""
        pieces[..., 0] += self.value
        np.add.accumulate(pieces, axis=-1, out=pieces)
        self.value = pieces[..., -1].copy()
        return pieces


def _motor_constants(robot: Robot) -> FloatArray:
    """Inertia and damping of the motors, (2, joints, 2, 1), NaN where there is none."""
    constants = np.full((2, len(robot.joints), SIDES, 1), np.nan)
    for index, joint in enumerate(robot.joints):
        for side, motor in enumerate(joint.actuator.motors):
            constants[:, index, side, 0] = motor.inertia, motor.damping
    return constants


def _mean_root(integral: FloatArray | float, duration: float) -> FloatArray:
    """Root of the mean over time; NaN if no time has passed."""
    return np.sqrt(np.asarray(integral) / duration) if duration else np.full_like(integral, np.nan)
