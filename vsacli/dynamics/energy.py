"""Energy over a run: work of the motors, elastic energy, and what it takes to hold a stiffness."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Stored, named
from vsacli.base.variables import VARIABLES
from vsacli.compute.rows import RowLayout
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
    """Energy that flows in consecutive intervals; of the motors (joints, 2, intervals), NaN where none is.

    Attributes:
        intervals: their lengths, (intervals,), s.
        work: of each motor, J.
        spent: the positive part of that, J.
        load: integral of (tau_1 + tau_2)^2/4, (joints, intervals).
        co_contraction: integral of (tau_1 - tau_2)^2/4, likewise.
        dissipated: taken by friction and damping, (joints, intervals), J; None if there is no dry friction.
        copper: heat in the windings, of the motors, J; None if it is not known.
    """

    intervals: FloatArray
    work: FloatArray
    spent: FloatArray
    load: FloatArray
    co_contraction: FloatArray
    dissipated: FloatArray | None = None
    copper: FloatArray | None = None


class Efforts(NamedTuple):
    """(tau_1 + tau_2)^2/4 and (tau_1 - tau_2)^2/4, each integrated over an interval."""

    load: FloatArray
    co_contraction: FloatArray


def efforts(interval: FloatArray, before: Iterable[FloatArray], after: Iterable[FloatArray]) -> Efforts:
    """What two springs exert together and against each other over intervals, by trapezoids.

    Args:
        interval: length, s.
        before: torques of both springs.
        after: the same at the end of the interval.
    """
    (tau_1, tau_2), (next_1, next_2) = before, after
    return Efforts(
        *(
            interval / 8 * (at_end * at_end + at_begin * at_begin)
            for at_begin, at_end in ((tau_1 + tau_2, next_1 + next_2), (tau_1 - tau_2, next_1 - next_2))
        )
    )


class EnergyMeter:
    """Sums up energy; `add` what flows and the energy in springs at the steps, then `report`.

    Sums run from interval to interval, so that they do not depend on how these are divided.
    """

    def __init__(self) -> None:
        self._work: FloatArray | float = 0.0
        self._totals: FloatArray | float = 0.0
        self._layout = RowLayout({})
        self._peak: FloatArray | float = math.nan

    def add(self, flow: Flow) -> FloatArray:
        """Merge a flow; returns the work up to the end of each interval, in the place of `flow.work`."""
        totals = {name: part for name, part in flow._asdict().items() if name != "work" and part is not None}
        self._layout = RowLayout({name: part.shape[:-1] for name, part in totals.items()})
        rows = np.concatenate([part.reshape(-1, len(flow.intervals)) for part in totals.values()])
        columns = np.ascontiguousarray(rows.T)  # summed side by side, each from step to step
        columns[0] += self._totals
        self._totals = np.add.reduce(columns, axis=0)
        work = flow.work
        work[..., 0] += self._work
        np.add.accumulate(work, axis=-1, out=work)
        self._work = work[..., -1].copy()
        return work

    def add_stored(self, elastic_energy: FloatArray) -> None:
        """Merge the energy in the springs at steps, (joints, samples), J."""
        self._peak = np.fmax(self._peak, np.fmax.reduce(elastic_energy, axis=-1))

    def report(self, robot: Robot) -> list[JointEnergy]:
        """What was found of each joint of a robot; something must have been added."""
        there = [[side < joint.actuator.motor_count for side in range(SIDES)] for joint in robot.joints]
        totals = self._layout.arrays(np.asarray(self._totals))
        work, spent = (np.sum(total, axis=1, where=there) for total in (self._work, totals["spent"]))
        duration = float(totals["intervals"])
        shared = [joint.actuator.co_contracts for joint in robot.joints]
        efforts = [
            np.where(shared, _mean_root(totals[name], duration), np.nan)
            for name in ("co_contraction", "load")
        ]
        found = np.array((self._peak, spent, spent - work, *efforts))
        lost = zip(_dissipated(robot, totals), _copper(robot, totals), strict=True)
        return [
            replace(JointEnergy(*each), dissipated=dissipated, copper_loss=copper_loss)
            for each, (dissipated, copper_loss) in zip(found.T.tolist(), lost, strict=True)
        ]


def _dissipated(robot: Robot, totals: Mapping[str, FloatArray]) -> list[float | None]:
    if not robot.has(VARIABLES["dissipated_power"]):
        return [None] * len(robot.joints)
    return list(map(float, totals["dissipated"]))


def _copper(robot: Robot, totals: Mapping[str, FloatArray]) -> Iterator[float | None]:
    for index, joint in enumerate(robot.joints):
        heated = joint.has(VARIABLES["copper_loss"])
        yield float(np.sum(totals["copper"][index, heated])) if any(heated) else None


def _mean_root(integral: FloatArray, duration: float) -> FloatArray:
    """Root of the mean over time; NaN if no time has passed."""
    return np.sqrt(integral / duration) if duration else np.full_like(integral, np.nan)
