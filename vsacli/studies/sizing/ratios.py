"""Gear ratios that motors may be combined with, and those within all limits of a motor.

At each sample, torque and voltage have the form A n + C + B/n in the ratio n. The ratios at which its
absolute value is at most T lie between roots of two quadratic equations; the intersection over all samples is
an interval. Speed bounds it from above. The mean square torque decreases to its only minimum and then
increases, so that bisection finds where it reaches its bound. (It could have two minima only if friction
opposed the acceleration more than it supports it: for a motion that begins faster than it ends, and a motor
loaded by hardly anything but its friction.)
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.studies.sizing.catalog import Shaft
from vsacli.studies.sizing.demand import MotorDemand

_RANGE = re.compile(r"(?P<low>[^,]+?)\s*\.\.\s*(?P<high>[^,]+)")
_TO_ONE = re.compile(r"\s*(?P<ratio>\d+(\.\d+)?)\s*:\s*1\s*")
FORM = "expected ratios such as 50,80,100 or a range such as 30..160"


class Gears(NamedTuple):
    """Positive gear ratios that a motor may be combined with; rad/m at a prismatic joint.

    Attributes:
        listed: available ratios; empty for a range.
        low, high: ends of the range.
    """

    listed: tuple[float, ...] = ()
    low: float = 0.0
    high: float = math.inf

    @classmethod
    def read(cls, text: str) -> Self:
        """Parse ratios such as `50,80,100`, or a range such as `30..160`.

        Raises:
            InputError: the text is neither.
        """
        range_match = _RANGE.fullmatch(text.strip())
        words = text.split(",") if range_match is None else [range_match["low"], range_match["high"]]
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            to_one = _TO_ONE.fullmatch(text)
            hint = f"; write {to_one['ratio']}" if to_one else ""
            raise InputError.one(f"{FORM}, found {text!r}{hint}") from None
        for word, number in zip(words, numbers, strict=True):
            if not 0 < number < math.inf:
                raise InputError.one(f"gear ratios must be positive and finite, not {word.strip()}")
        if range_match is None:
            return cls(listed=tuple(sorted(set(numbers))))
        low, high = numbers
        if low > high:
            ascending = "..".join(word.strip() for word in reversed(words))
            raise InputError.one(f"{text!r} runs downward; write {ascending}")
        return cls(low=low, high=high)


def gears_of_joints(texts: Sequence[str], joints: Sequence[str]) -> dict[str, Gears]:
    """Return the gears of each joint.

    Args:
        texts: texts for `Gears.read`, for all joints, or preceded by a joint as in `slide=500..3000`.
        joints: names of the joints.

    Raises:
        InputError: a text is invalid, names an unknown joint, or gives gears a second time.
    """
    common_gears: Gears | None = None
    gears_by_joint: dict[str, Gears] = {}
    for text in texts:
        name, equals, ratios = (part.strip() for part in text.rpartition("="))
        gears = Gears.read(ratios)
        if equals and name not in joints:
            raise InputError.one(f"{text}: there is no joint {name!r}{did_you_mean(name, joints)}")
        if name in gears_by_joint or (not equals and common_gears is not None):
            raise InputError.one(f"{text}: the gears of {name or 'all joints'} were given already")
        if equals:
            gears_by_joint[name] = gears
        else:
            common_gears = gears
    return {joint: gears_by_joint.get(joint, common_gears or Gears()) for joint in joints}


LOWEST, HIGHEST = 1e-9, 1e9
"""Range of the search for a ratio; rad/m at a prismatic joint."""

HALVINGS = 64
"""Bisections of the log of the ratio, from the whole range to the last digit."""

GOLDEN = (math.sqrt(5) - 1) / 2
SECTIONS = 40
"""Golden sections of the log of the ratio: 0.618^40 of the whole range is 2e-7 of the ratio."""

SOLUTIONS_AT_A_TIME = 2_000_000
"""Number of pairs of a motor and a sample computed together, about 16 MB per array."""


class Ratios(NamedTuple):
    """Ranges of gear ratios, one for each motor, (motors,); empty where `low` is above `high`."""

    low: FloatArray
    high: FloatArray

    def within(self, other: Ratios) -> Ratios:
        """Return the intersection of both ranges."""
        return Ratios(np.maximum(self.low, other.low), np.minimum(self.high, other.high))

    @property
    def empty(self) -> BoolArray:
        """Mask of empty ranges, (motors,)."""
        return ~(self.low <= self.high)

    def nearest(self, ratio: FloatArray) -> FloatArray:
        """Return the nearest ratio in each range; zero and infinity become an end of the range, or 1."""
        clipped = np.minimum(np.maximum(ratio, self.low), self.high)
        finite = np.where(
            (clipped > 0) & (clipped < math.inf), clipped, np.where(self.low > 0, self.low, 1.0)
        )
        return np.minimum(finite, self.high)


def shares(demand: MotorDemand, shafts: Shaft, ratio: FloatArray) -> FloatArray:
    """Return the used shares of `LIMITS`, (motors, limits), 0 for infinite limits.

    Args:
        demand: demand on the motor.
        shafts: motors to compare.
        ratio: gear ratios, (motors,).
    """
    torque, voltage = _peak_torque_and_voltage(demand, shafts, ratio)
    used_values = (torque, rms_torque(demand, shafts, ratio), demand.top_speed * ratio, voltage)
    bounds = shafts.bounds.values()
    return np.stack([each / bound for each, bound in zip(used_values, bounds, strict=True)], axis=-1)


def rms_torque(demand: MotorDemand, shafts: Shaft, ratio: FloatArray) -> FloatArray:
    """Return the rms over time of torques on shafts, (motors,)."""
    coefficients = shafts.coefficients(ratio)
    square = _mean_product(coefficients, demand.moments, coefficients)
    return np.sqrt(np.maximum(square, 0.0))  # if load and rotor cancel, rounding may leave a negative value


def _peak_torque_and_voltage(
    demand: MotorDemand, shafts: Shaft, ratio: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the largest |torque| and |voltage|, each (motors,)."""
    coefficients = shafts.coefficients(ratio)
    voltage_coefficients = shafts.volts_per_torque[:, None] * coefficients
    voltage_coefficients[:, 1] += shafts.volts_per_speed * ratio

    def of_motors(part: slice) -> tuple[FloatArray, ...]:
        return tuple(
            np.abs(each[part] @ demand.signals).max(axis=1) for each in (coefficients, voltage_coefficients)
        )

    torque, voltage = _computed_in_parts(of_motors, len(coefficients), demand)
    return torque, voltage


def _mean_product(one: FloatArray, moments: FloatArray, other: FloatArray) -> FloatArray:
    """Return mean products of torques, (motors,), from their coefficients."""
    return np.asarray(np.einsum("mi,ij,mj->m", one, moments, other))


def ratios_within(demand: MotorDemand, shafts: Shaft) -> Ratios:
    """Return the ratios at which motors keep all their limits."""
    allowed = Ratios(np.zeros_like(shafts.inertia), np.full_like(shafts.inertia, math.inf))
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = allowed._replace(high=shafts.max_velocity / np.float64(demand.top_speed))
        allowed = allowed._replace(high=np.where(np.isnan(allowed.high), math.inf, allowed.high))
        inertial, frictional, loaded = shafts.inertial, shafts.frictional, shafts.loaded
        allowed = allowed.within(_peak_within(demand, (inertial, frictional, loaded), shafts.max_torque))
        inertial, frictional, loaded = (
            shafts.volts_per_torque[:, None] * each for each in (inertial, frictional, loaded)
        )
        inertial[:, 1] += shafts.volts_per_speed
        allowed = allowed.within(_peak_within(demand, (inertial, frictional, loaded), shafts.max_voltage))
    return allowed.within(_rms_within(demand, shafts, shafts.continuous_torque))


def _peak_within(
    demand: MotorDemand, coefficients: tuple[FloatArray, FloatArray, FloatArray], bound: FloatArray
) -> Ratios:
    """Return the ratios at which |A n + C + B/n| is at most a bound at every sample."""

    def of_motors(part: slice) -> tuple[FloatArray, FloatArray]:
        a, c, b = (each[part] @ demand.signals for each in coefficients)
        upper, lower = (
            _nonpositive_range(sign * a, sign * c - bound[part, None], sign * b) for sign in (1, -1)
        )
        intersection = upper.within(lower)
        return intersection.low.max(axis=1), intersection.high.min(axis=1)

    return Ratios(*_computed_in_parts(of_motors, len(bound), demand))


def _nonpositive_range(square: FloatArray, linear: FloatArray, constant: FloatArray) -> Ratios:
    """Return the range of n > 0 with square n^2 + linear n + constant <= 0; empty if linear > 0."""
    # the root with the plus sign has no cancellation; the other one follows from the product of both
    discriminant = linear * linear - 4 * square * constant
    numerator = (np.sqrt(discriminant) - linear) / 2
    is_empty = (linear > 0) | ((discriminant < 0) & (square > 0))
    low = np.where(constant > 0, constant / numerator, 0.0)
    return Ratios(np.where(is_empty, math.inf, low), np.where(square > 0, numerator / square, math.inf))


def least_rms(demand: MotorDemand, shafts: Shaft) -> FloatArray:
    """Return the ratios at which the rms torque is smallest, (motors,).

    A ratio is 0 or infinite if the rms torque decreases towards that end.
    """
    moments = demand.moments
    inertial, frictional, loaded = shafts.inertial, shafts.frictional, shafts.loaded
    quadratic, linear = (_mean_product(inertial, moments, each) for each in (inertial, frictional))
    inverse, inverse_square = (_mean_product(each, moments, loaded) for each in (frictional, loaded))

    def rising(ratio: FloatArray) -> BoolArray:
        slope = (quadratic * ratio + linear) * ratio - (inverse + inverse_square / ratio) / ratio
        return slope > 0

    minimum = _bisect_condition(rising, np.full_like(quadratic, LOWEST), np.full_like(quadratic, HIGHEST))
    return _with_open_ends(minimum)


def _with_open_ends(ratio: FloatArray) -> FloatArray:
    """Return ratios, replaced by 0 or infinity at the ends of the searched range."""
    return np.where(ratio <= 2 * LOWEST, 0.0, np.where(ratio >= HIGHEST / 2, math.inf, ratio))


def _rms_within(demand: MotorDemand, shafts: Shaft, bound: FloatArray) -> Ratios:
    """Return the ratios at which the rms torque is at most a bound."""
    best_ratios = np.clip(least_rms(demand, shafts), LOWEST, HIGHEST)

    def allowed(ratio: FloatArray) -> BoolArray:
        return rms_torque(demand, shafts, ratio) <= bound

    min_ratios, max_ratios = np.full_like(best_ratios, LOWEST), np.full_like(best_ratios, HIGHEST)
    low = np.where(allowed(min_ratios), 0.0, _bisect_condition(allowed, min_ratios, best_ratios))
    upper_bound = _bisect_condition(lambda ratio: ~allowed(ratio), best_ratios, max_ratios)
    high = np.where(allowed(max_ratios), math.inf, upper_bound)
    return Ratios(np.where(allowed(best_ratios), low, math.inf), high)


def _bisect_condition(
    condition: Callable[[FloatArray], BoolArray], low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return the ratio at which a condition becomes true, between two ratios; it is false at the first."""
    low, high = np.log(low), np.log(high)
    for _ in range(HALVINGS):
        midpoint = (low + high) / 2
        is_true = condition(np.exp(midpoint))
        low, high = np.where(is_true, low, midpoint), np.where(is_true, midpoint, high)
    return np.exp((low + high) / 2)


def balanced(demand: MotorDemand, shafts: Shaft, allowed: Ratios) -> FloatArray:
    """Return the allowed ratios that minimize the largest share of a limit, (motors,), by golden section.

    The largest share decreases up to that ratio and then increases. A ratio is 0 or infinite if the share
    decreases towards that end.
    """

    def largest(logarithm: FloatArray) -> FloatArray:
        return np.asarray(shares(demand, shafts, np.exp(logarithm)).max(axis=-1))

    low, high = (np.log(np.clip(end, LOWEST, HIGHEST)) for end in allowed)
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    left_share, right_share = largest(left), largest(right)
    for _ in range(SECTIONS):
        is_falling = left_share > right_share
        low, high = np.where(is_falling, left, low), np.where(is_falling, high, right)
        next_ratio = np.where(is_falling, low + GOLDEN * (high - low), high - GOLDEN * (high - low))
        next_share = largest(next_ratio)
        left, right = np.where(is_falling, right, next_ratio), np.where(is_falling, next_ratio, left)
        left_share, right_share = (
            np.where(is_falling, right_share, next_share),
            np.where(is_falling, next_share, left_share),
        )
    return _with_open_ends(np.exp((low + high) / 2))


def _computed_in_parts(
    compute: Callable[[slice], tuple[FloatArray, ...]], motors: int, demand: MotorDemand
) -> tuple[FloatArray, ...]:
    """Compute values for a part of the motors at a time; return those of all."""
    part_size = max(1, SOLUTIONS_AT_A_TIME // demand.signals.shape[1])
    parts = [compute(slice(start, start + part_size)) for start in range(0, motors, part_size)]
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))
