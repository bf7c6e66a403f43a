"""Scales of springs by a setting: K(s) > 0 with two derivatives, monotone, in closed form or measured."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.actuators.laws.law import SpringRecord
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.lazy import LazyRegistry
from vsacli.compute.control_flow import Values, look_up, repeat
from vsacli.compute.rounding import OfRounding
from vsacli.documents.fields import NON_ZERO, TablePath, number, value
from vsacli.documents.source import Source
from vsacli.documents.table import CsvTable

Function = Callable[..., Values]
"""Value, slope and curvature at (x, *constants), arrays of one shape."""

MAX_STEPS = 100
"""Largest number of steps: 60 bisections exhaust the digits, with a few Halley steps between them."""

SHORT_STEP = OfRounding(1e-5, power=1 / 3)
"""Step relative to x whose third power, the error after it, is rounding."""

REMAINING_ERROR = OfRounding(1e-17)
"""Error after a step, relative to x, below rounding: Newton step times Halley's correction squared. Where the
slope vanishes, as next to a fold, `SHORT_STEP` alone does not suffice."""


def increasing_root(
    function: Function, low: FloatArray, high: FloatArray, start: FloatArray, constants: Values
) -> FloatArray:
    """Return the zero of a function between `low` and `high`, to rounding; an end if it has none.

    Args:
        function: Function that increases between both ends.
        low: Smaller ends, (samples,).
        high: Larger ends.
        start: First guesses; the middle is taken where they do not lie between both.
        constants: Further arguments of the function, arrays (samples,).
    """

    def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
        x, low, high = state
        value, slope, curvature = function(x, *constants)
        newton = value / slope
        correction = newton * curvature / (2 * slope)
        target = x - newton / np.minimum(np.maximum(1 - correction, 0.5), 2)
        low, high = np.where(value <= 0, x, low), np.where(value >= 0, x, high)
        is_inside = (low <= target) & (target <= high)
        next_x = np.where(is_inside, target, (low + high) / 2)
        magnitude = np.abs(next_x)
        error = np.abs(newton) * (correction * correction)
        is_short = (np.abs(newton) <= SHORT_STEP * magnitude) & (error <= REMAINING_ERROR * magnitude)
        return (next_x, low, high), is_inside & is_short | ~(low < high)

    with np.errstate(all="ignore"):  # without slope, a step leads nowhere
        first = np.where((low < start) & (start < high), start, (low + high) / 2)
        return repeat(step, (first, low, high), constants, MAX_STEPS)[0]


SETTING_COUNT = 2001
"""Points of the range at which the scale is checked; neither a power nor a quartic changes faster."""


class ScaleDerivatives(NamedTuple):
    """The scale K(s), its slope K' and its curvature K'', arrays of one shape."""

    value: FloatArray
    slope: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class ScaleLaw(SpringRecord, ABC):
    """K(s) of a variable ratio, a frozen dataclass of declared fields."""

    @abstractmethod
    def at(self, s: FloatArray) -> ScaleDerivatives:
        """Return K with its derivatives at settings."""

    def setting(self, scale: FloatArray, settings: tuple[float, float]) -> FloatArray:
        """Return the setting in a range at which K has a value."""
        low, high = (np.full_like(scale, end) for end in settings)
        first, last = self.at(np.array(settings, dtype=float)).value.tolist()
        sign = math.copysign(1.0, last - first)

        def scale_error(s: FloatArray, target: FloatArray) -> Values:
            value, slope, curvature = self.at(s)
            return sign * (value - target), sign * slope, sign * curvature

        start = low + (scale - first) * ((settings[1] - settings[0]) / (last - first))
        return increasing_root(scale_error, low, high, start, (scale,))

    def problems(self, settings: tuple[float, float]) -> Iterator[str]:
        """Yield the reasons why the scale is invalid for a range of settings."""
        s = np.linspace(*settings, SETTING_COUNT)
        with np.errstate(all="ignore"):
            scale = self.at(s)
        if not (scale.value > 0).all():
            yield f"is not positive at theta_2 = {s[~(scale.value > 0)][0]:g}, which `setting` allows"
        elif not ((scale.slope > 0).all() or (scale.slope < 0).all()):
            turn = s[np.abs(scale.slope).argmin()]
            yield f"must rise or fall over all of `setting`; it has no slope near theta_2 = {turn:g}"


@dataclass(frozen=True)
class Power(ScaleLaw):
    """K = (offset + lead theta_2)^exponent.

    The base is a length or a number of coils: exponent 2 for the arm of a lever, -1 for the active coils of a
    jack spring, -3 for the free length of a leaf spring.
    """

    exponent: float = number(units.DIMENSIONLESS, "exponent of the length", check=NON_ZERO)
    lead: float = number(
        units.INVERSE_POSITION, "change of the length per theta_2", check=NON_ZERO, default=1.0
    )
    offset: float = number(units.DIMENSIONLESS, "length at theta_2 = 0", default=0.0)

    def at(self, s: FloatArray) -> ScaleDerivatives:
        """Return K with its derivatives."""
        length = self.offset + self.lead * s
        scale = length**self.exponent
        slope = self.exponent * self.lead * scale / length
        return ScaleDerivatives(scale, slope, (self.exponent - 1) * self.lead * slope / length)

    def setting(self, scale: FloatArray, _settings: tuple[float, float]) -> FloatArray:
        """Return the root of K."""
        return (scale ** (1 / self.exponent) - self.offset) / self.lead


@dataclass(frozen=True)
class PolynomialScale(ScaleLaw):
    """K = c0 + c1 theta_2 + c2 theta_2^2 + c3 theta_2^3 + c4 theta_2^4."""

    c0: float = number(units.DIMENSIONLESS, "scale at theta_2 = 0", default=0.0)
    c1: float = number(units.DIMENSIONLESS, "coefficient of theta_2", default=0.0)
    c2: float = number(units.DIMENSIONLESS, "coefficient of theta_2^2", default=0.0)
    c3: float = number(units.DIMENSIONLESS, "coefficient of theta_2^3", default=0.0)
    c4: float = number(units.DIMENSIONLESS, "coefficient of theta_2^4", default=0.0)

    def at(self, s: FloatArray) -> ScaleDerivatives:
        """Return K with its derivatives, by Horner's scheme."""
        row = (self.c0, self.c1, self.c2, self.c3, self.c4)
        slope_coefficients = tuple(power * coefficient for power, coefficient in enumerate(row))[1:]
        curvature_coefficients = tuple(
            power * coefficient for power, coefficient in enumerate(slope_coefficients)
        )[1:]
        value, slope, curvature = (
            reduce(
                lambda total, coefficient: total * s + coefficient, reversed(coefficients), np.zeros_like(s)
            )
            for coefficients in (row, slope_coefficients, curvature_coefficients)
        )
        return ScaleDerivatives(value, slope, curvature)


SCALES = LazyRegistry(
    {
        "power": "vsacli.actuators.mechanisms.ratios.scales:Power",
        "polynomial": "vsacli.actuators.mechanisms.ratios.scales:PolynomialScale",
        "table": "vsacli.actuators.mechanisms.ratios.scales:MeasuredScale",
    }
)
"""Scales by their name in a robot file."""


MIN_ROWS = 4
"""Smallest number of rows, those of one cubic."""


@dataclass(frozen=True)
class MeasuredScale(ScaleLaw):
    """The cubic spline through settings and scales; it must rise or fall throughout, noise must not show."""

    file: CsvTable = value(
        TablePath(("setting", "scale")),
        "CSV file with the header setting,scale, theta_2 in rad (m), path relative to the robot file",
    )

    @property
    def sources(self) -> tuple[Source, ...]:
        """The table."""
        return (self.file.source,)

    @cached_property
    def _pieces(self) -> tuple[FloatArray, ...]:
        """Start of each cubic, and its coefficients from the constant on, arrays (pieces,)."""
        settings, scales = self.file.values.T
        return (settings[:-1], *scipy.interpolate.CubicSpline(settings, scales).c[::-1])

    def at(self, s: FloatArray) -> ScaleDerivatives:
        """Return the spline with its derivatives."""
        piece = np.searchsorted(self._pieces[0][1:], s, side="right")
        start, a, b, c, d = look_up(self._pieces, piece)
        x = s - start
        return ScaleDerivatives(
            a + x * (b + x * (c + x * d)), b + x * (2 * c + x * (3 * d)), 2 * c + 6 * d * x
        )

    def problems(self, settings: tuple[float, float]) -> Iterator[str]:
        """Yield also the reasons why the table is too short for the range."""
        rows = self.file.values[:, 0]
        if len(rows) < MIN_ROWS or not (np.diff(rows) > 0).all():
            yield f"the table needs {MIN_ROWS} rows or more, whose settings increase"
        elif settings[0] < rows[0] or rows[-1] < settings[1]:
            yield f"the table goes from {rows[0]:g} to {rows[-1]:g}, `setting` farther"
        else:
            yield from super().problems(settings)
