"""Gear ratios that motors may be combined with, and those within all limits of a motor.

At each step torque and voltage have the form A n + C + B/n in the ratio n. Where its size is at most T lies
between roots of two quadratic equations; what all steps leave is an interval. Speed bounds it from above. The
mean square of the torque falls towards its only minimum, and then rises, so that bisection finds where it is
as large as it may be. (It could have two minima only if friction did more against the acceleration than with
it: of a motion that begins faster than it ends, and a motor that hardly anything but its friction loads.)
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
from vsacli.studies.sizing.demand import MotorDemand
from vsacli.studies.sizing.shaft import Shaft

_RANGE = re.compile(r"(?P<low>[^,]+?)\s*\.\.\s*(?P<high>[^,]+)")
FORM = "expected ratios such as 50,80,100, or a range such as 30..160"


class Gears(NamedTuple):
    """Ratios that a motor may be combined with; all of them positive, rad/m at a prismatic joint.

    Attributes:
        listed: the ratios there are; empty if any between two ends may be.
        low, high: these ends.
    """

    listed: tuple[float, ...] = ()
    low: float = 0.0
    high: float = math.inf

    @classmethod
    def read(cls, text: str) -> Self:
        """Ratios such as `50,80,100`, or a range such as `30..160`.

        Raises:
            InputError: it is none of both.
        """
        ends = _RANGE.fullmatch(text.strip())
        words = text.split(",") if ends is None else [ends["low"], ends["high"]]
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            raise InputError.one(f"{FORM}, found {text!r}") from None
        if not all(0 < number < math.inf for number in numbers):
            raise InputError.one(f"gear ratios must be positive and finite, not {text!r}")
        if ends is None:
            return cls(listed=tuple(sorted(set(numbers))))
        low, high = numbers
        if low > high:
            raise InputError.one(f"the range {text!r} of gear ratios is empty; the smaller one comes first")
        return cls(low=low, high=high)


def gears_of_joints(texts: Sequence[str], joints: Sequence[str]) -> dict[str, Gears]:
    """Return the gears of each joint.

    Args:
        texts: as `Gears.read` takes them, for all joints, or as `slide=500..3000` for one of them.
        joints: their names.

    Raises:
        InputError: a text is no such thing, names no joint, or says twice what one has.
    """
    common: Gears | None = None
    found: dict[str, Gears] = {}
    for text in texts:
        name, equals, ratios = (part.strip() for part in text.rpartition("="))
        gears = Gears.read(ratios)
        if equals and name not in joints:
            raise InputError.one(f"{text!r}: there is no joint {name!r}{did_you_mean(name, joints)}")
        if name in found or (not equals and common is not None):
            raise InputError.one(f"{text!r}: the gears of {name or 'all joints'} were given already")
        if equals:
            found[name] = gears
        else:
            common = gears
    return {joint: found.get(joint, common or Gears()) for joint in joints}


LOWEST, HIGHEST = 1e-9, 1e9
"""Ratios between which one is looked for; rad/m at a prismatic joint."""

HALVINGS = 64
"""Bisections of the logarithm of the ratio, from the whole range to the last digit."""

GOLDEN = (math.sqrt(5) - 1) / 2
SECTIONS = 40
"""Sections of the logarithm of the ratio: 0.618^40 of the whole range are 2e-7 of the ratio."""

SOLUTIONS_AT_A_TIME = 2_000_000
"""Pairs of a motor and a step computed together, some 16 MB an array."""


class Ratios(NamedTuple):
    """Ranges of gear ratios, one of each motor, (motors,): none where `low` is above `high`."""

    low: FloatArray
    high: FloatArray

    def within(self, other: Ratios) -> Ratios:
        """Return the intersection of both ranges."""
        return Ratios(np.maximum(self.low, other.low), np.minimum(self.high, other.high))

    @property
    def empty(self) -> BoolArray:
        """Whether no ratio will do."""
        empty: BoolArray = ~(self.low <= self.high)
        return empty

    def nearest(self, ratio: FloatArray) -> FloatArray:
        """Return the ratio of a range that is nearest to one; values not finite become an end, or 1."""
        inside = np.minimum(np.maximum(ratio, self.low), self.high)
        finite = np.where((inside > 0) & (inside < math.inf), inside, np.where(self.low > 0, self.low, 1.0))
        nearest: FloatArray = np.minimum(finite, self.high)
        return nearest


def shares(demand: MotorDemand, shafts: Shaft, ratio: FloatArray) -> FloatArray:
    """Return the shares of `LIMITS` that motors use, (motors, limits), 0 where unbounded.

    Args:
        demand: on the motor.
        shafts: the motors.
        ratio: of their gears, (motors,).
    """
    torque, voltage = _peaks(demand, shafts, ratio)
    used = (torque, rms_torque(demand, shafts, ratio), demand.top_speed * ratio, voltage)
    bounds = shafts.bounds.values()
    return np.stack([each / bound for each, bound in zip(used, bounds, strict=True)], axis=-1)


def rms_torque(demand: MotorDemand, shafts: Shaft, ratio: FloatArray) -> FloatArray:
    """Root mean square over time of torques on shafts, (motors,)."""
    coefficients = shafts.coefficients(ratio)
    square = _mean_product(coefficients, demand.moments, coefficients)
    return np.sqrt(
        np.maximum(square, 0.0)
    )  # where load and rotor cancel, rounding may leave less than nothing


def _peaks(demand: MotorDemand, shafts: Shaft, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Largest |torque| and |voltage|, each (motors,)."""
    coefficients = shafts.coefficients(ratio)
    of_voltage = shafts.volts_per_torque[:, None] * coefficients
    of_voltage[:, 1] += shafts.volts_per_speed * ratio

    def of_motors(part: slice) -> tuple[FloatArray, ...]:
        return tuple(np.abs(each[part] @ demand.signals).max(axis=1) for each in (coefficients, of_voltage))

    torque, voltage = _in_parts(of_motors, len(coefficients), demand)
    return torque, voltage


def _mean_product(one: FloatArray, moments: FloatArray, other: FloatArray) -> FloatArray:
    """Means of products of torques, (motors,), from their coefficients."""
    mean: FloatArray = np.einsum("mi,ij,mj->m", one, moments, other)
    return mean


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
    """Return where square n^2 + linear n + constant <= 0 for n > 0; nowhere if linear > 0.

    The root with the plus sign is found without cancellation, the other one from the product of both.
    """
    discriminant = linear * linear - 4 * square * constant
    numerator = (np.sqrt(discriminant) - linear) / 2
    nowhere = (linear > 0) | ((discriminant < 0) & (square > 0))
    low = np.where(constant > 0, constant / numerator, 0.0)
    return Ratios(np.where(nowhere, math.inf, low), np.where(square > 0, numerator / square, math.inf))


def least_rms(demand: MotorDemand, shafts: Shaft) -> FloatArray:
    """Return the ratios at which the root mean square of the torque is smallest, (motors,).

    It is 0 or infinite where that becomes ever smaller.
    """
    moments = demand.moments
    inertial, frictional, loaded = shafts.inertial, shafts.frictional, shafts.loaded
    fourth, third = (_mean_product(inertial, moments, each) for each in (inertial, frictional))
    first, last = (_mean_product(each, moments, loaded) for each in (frictional, loaded))

    def rising(ratio: FloatArray) -> BoolArray:
        slope = (fourth * ratio + third) * ratio - (first + last / ratio) / ratio
        beyond: BoolArray = slope > 0
        return beyond

    found = _turning_point(rising, np.full_like(fourth, LOWEST), np.full_like(fourth, HIGHEST))
    return _unbounded(found)


def _unbounded(ratio: FloatArray) -> FloatArray:
    """Ratios, 0 or infinite at the ends of the searched range."""
    return np.where(ratio <= 2 * LOWEST, 0.0, np.where(ratio >= HIGHEST / 2, math.inf, ratio))


def _rms_within(demand: MotorDemand, shafts: Shaft, bound: FloatArray) -> Ratios:
    """Return the ratios at which the root mean square of the torque is at most a bound."""
    best = np.clip(least_rms(demand, shafts), LOWEST, HIGHEST)

    def allowed(ratio: FloatArray) -> BoolArray:
        within: BoolArray = rms_torque(demand, shafts, ratio) <= bound
        return within

    lowest, highest = np.full_like(best, LOWEST), np.full_like(best, HIGHEST)
    low = np.where(allowed(lowest), 0.0, _turning_point(allowed, lowest, best))
    above = _turning_point(lambda ratio: ~allowed(ratio), best, highest)
    high = np.where(allowed(highest), math.inf, above)
    return Ratios(np.where(allowed(best), low, math.inf), high)


def _turning_point(
    turned: Callable[[FloatArray], BoolArray], low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return where a condition becomes true between two ratios, at the first of which it is false."""
    low, high = np.log(low), np.log(high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        beyond = turned(np.exp(middle))
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.exp((low + high) / 2)


def balanced(demand: MotorDemand, shafts: Shaft, allowed: Ratios) -> FloatArray:
    """Return the allowed ratios with the smallest largest share of a limit, (motors,).

    By golden section: the largest share falls up to there, and then rises. It is 0 or infinite where that
    becomes ever smaller.
    """

    def largest(logarithm: FloatArray) -> FloatArray:
        share: FloatArray = shares(demand, shafts, np.exp(logarithm)).max(axis=-1)
        return share

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
    """Return values computed for some motors at a time, for all."""
    size = max(1, SOLUTIONS_AT_A_TIME // demand.signals.shape[1])
    parts = [compute(slice(start, start + size)) for start in range(0, motors, size)]
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))
