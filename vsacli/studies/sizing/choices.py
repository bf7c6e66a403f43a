"""Motors of a catalogue with gears in the place of one of a robot: which of them do, the best first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.limit_check import LIMIT_ROUNDING
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.json_records import Published, named
from vsacli.studies.sizing.catalogue import CatalogueMotor
from vsacli.studies.sizing.gears import Gears
from vsacli.studies.sizing.motor_demand import MotorDemand
from vsacli.studies.sizing.ratios import Ratios, balanced, least_rms, ratios_within, rms_torque, shares
from vsacli.studies.sizing.shaft import LIMITS, Shaft

CRITERIA = {
    "copper": "least copper loss",
    "utilisation": "smallest share of any limit",
    "mass": "least mass",
}
"""What the best choice has, in words."""

DIGITS = 4
"""Of a gear ratio that may be any."""


@dataclass(frozen=True)
class Choice(Published):
    """A motor of the catalogue in the place of one of the robot.

    Attributes:
        motor: its name.
        ratio: of its gear: the best by the criterion, or that with which it comes nearest to its limits.
        does: whether all limits are kept with it.
        low, high: ratios between which they are; NaN if with none.
        ratios: of those that are listed, the ones with which it does.
        shares: what it uses of each limit, by name.
        rms_torque: on its shaft, N m.
        copper_loss: mean over time, W; NaN if constants are not known.
        mass: of the motor, kg; None if it is not known.
    """

    motor: str
    ratio: float
    does: bool
    low: float
    high: float
    ratios: tuple[float, ...]
    shares: dict[str, float]
    rms_torque: float
    copper_loss: float
    mass: float | None = None

    shape: ClassVar = {
        **named("motor", "ratio", "does", "low", "high"),
        "ratios?": "ratios",
        **named("shares", "rms_torque", "copper_loss"),
        "mass?": "mass",
    }

    @property
    def largest(self) -> tuple[str, float]:
        """The limit of which it uses most, and what share of it."""
        name = max(self.shares, key=lambda each: self.shares[each])
        return name, self.shares[name]


def usual_criterion(motors: Sequence[CatalogueMotor]) -> str:
    """The copper loss, if it is known of all motors."""
    known = all(motor.resistance is not None for motor in motors)
    return "copper" if known else "utilisation"


def check_criterion(criterion: str, motors: Sequence[CatalogueMotor]) -> None:
    """Refuse a criterion for which motors lack a number.

    Raises:
        InputError: naming the first of them.
    """
    needed = {"copper": "resistance", "mass": "mass"}.get(criterion)
    lacking = [motor.name for motor in motors if needed and getattr(motor, needed) is None]
    if lacking:
        more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        reason = f"needs the column {needed}, which {lacking[0]}{more} lacks"
        raise InputError.one(f"{CRITERIA[criterion]} {reason}")


def choices(
    demand: MotorDemand, motors: Sequence[CatalogueMotor], gears: Gears, criterion: str
) -> tuple[Choice, ...]:
    """Every motor of a catalogue with its best gear: those that do first, and the best of these first.

    Args:
        demand: what is asked of the motor.
        motors: those of the catalogue.
        gears: of those that have none of their own.
        criterion: one of `CRITERIA`.
    """
    shafts = Shaft.of(motor.shaft for motor in motors)
    possible = ratios_within(demand, shafts)
    trials = _trials(demand, motors, shafts, possible, gears, criterion)
    cost = trials.largest if criterion == "utilisation" else trials.rms
    ranked = np.where(trials.does.any(axis=0), np.where(trials.does, cost, np.inf), trials.largest)
    best = ranked.argmin(axis=0)
    found = [
        _choice(motor, trials, (int(best[index]), index), possible, bool(gears.listed))
        for index, motor in enumerate(motors)
    ]
    return tuple(sorted(found, key=lambda choice: _order(choice, criterion)))


class _Trials(NamedTuple):
    """Motors with gears that were tried; (trials, motors).

    Attributes:
        ratio: of the gear.
        used: of each limit, (trials, motors, limits).
        largest: the largest of these shares.
        does: whether all limits are kept.
        rms: of the torque on the shaft.
    """

    ratio: FloatArray
    used: FloatArray
    largest: FloatArray
    does: BoolArray
    rms: FloatArray


def _trials(
    demand: MotorDemand,
    motors: Sequence[CatalogueMotor],
    shafts: Shaft,
    possible: Ratios,
    gears: Gears,
    criterion: str,
) -> _Trials:
    """Each listed ratio, or of a range that with which a motor is best; but gears that motors have stay."""
    fixed = np.array([math.nan if motor.gear_ratio is None else motor.gear_ratio for motor in motors])
    listed = [np.full_like(fixed, ratio) for ratio in gears.listed]
    free = listed or [_best_of_range(demand, shafts, possible, gears, criterion)]
    tried = [np.where(np.isnan(fixed), ratios, fixed) for ratios in free]
    used = np.stack([shares(demand, shafts, ratios) for ratios in tried])
    largest = used.max(axis=-1)
    rms = np.stack([rms_torque(demand, shafts, ratios) for ratios in tried])
    return _Trials(np.stack(tried), used, largest, largest <= 1 + LIMIT_ROUNDING, rms)


def _best_of_range(
    demand: MotorDemand, shafts: Shaft, possible: Ratios, gears: Gears, criterion: str
) -> FloatArray:
    """The best ratio of each motor, (motors,); where none does, that with which it is nearest to it."""
    ends = Ratios(np.full_like(possible.low, gears.low), np.full_like(possible.high, gears.high))
    within = possible.within(ends)
    wanted = least_rms(demand, shafts)
    if criterion == "utilisation" or within.empty.any():
        balance = balanced(demand, shafts, ends)
        wanted = balance if criterion == "utilisation" else np.where(within.empty, balance, wanted)
    found = np.where(within.empty, ends.nearest(wanted), within.nearest(wanted))
    return _rounded(found, within)


def _rounded(ratios: FloatArray, within: Ratios) -> FloatArray:
    """Ratios with a few digits, if they stay within a range so."""
    short = np.array([float(f"{ratio:.{DIGITS}g}") for ratio in ratios])
    return np.where((short >= within.low) & (short <= within.high), short, ratios)


def _choice(
    motor: CatalogueMotor, trials: _Trials, place: tuple[int, int], possible: Ratios, listed: bool
) -> Choice:
    """A motor as it was best, in a trial."""
    _, index = place
    ends = (float(possible.low[index]), float(possible.high[index]))
    low, high = (math.nan, math.nan) if possible.empty[index] else ends
    rms, shaft = float(trials.rms[place]), motor.shaft
    doing = trials.ratio[trials.does[:, index], index] if listed and motor.gear_ratio is None else []
    return Choice(
        motor=motor.name,
        ratio=float(trials.ratio[place]),
        does=bool(trials.does[place]),
        low=low,
        high=high,
        ratios=tuple(map(float, doing)),
        shares={name: float(trials.used[place][LIMITS.index(name)]) for name in shaft.limited},
        rms_torque=rms,
        copper_loss=float(shaft.heat_per_torque * rms**2),
        mass=motor.mass,
    )


def _order(choice: Choice, criterion: str) -> tuple[bool, float, str]:
    """What choices are sorted by."""
    return not choice.does, cost_of(choice, criterion), choice.motor


def cost_of(choice: Choice, criterion: str) -> float:
    """Return what the best choice has least of; of one that does not do, its largest share of a limit."""
    _, largest = choice.largest
    wanted = {"copper": choice.copper_loss, "utilisation": largest, "mass": choice.mass or math.inf}
    return wanted[criterion] if choice.does else largest
