"""Choice of motors and gears from a catalog for one motor of a robot, or for two with coupled rotors.

A coupled inertia on the joint side does not depend on the motors. With rotors too light for it, the inertia
matrix would not be positive definite, so the two motors of such a joint are chosen together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.drivetrain import largest_coupling
from vsacli.actuators.reach import LIMIT_ROUNDING
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.json_records import Published, named
from vsacli.base.texts import counted, listed
from vsacli.robot.joint import Joint
from vsacli.studies.sizing.catalog import LIMITS, CatalogMotor, Shaft
from vsacli.studies.sizing.demand import MotorDemand
from vsacli.studies.sizing.ratios import Gears, Ratios, balanced, least_rms, ratios_within, rms_torque, shares

CRITERIA = {
    "copper_loss": "least copper loss",
    "utilization": "smallest share of any limit",
    "mass": "least mass",
}
"""Criteria, and the text for each in reports."""

DIGITS = 4
"""Significant digits of a free gear ratio."""


@dataclass(frozen=True)
class Choice(Published):
    """A motor of the catalog in place of one of the robot.

    Attributes:
        motor: name of the motor.
        ratio: gear ratio: the best by the criterion, or if none suffices, that with the smallest violation.
        does: whether all limits are kept at this ratio.
        low, high: range of ratios at which all limits are kept; NaN if it is empty.
        ratios: listed ratios at which all limits are kept.
        shares: used share of each limit, by name.
        rms_torque: rms torque on the shaft, N m.
        copper_loss: mean copper loss, W; NaN if constants are unknown.
        mass: mass of the motor, kg; None if unknown.
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
        """Limit with the largest used share, and this share."""
        name = max(self.shares, key=lambda each: self.shares[each])
        return name, self.shares[name]


def usual_criterion(motors: Sequence[CatalogMotor]) -> str:
    """Return the default criterion: "copper_loss" if all resistances are known, otherwise "utilization"."""
    known = all(motor.resistance is not None for motor in motors)
    return "copper_loss" if known else "utilization"


MOST_NAMED = 5
"""Largest number of motors that a message lists."""


def check_criterion(criterion: str, motors: Sequence[CatalogMotor], path: str) -> None:
    """Check that all motors of a catalog have the value that a criterion needs.

    Raises:
        InputError: some motors lack it; the error names them.
    """
    needed = {"copper_loss": "resistance", "mass": "mass"}.get(criterion)
    lacking = [motor.name for motor in motors if needed and getattr(motor, needed) is None]
    if lacking:
        several = f"{counted(len(lacking), 'motor')} {'lacks' if len(lacking) == 1 else 'lack'}"
        reason = f"needs the column {needed} in {path}, which {several} ({listed(lacking, MOST_NAMED)})"
        raise InputError.one(f"minimizing {criterion} {reason}")


def choices(
    demand: MotorDemand, motors: Sequence[CatalogMotor], gears: Gears, criterion: str
) -> tuple[Choice, ...]:
    """Return every motor of a catalog with its best gear, sufficient ones first, sorted by the criterion.

    Args:
        demand: demand on the motor.
        motors: motors of the catalog.
        gears: gears for motors without their own.
        criterion: one of `CRITERIA`.
    """
    shafts = Shaft.of(motor.shaft for motor in motors)
    possible = ratios_within(demand, shafts)
    trials = _trials(demand, motors, shafts, possible, gears, criterion)
    cost = trials.largest if criterion == "utilization" else trials.rms
    ranked = np.where(trials.does.any(axis=0), np.where(trials.does, cost, np.inf), trials.largest)
    best = ranked.argmin(axis=0)
    found = [
        _best_choice(motor, trials, (int(best[index]), index), possible, bool(gears.listed))
        for index, motor in enumerate(motors)
    ]
    found.sort(key=lambda choice: (not choice.does, cost_of(choice, criterion), choice.motor))
    return tuple(found)


class _Trials(NamedTuple):
    """Combinations of motors and gear ratios, (trials, motors).

    Attributes:
        ratio: gear ratio.
        used: used share of each limit, (trials, motors, limits).
        largest: largest of these shares.
        does: whether all limits are kept.
        rms: rms torque on the shaft, N m.
    """

    ratio: FloatArray
    used: FloatArray
    largest: FloatArray
    does: BoolArray
    rms: FloatArray


def _trials(
    demand: MotorDemand,
    motors: Sequence[CatalogMotor],
    shafts: Shaft,
    possible: Ratios,
    gears: Gears,
    criterion: str,
) -> _Trials:
    """Return trials with the listed ratios, or the best of a range; motors keep their own gears."""
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
    """Return the best ratio of each motor, (motors,); if none suffices, the one with the least violation."""
    ends = Ratios(np.full_like(possible.low, gears.low), np.full_like(possible.high, gears.high))
    within = possible.within(ends)
    wanted = least_rms(demand, shafts)
    if criterion == "utilization" or within.empty.any():
        balance = balanced(demand, shafts, ends)
        wanted = balance if criterion == "utilization" else np.where(within.empty, balance, wanted)
    found = np.where(within.empty, ends.nearest(wanted), within.nearest(wanted))
    return _rounded_ratios(found, within)


def _rounded_ratios(ratios: FloatArray, within: Ratios) -> FloatArray:
    """Return ratios rounded to `DIGITS`, unless rounding leaves the range."""
    short = np.array([float(f"{ratio:.{DIGITS}g}") for ratio in ratios])
    return np.where((short >= within.low) & (short <= within.high), short, ratios)


def _best_choice(
    motor: CatalogMotor, trials: _Trials, place: tuple[int, int], possible: Ratios, listed: bool
) -> Choice:
    """Return the choice of a motor from its best trial."""
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


def cost_of(choice: Choice, criterion: str) -> float:
    """Return the value of the criterion; for an insufficient choice, its largest share of a limit."""
    _, largest = choice.largest
    wanted = {"copper_loss": choice.copper_loss, "utilization": largest, "mass": choice.mass or math.inf}
    return wanted[criterion] if choice.does else largest


def coupled_choices(
    joint: Joint,
    first: Sequence[Choice],
    second: Sequence[Choice],
    motors: Mapping[str, CatalogMotor],
    criterion: str,
) -> tuple[tuple[Choice, ...], tuple[Choice, ...]]:
    """Return the choices for each motor of a joint that can be coupled with the best choice for the other.

    The best of the possible pairs has the most sufficient motors, then the smallest criterion: the sum over
    both motors, or the larger share of a limit.

    Args:
        joint: joint with a coupled inertia.
        first: choices for motor 1, the best first.
        second: choices for motor 2, the best first.
        motors: motors of the catalog, by name.
        criterion: criterion by which they are sorted.

    Raises:
        InputError: no two rotors are heavy enough.
    """
    inertias = [[motors[each.motor].inertia * each.ratio**2 for each in some] for some in (first, second)]
    possible = _buildable(joint, *inertias)
    lacking, cost = (
        np.add.outer([not each.does for each in first], [not each.does for each in second]).astype(float),
        _pair_costs(first, second, criterion),
    )
    ranks = np.add.outer(np.arange(len(first)), np.arange(len(second)))
    order = np.lexsort([each.ravel() for each in (ranks, cost, lacking, ~possible)])
    one, other = np.unravel_index(order[0], possible.shape)
    return (
        tuple(each for each, fits in zip(first, possible[:, other], strict=True) if fits),
        tuple(each for each, fits in zip(second, possible[one], strict=True) if fits),
    )


def _buildable(joint: Joint, first: Sequence[float], second: Sequence[float]) -> BoolArray:
    """Return a mask of the pairs of joint-side rotor inertias that allow the coupled inertia."""
    coupled = joint.actuator.coupled_rotors
    largest = np.array([[largest_coupling(one, other) for other in second] for one in first])
    possible: BoolArray = abs(coupled) < largest
    if not possible.any():
        raise InputError.one(
            f"joint {joint.name}: coupled_inertia is {coupled:g} on the joint's side, that of rotors of the "
            f"catalog, with their best gears, must be below {largest.max():.4g}; correct it, or offer "
            "heavier rotors or larger gears, and size again"
        )
    return possible


def _pair_costs(first: Sequence[Choice], second: Sequence[Choice], criterion: str) -> FloatArray:
    costs = [[cost_of(each, criterion) for each in some] for some in (first, second)]
    together = np.maximum if criterion == "utilization" else np.add
    return np.asarray(together.outer(*costs), dtype=np.float64)
