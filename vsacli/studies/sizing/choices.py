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
    has_resistances = all(motor.resistance is not None for motor in motors)
    return "copper_loss" if has_resistances else "utilization"


MAX_LISTED_MOTORS = 5
"""Largest number of motors that a message lists."""


def check_criterion(criterion: str, motors: Sequence[CatalogMotor], path: str) -> None:
    """Check that all motors of a catalog have the value that a criterion needs.

    Raises:
        InputError: some motors lack it; the error names them.
    """
    required_value = {"copper_loss": "resistance", "mass": "mass"}.get(criterion)
    incomplete_names = [
        motor.name for motor in motors if required_value and getattr(motor, required_value) is None
    ]
    if incomplete_names:
        several = (
            f"{counted(len(incomplete_names), 'motor')} {'lacks' if len(incomplete_names) == 1 else 'lack'}"
        )
        reason = (
            f"needs the column {required_value} in {path}, which {several} "
            f"({listed(incomplete_names, MAX_LISTED_MOTORS)})"
        )
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
    possible_ratios = ratios_within(demand, shafts)
    trials = _trials(demand, motors, shafts, possible_ratios, gears, criterion)
    cost = trials.largest if criterion == "utilization" else trials.rms
    ranking = np.where(trials.does.any(axis=0), np.where(trials.does, cost, np.inf), trials.largest)
    best_trials = ranking.argmin(axis=0)
    best_choices = [
        _best_choice(motor, trials, (int(best_trials[index]), index), possible_ratios, bool(gears.listed))
        for index, motor in enumerate(motors)
    ]
    best_choices.sort(key=lambda choice: (not choice.does, cost_of(choice, criterion), choice.motor))
    return tuple(best_choices)


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
    possible_ratios: Ratios,
    gears: Gears,
    criterion: str,
) -> _Trials:
    """Return trials with the listed ratios, or the best of a range; motors keep their own gears."""
    own_ratios = np.array([math.nan if motor.gear_ratio is None else motor.gear_ratio for motor in motors])
    listed_ratios = [np.full_like(own_ratios, ratio) for ratio in gears.listed]
    free_ratios = listed_ratios or [_best_of_range(demand, shafts, possible_ratios, gears, criterion)]
    ratio_trials = [np.where(np.isnan(own_ratios), ratios, own_ratios) for ratios in free_ratios]
    used_shares = np.stack([shares(demand, shafts, ratios) for ratios in ratio_trials])
    largest = used_shares.max(axis=-1)
    rms = np.stack([rms_torque(demand, shafts, ratios) for ratios in ratio_trials])
    return _Trials(np.stack(ratio_trials), used_shares, largest, largest <= 1 + LIMIT_ROUNDING, rms)


def _best_of_range(
    demand: MotorDemand, shafts: Shaft, possible_ratios: Ratios, gears: Gears, criterion: str
) -> FloatArray:
    """Return the best ratio of each motor, (motors,); if none suffices, the one with the least violation."""
    gear_range = Ratios(
        np.full_like(possible_ratios.low, gears.low), np.full_like(possible_ratios.high, gears.high)
    )
    allowed_ratios = possible_ratios.within(gear_range)
    best_ratios = least_rms(demand, shafts)
    if criterion == "utilization" or allowed_ratios.empty.any():
        balanced_ratios = balanced(demand, shafts, gear_range)
        best_ratios = (
            balanced_ratios
            if criterion == "utilization"
            else np.where(allowed_ratios.empty, balanced_ratios, best_ratios)
        )
    nearest_ratios = np.where(
        allowed_ratios.empty, gear_range.nearest(best_ratios), allowed_ratios.nearest(best_ratios)
    )
    return _rounded_ratios(nearest_ratios, allowed_ratios)


def _rounded_ratios(ratios: FloatArray, allowed_ratios: Ratios) -> FloatArray:
    """Return ratios rounded to `DIGITS`, unless rounding leaves the range."""
    rounded = np.array([float(f"{ratio:.{DIGITS}g}") for ratio in ratios])
    return np.where((rounded >= allowed_ratios.low) & (rounded <= allowed_ratios.high), rounded, ratios)


def _best_choice(
    motor: CatalogMotor, trials: _Trials, trial_index: tuple[int, int], possible_ratios: Ratios, listed: bool
) -> Choice:
    """Return the choice of a motor from its best trial."""
    _, index = trial_index
    ratio_range = (float(possible_ratios.low[index]), float(possible_ratios.high[index]))
    low, high = (math.nan, math.nan) if possible_ratios.empty[index] else ratio_range
    rms, shaft = float(trials.rms[trial_index]), motor.shaft
    sufficient_ratios = (
        trials.ratio[trials.does[:, index], index] if listed and motor.gear_ratio is None else []
    )
    return Choice(
        motor=motor.name,
        ratio=float(trials.ratio[trial_index]),
        does=bool(trials.does[trial_index]),
        low=low,
        high=high,
        ratios=tuple(map(float, sufficient_ratios)),
        shares={name: float(trials.used[trial_index][LIMITS.index(name)]) for name in shaft.limited},
        rms_torque=rms,
        copper_loss=float(shaft.heat_per_torque * rms**2),
        mass=motor.mass,
    )


def cost_of(choice: Choice, criterion: str) -> float:
    """Return the value of the criterion; for an insufficient choice, its largest share of a limit."""
    _, max_share = choice.largest
    cost_by_criterion = {
        "copper_loss": choice.copper_loss,
        "utilization": max_share,
        "mass": choice.mass or math.inf,
    }
    return cost_by_criterion[criterion] if choice.does else max_share


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
    is_buildable = _buildable_pairs(joint, *inertias)
    insufficient_counts, cost = (
        np.add.outer([not each.does for each in first], [not each.does for each in second]).astype(float),
        _pair_costs(first, second, criterion),
    )
    ranks = np.add.outer(np.arange(len(first)), np.arange(len(second)))
    order = np.lexsort([each.ravel() for each in (ranks, cost, insufficient_counts, ~is_buildable)])
    best_first, best_second = np.unravel_index(order[0], is_buildable.shape)
    return (
        tuple(each for each, fits in zip(first, is_buildable[:, best_second], strict=True) if fits),
        tuple(each for each, fits in zip(second, is_buildable[best_first], strict=True) if fits),
    )


def _buildable_pairs(joint: Joint, first: Sequence[float], second: Sequence[float]) -> BoolArray:
    """Return a mask of the pairs of joint-side rotor inertias that allow the coupled inertia."""
    coupled_inertia = joint.actuator.coupled_rotors
    max_coupling = np.array([[largest_coupling(one, other) for other in second] for one in first])
    is_buildable: BoolArray = abs(coupled_inertia) < max_coupling
    if not is_buildable.any():
        raise InputError.one(
            f"joint {joint.name}: coupled_inertia is {coupled_inertia:g} on the joint's side, "
            "that of rotors of the "
            f"catalog, with their best gears, must be below {max_coupling.max():.4g}; correct it, or offer "
            "heavier rotors or larger gears, and size again"
        )
    return is_buildable


def _pair_costs(first: Sequence[Choice], second: Sequence[Choice], criterion: str) -> FloatArray:
    costs = [[cost_of(each, criterion) for each in some] for some in (first, second)]
    combine = np.maximum if criterion == "utilization" else np.add
    return np.asarray(combine.outer(*costs), dtype=np.float64)
