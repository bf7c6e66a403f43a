"""Fits of a system of equations: parameters within their bounds, and residuals on held-out recordings."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.studies.identification.conditioning import ConditionedRecording, disturbed
from vsacli.studies.identification.estimation import Equations, LeastSquaresFit, gauss_newton

FEWEST_ROWS = 5
"""Equations per unknown below which a recording is too short to hold out a part of it."""


CERTAIN = 2.0
"""Difference from the value of the file, in standard errors, that contradicts the file."""


class SystemOfEquations(ABC):
    """Unknown parameters of a robot and the equations that determine them.

    Attributes:
        title: name of the joint, or "links".
        names, units: names and units of the parameters.
        sums: terms of each base parameter as text; "" for parameters of the robot file.
        before: values in the robot file, (parameters,), SI units.
    """

    title: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sums: tuple[str, ...]
    before: FloatArray

    @abstractmethod
    def of_record(self, values: FloatArray, signals: ConditionedRecording) -> Equations:
        """Return the equations of a recording at given values of the parameters, (parameters,)."""

    @abstractmethod
    def admissible(self, number: int, value: float) -> float | None:
        """Return the nearest admissible value of a parameter, by index; None if it must keep its value."""

    def equations(self, values: FloatArray, signals: ConditionedRecording) -> Equations:
        """Return the equations of a recording, with the effect of its noise if that is known."""
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
    """The value at which a parameter is held because its result is not admissible.

    Attributes:
        value: value at which it is held.
        standard_error: standard error of the result; NaN if no admissible value is near the result.
    """

    value: float
    standard_error: float


class Solution(NamedTuple):
    """A fitted system.

    Attributes:
        system: system of equations.
        free: indices of the fitted parameters.
        fit: fit of these parameters, in the same order.
        bound: held parameters, by index.
    """

    system: SystemOfEquations
    free: tuple[int, ...]
    fit: LeastSquaresFit
    bound: dict[int, Bound]

    @property
    def predicting(self) -> FloatArray:
        """Values of all parameters that predict best, (parameters,)."""
        values = self.system.before.copy()
        values[list(self.bound)] = [each.value for each in self.bound.values()]
        values[list(self.free)] = self.fit.solution
        return values

    def equations(self, signals: ConditionedRecording) -> Equations:
        """Return the equations of a recording at the values that predict best."""
        return self.system.equations(self.predicting, signals)


def solution(system: SystemOfEquations, records: Sequence[ConditionedRecording]) -> Solution:
    """Fit a system repeatedly, holding parameters with inadmissible results, until all are admissible."""
    bound: dict[int, Bound] = {}
    while True:
        free = tuple(number for number in range(len(system.names)) if number not in bound)
        values = system.before.copy()
        values[list(bound)] = [each.value for each in bound.values()]
        fit = gauss_newton(partial(_equations, system, records, free, values), values[list(free)])
        further = {
            number: found
            for at, number in enumerate(free)
            if (found := _bound(system, number, float(fit.solution[at]), float(fit.standard_errors[at])))
        }
        if not further:
            return Solution(system, free, fit, bound)
        bound |= further


def _equations(
    system: SystemOfEquations,
    records: Sequence[ConditionedRecording],
    free: Sequence[int],
    held: FloatArray,
    values: FloatArray,
) -> list[Equations]:
    """Return the equations of all recordings with slopes by the free parameters.

    Args:
        system: system of equations.
        records: conditioned recordings.
        free: indices of the free parameters.
        held: values of all parameters, of which those of free ones do not count, (parameters,).
        values: values of the free parameters, (free,).
    """
    together = held.copy()
    together[list(free)] = values
    return [system.equations(together, each).restricted(free) for each in records]


def _bound(system: SystemOfEquations, number: int, value: float, error: float) -> Bound | None:
    """Return the value to hold a parameter at; None if its result is admissible or it is unidentifiable.

    The value of the file is preferred if the recording agrees with it.
    """
    nearest, before = system.admissible(number, value), float(system.before[number])
    if nearest == value or math.isnan(error):
        return None
    if abs(value - before) <= CERTAIN * error:
        return Bound(before, error)
    return Bound(before, math.nan) if nearest is None else Bound(nearest, error)


def held_out(found: Solution, records: list[ConditionedRecording]) -> dict[str, float]:
    """Return the rms residual of each group on held-out samples.

    Each of several recordings is predicted by a fit to the others, the last fifth of a single recording by a
    fit to the rest. Groups are missing if too little is left for the fit.
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
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
