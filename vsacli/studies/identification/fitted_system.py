"""A fitted system of equations: its numbers within their bounds, and its residuals on held-out recordings."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache, partial
from typing import NamedTuple, Self

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.identification.conditioning import Signals, disturbed
from vsacli.studies.identification.estimation import Equations, Fit, gauss_newton

FEWEST_ROWS = 5
"""Equations to an unknown below which a record is too short to hold a part of it out."""


CERTAIN = 2.0
"""Standard errors by which a number must differ from that of the file to contradict it."""


class SystemOfEquations(ABC):
    """Numbers of a robot and the equations that tell of them.

    Attributes:
        title: whose numbers they are: the joint, or the links.
        names, units: of the numbers.
        sums: terms of each base parameter; "" for parameters of the robot file.
        before: their values by the robot file, (numbers,), SI units.
    """

    title: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sums: tuple[str, ...]
    before: FloatArray

    @abstractmethod
    def of_record(self, values: FloatArray, signals: Signals) -> Equations:
        """Return the equations of a recording at some values of the numbers, (numbers,)."""

    @abstractmethod
    def admissible(self, number: int, value: float) -> float | None:
        """Return the nearest value that a number may have; None if it is to stay as it was."""

    @abstractmethod
    def without(self, fixed: dict[int, float]) -> Self:
        """Return the same system with some numbers at given values, which are no longer unknown."""

    def equations(self, values: FloatArray, signals: Signals) -> Equations:
        """Return the equations of a recording, at the values found."""
        found = self.of_record(values, signals)
        if signals.noise is None:
            return found

        @cache
        def noise() -> tuple[FloatArray, FloatArray]:
            again = self.of_record(values, disturbed(signals))
            residuals = (each.measured - each.predicted for each in (again, found))
            return next(residuals) - next(residuals), again.slopes - found.slopes

        return found._replace(noise=noise)


class Bound(NamedTuple):
    """A number that came out as none that a robot has, so that it was set.

    Attributes:
        value: the held value.
        standard_error: of the result; NaN if the robot has nothing near it.
    """

    value: float
    standard_error: float


class Solution(NamedTuple):
    """A fitted system.

    Attributes:
        system: which it is.
        free: indices of its numbers that were fitted.
        fit: of these, in their order.
        bound: the others, by index.
    """

    system: SystemOfEquations
    free: tuple[int, ...]
    fit: Fit
    bound: dict[int, Bound]

    @property
    def predicting(self) -> FloatArray:
        """Values of all numbers that predict best."""
        values = self.system.before.copy()
        values[list(self.bound)] = [each.value for each in self.bound.values()]
        values[list(self.free)] = self.fit.solution
        return values

    def equations(self, signals: Signals) -> Equations:
        """Of a record, at the values found."""
        return self.system.equations(self.predicting, signals)


def solution(system: SystemOfEquations, records: Sequence[Signals]) -> Solution:
    """Fit, and again without numbers that come out as no robot has them, until all may be."""
    bound: dict[int, Bound] = {}
    while True:
        free = tuple(number for number in range(len(system.names)) if number not in bound)
        reduced = system.without({number: each.value for number, each in bound.items()}) if bound else system
        fit = gauss_newton(partial(_equations, reduced, records), reduced.before)
        further = {
            number: found
            for at, number in enumerate(free)
            if (found := _bound(system, number, float(fit.solution[at]), float(fit.standard_errors[at])))
        }
        if not further:
            return Solution(system, free, fit, bound)
        bound |= further


def _equations(system: SystemOfEquations, records: Sequence[Signals], values: FloatArray) -> list[Equations]:
    return [system.equations(values, each) for each in records]


def _bound(system: SystemOfEquations, number: int, value: float, error: float) -> Bound | None:
    """Return the value to hold a parameter at; None if its result is admissible, or it cannot be identified.

    It is held at the value of the file if the recording agrees with it.
    """
    nearest, before = system.admissible(number, value), float(system.before[number])
    if nearest == value or math.isnan(error):
        return None
    if abs(value - before) <= CERTAIN * error:
        return Bound(before, error)
    return Bound(before, math.nan) if nearest is None else Bound(nearest, error)


def held_out(found: Solution, records: list[Signals]) -> dict[str, float]:
    """Residual of each group on held-out samples, root mean square.

    Each of several records is predicted by a fit to the others, the last fifth of a single one by a fit to
    the previous ones. NaN where that leaves too little.
    """
    parts = [(records[:at] + records[at + 1 :], record) for at, record in enumerate(records)]
    if len(records) == 1:
        at = len(records[0].time) * 4 // 5
        parts = [([records[0].during(slice(at))], records[0].during(slice(at, None)))]
    residuals: dict[str, list[FloatArray]] = {}
    for fitted, left in parts:
        rows = sum(len(found.equations(each).measured) for each in fitted)
        if rows < FEWEST_ROWS * len(found.system.names):
            continue
        equations = solution(found.system, fitted).equations(left)
        for group in np.unique(equations.group):
            rows_of = equations.group == group
            error = (equations.measured - equations.predicted)[rows_of]
            residuals.setdefault(str(group), []).append(error)
    return {group: rms(np.concatenate(errors)) for group, errors in residuals.items()}


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
