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
        ends = _RANGE.fullmatch(text.strip())
        words = text.split(",") if ends is None else [ends["low"], ends["high"]]
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            to_one = _TO_ONE.fullmatch(text)
            hint = f"; write {to_one['ratio']}" if to_one else ""
            raise InputError.one(f"{FORM}, found {text!r}{hint}") from None
        for word, number in zip(words, numbers, strict=True):
            if not 0 < number < math.inf:
                raise InputError.one(f"gear ratios must be positive and finite, not {word.strip()}")
        if ends is None:
            return cls(listed=tuple(sorted(set(numbers))))
        low, high = numbers
        if low > high:
            upward = "..".join(word.strip() for word in reversed(words))
            raise InputError.one(f"{text!r} runs downward; write {upward}")
        return cls(low=low, high=high)


def gears_of_joints(texts: Sequence[str], joints: Sequence[str]) -> dict[str, Gears]:
    """Return the gears of each joint.

    Args:
        texts: texts for `Gears.read`, for all joints, or preceded by a joint as in `slide=500..3000`.
        joints: names of the joints.

    Raises:
        InputError: a text is invalid, names an unknown joint, or gives gears a second time.
    """
    common: Gears | None = None
    found: dict[str, Gears] = {}
    for text in texts:
        name, equals, ratios = (part.strip() for part in text.rpartition("="))
        gears = Gears.read(ratios)
        if equals and name not in joints:
            raise InputError.one(f"{text}: there is no joint {name!r}{did_you_mean(name, joints)}")
        if name in found or (not equals and common is not None):
            raise InputError.one(f"{text}: the gears of {name or 'all joints'} were given already")
        if equals:
            found[name] = gears
        else:
            common = gears
    return {joint: found.get(joint, common or Gears()) for joint in joints}


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
        inside = np.minimum(np.maximum(ratio, self.low), self.high)
        finite = np.where((inside > 0) & (inside < math.inf), inside, np.where(self.low > 0, self.low, 1.0))
        return np.minimum(finite, self.high)


def shares(demand: MotorDemand, shafts: Shaft, ratio: FloatArray) -> FloatArray:
    """Return the used shares of `LIMITS`, (motors, limits), 0 for infinite limits.

    Args:
        demand: demand on the motor.
        shafts: motors to compare.
        ratio: gear ratios, (motors,).
    """
    torque, voltage = _peak_torque_and_voltage(demand, shafts, ratio)
    used = (torque, rms_torque(demand, shafts, ratio), demand.top_speed * ratio, voltage)
    bounds = shafts.bounds.values()
    return np.stack([each / bound for each, bound in zip(used, bounds, strict=True)], axis=-1)


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
    of_voltage = shafts.volts_per_torque[:, None] * coefficients
    of_voltage[:, 1] += shafts.volts_per_speed * ratio

    def of_motors(part: slice) -> tuple[FloatArray, ...]:
        return tuple(np.abs(each[part] @ demand.signals).max(axis=1) for each in (coefficients, of_voltage))

    torque, voltage = _in_parts(of_motors, len(coefficients), demand)
    return torque, voltage


def _mean_product(one: FloatArray, moments: FloatArray, other: FloatArray) -> FloatArray:
    """Return mean products of torques, (motors,), from their coefficients."""
    return np.asarray(np.einsum("mi,ij,mj->m", one, moments, other))


def ratios_within(demand: MotorDemand, shafts: Shaft) -> Ratios:
    """Return the ratios at which motors keep all their limits."""
    found = Ratios(np.zeros_like(shafts.inertia), np.full_like(shafts.inertia, math.inf))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = found._replace(high=shafts.max_velocity / np.float64(demand.top_speed))
        found = found._replace(high=np.where(np.isnan(found.high), math.inf, found.high))
        inertial, frictional, loaded = shafts.inertial, shafts.frictional, shafts.loaded
        found = found.within(_peak_within(demand, (inertial, frictional, loaded), shafts.max_torque))
        inertial, frictional, loaded = (
            shafts.volts_per_torque[:, None] * each for each in (inertial, frictional, loaded)
        )
        inertial[:, 1] += shafts.volts_per_speed
        found = found.within(_peak_within(demand, (inertial, frictional, loaded), shafts.max_voltage))
    return found.within(_rms_within(demand, shafts, shafts.continuous_torque))


def _peak_within(
    demand: MotorDemand, coefficients: tuple[FloatArray, FloatArray, FloatArray], bound: FloatArray
) -> Ratios:
    """Return the ratios at which |A n + C + B/n| is at most a bound at every sample."""

    def of_motors(part: slice) -> tuple[FloatArray, FloatArray]:
        a, c, b = (each[part] @ demand.signals for each in coefficients)
        upper, lower = (_below(sign * a, sign * c - bound[part, None], sign * b) for sign in (1, -1))
        both = upper.within(lower)
        return both.low.max(axis=1), both.high.min(axis=1)

    return Ratios(*_in_parts(of_motors, len(bound), demand))


def _below(square: FloatArray, linear: FloatArray, constant: FloatArray) -> Ratios:
    """Return the range of n > 0 with square n^2 + linear n + constant <= 0; empty if linear > 0."""
    # the root with the plus sign has no cancellation; the other one follows from the product of both
    discriminant = linear * linear - 4 * square * constant
    numerator = (np.sqrt(discriminant) - linear) / 2
    nowhere = (linear > 0) | ((discriminant < 0) & (square > 0))
    low = np.where(constant > 0, constant / numerator, 0.0)
    return Ratios(np.where(nowhere, math.inf, low), np.where(square > 0, numerator / square, math.inf))


def least_rms(demand: MotorDemand, shafts: Shaft) -> FloatArray:
    """Return the ratios at which the rms torque is smallest, (motors,).

    A ratio is 0 or infinite if the rms torque decreases towards that end.
    """
    moments = demand.moments
    inertial, frictional, loaded = shafts.inertial, shafts.frictional, shafts.loaded
    fourth, third = (_mean_product(inertial, moments, each) for each in (inertial, frictional))
    first, last = (_mean_product(each, moments, loaded) for each in (frictional, loaded))

    def rising(ratio: FloatArray) -> BoolArray:
        slope = (fourth * ratio + third) * ratio - (first + last / ratio) / ratio
        return slope > 0

    found = _turning_point(rising, np.full_like(fourth, LOWEST), np.full_like(fourth, HIGHEST))
    return _unbounded(found)


def _unbounded(ratio: FloatArray) -> FloatArray:
    """Return ratios, replaced by 0 or infinity at the ends of the searched range."""
    return np.where(ratio <= 2 * LOWEST, 0.0, np.where(ratio >= HIGHEST / 2, math.inf, ratio))


def _rms_within(demand: MotorDemand, shafts: Shaft, bound: FloatArray) -> Ratios:
    """Return the ratios at which the rms torque is at most a bound."""
    best = np.clip(least_rms(demand, shafts), LOWEST, HIGHEST)

    def allowed(ratio: FloatArray) -> BoolArray:
        return rms_torque(demand, shafts, ratio) <= bound

    lowest, highest = np.full_like(best, LOWEST), np.full_like(best, HIGHEST)
    low = np.where(allowed(lowest), 0.0, _turning_point(allowed, lowest, best))
    above = _turning_point(lambda ratio: ~allowed(ratio), best, highest)
    high = np.where(allowed(highest), math.inf, above)
    return Ratios(np.where(allowed(best), low, math.inf), high)


def _turning_point(
    turned: Callable[[FloatArray], BoolArray], low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return the ratio at which a condition becomes true, between two ratios; it is false at the first."""
    low, high = np.log(low), np.log(high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        beyond = turned(np.exp(middle))
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
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
    at_left, at_right = largest(left), largest(right)
    for _ in range(SECTIONS):
        falls = at_left > at_right
        low, high = np.where(falls, left, low), np.where(falls, high, right)
        new = np.where(falls, low + GOLDEN * (high - low), high - GOLDEN * (high - low))
        at_new = largest(new)
        left, right = np.where(falls, right, new), np.where(falls, new, left)
        at_left, at_right = np.where(falls, at_right, at_new), np.where(falls, at_new, at_left)
    return _unbounded(np.exp((low + high) / 2))


def _in_parts(
    compute: Callable[[slice], tuple[FloatArray, ...]], motors: int, demand: MotorDemand
) -> tuple[FloatArray, ...]:
    """Compute values for a part of the motors at a time; return those of all."""
    size = max(1, SOLUTIONS_AT_A_TIME // demand.signals.shape[1])
    parts = [compute(slice(start, start + size)) for start in range(0, motors, size)]
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))
