"""How much a setting scales the springs: K(s) > 0 with two derivatives, monotone over the settings."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np

from vsacli.actuators.mechanisms.ratios.increasing_root import increasing_root
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.lazy import LazyRegistry
from vsacli.compute.control_flow import Values
from vsacli.documents.fields import NON_ZERO, check_fields, number
from vsacli.documents.source import Source

SETTINGS = 2001
"""Points of the range at which the scale is looked at; neither a power nor four of them turns faster."""


class Scale(NamedTuple):
    """The scale K(s), its slope K' and its curvature K'', arrays of one shape."""

    value: FloatArray
    slope: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class ScaleLaw(ABC):
    """K(s) of a variable ratio, a frozen dataclass of declared fields."""

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files that it was read from."""
        return ()

    @abstractmethod
    def at(self, s: FloatArray) -> Scale:
        """K with its derivatives at settings."""

    def setting(self, scale: FloatArray, settings: tuple[float, float]) -> FloatArray:
        """The setting in a range at which K has a value."""
        low, high = (np.full_like(scale, end) for end in settings)
        first, last = self.at(np.array(settings, dtype=float)).value.tolist()
        sign = math.copysign(1.0, last - first)

        def missing(s: FloatArray, wanted: FloatArray) -> Values:
            value, slope, curvature = self.at(s)
            return sign * (value - wanted), sign * slope, sign * curvature

        start = low + (scale - first) * ((settings[1] - settings[0]) / (last - first))
        return increasing_root(missing, low, high, start, (scale,))

    def problems(self, settings: tuple[float, float]) -> Iterator[str]:
        """Why it is none for a range of settings."""
        s = np.linspace(*settings, SETTINGS)
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

    A length, or a number of coils, and what a spring makes of it: exponent 2 for the arm of a lever, -1 for
    the active coils of a jack spring, -3 for the free length of a leaf spring.
    """

    exponent: float = number(units.DIMENSIONLESS, "power of the length", check=NON_ZERO)
    lead: float = number(units.INVERSE_POSITION, "length that theta_2 adds", check=NON_ZERO, default=1.0)
    offset: float = number(units.DIMENSIONLESS, "length where theta_2 is zero", default=0.0)

    def at(self, s: FloatArray) -> Scale:
        """K with its derivatives."""
        length = self.offset + self.lead * s
        scale = length**self.exponent
        slope = self.exponent * self.lead * scale / length
        return Scale(scale, slope, (self.exponent - 1) * self.lead * slope / length)

    def setting(self, scale: FloatArray, _settings: tuple[float, float]) -> FloatArray:
        """The root of K."""
        return (scale ** (1 / self.exponent) - self.offset) / self.lead


@dataclass(frozen=True)
class PolynomialScale(ScaleLaw):
    """K = c0 + c1 theta_2 + c2 theta_2^2 + c3 theta_2^3 + c4 theta_2^4."""

    c0: float = number(units.DIMENSIONLESS, "scale where theta_2 is zero", default=0.0)
    c1: float = number(units.DIMENSIONLESS, "coefficient of theta_2", default=0.0)
    c2: float = number(units.DIMENSIONLESS, "coefficient of theta_2^2", default=0.0)
    c3: float = number(units.DIMENSIONLESS, "coefficient of theta_2^3", default=0.0)
    c4: float = number(units.DIMENSIONLESS, "coefficient of theta_2^4", default=0.0)

    def at(self, s: FloatArray) -> Scale:
        """K with its derivatives, by Horner's scheme."""
        row = (self.c0, self.c1, self.c2, self.c3, self.c4)
        rate = tuple(power * each for power, each in enumerate(row))[1:]
        bent = tuple(power * each for power, each in enumerate(rate))[1:]
        value, slope, curvature = (
            reduce(lambda total, each: total * s + each, reversed(coefficients), np.zeros_like(s))
            for coefficients in (row, rate, bent)
        )
        return Scale(value, slope, curvature)


SCALES = LazyRegistry(
    {
        "power": "vsacli.actuators.mechanisms.ratios.scales:Power",
        "polynomial": "vsacli.actuators.mechanisms.ratios.scales:PolynomialScale",
        "table": "vsacli.actuators.mechanisms.ratios.measured_scale:MeasuredScale",
    }
)
"""Scales by the name they have in a robot file."""
