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


CONTRADICTING_ERRORS = 2.0
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
    def of_record(self, values: FloatArray, recording: ConditionedRecording) -> Equations:
        """Return the equations of a recording at given values of the parameters, (parameters,)."""

    @abstractmethod
    def admissible(self, number: int, value: float) -> float | None:
        """Return the nearest admissible value of a parameter, by index; None if it must keep its value."""

    def equations(self, values: FloatArray, recording: ConditionedRecording) -> Equations:
        """Return the equations of a recording, with the effect of its noise if that is known."""
        equations = self.of_record(values, recording)
        if recording.noise is None:
            return equations

        @cache
        def noise() -> tuple[FloatArray, FloatArray]:
            disturbed_equations = self.of_record(values, disturbed(recording))
            residuals = (each.measured - each.predicted for each in (disturbed_equations, equations))
            return next(residuals) - next(residuals), disturbed_equations.slopes - equations.slopes

        return equations._replace(noise=noise)


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

    def equations(self, recording: ConditionedRecording) -> Equations:
        """Return the equations of a recording at the values that predict best."""
        return self.system.equations(self.predicting, recording)


def fit_system(system: SystemOfEquations, recordings: Sequence[ConditionedRecording]) -> Solution:
    """Fit a system repeatedly, holding parameters with inadmissible results, until all are admissible."""
    held_parameters: dict[int, Bound] = {}
    while True:
        free = tuple(index for index in range(len(system.names)) if index not in held_parameters)
        values = system.before.copy()
        values[list(held_parameters)] = [each.value for each in held_parameters.values()]
        fit = gauss_newton(partial(_free_equations, system, recordings, free, values), values[list(free)])
        newly_held = {
            index: found
            for free_index, index in enumerate(free)
            if (
                found := _inadmissible_bound(
                    system, index, float(fit.solution[free_index]), float(fit.standard_errors[free_index])
                )
            )
        }
        if not newly_held:
            return Solution(system, free, fit, held_parameters)
        held_parameters |= newly_held


def _free_equations(
    system: SystemOfEquations,
    recordings: Sequence[ConditionedRecording],
    free: Sequence[int],
    held_values: FloatArray,
    values: FloatArray,
) -> list[Equations]:
    """Return the equations of all recordings with slopes by the free parameters.

    Args:
        system: system of equations.
        recordings: conditioned recordings.
        free: indices of the free parameters.
        held_values: values of all parameters, of which those of free ones do not count, (parameters,).
        values: values of the free parameters, (free,).
    """
    all_values = held_values.copy()
    all_values[list(free)] = values
    return [system.equations(all_values, each).restricted(free) for each in recordings]


def _inadmissible_bound(system: SystemOfEquations, index: int, value: float, error: float) -> Bound | None:
    """Return the value to hold a parameter at; None if its result is admissible or it is unidentifiable.

    The value of the file is preferred if the recording agrees with it.
    """
    admissible_value, file_value = system.admissible(index, value), float(system.before[index])
    if admissible_value == value or math.isnan(error):
        return None
    if abs(value - file_value) <= CONTRADICTING_ERRORS * error:
        return Bound(file_value, error)
    return Bound(file_value, math.nan) if admissible_value is None else Bound(admissible_value, error)


def held_out(solution: Solution, recordings: list[ConditionedRecording]) -> dict[str, float]:
    """Return the rms residual of each group on held-out samples.

    Each of several recordings is predicted by a fit to the others, the last fifth of a single recording by a
    fit to the rest. Groups are missing if too little is left for the fit.
    """
    splits = [
        (recordings[:index] + recordings[index + 1 :], record) for index, record in enumerate(recordings)
    ]
    if len(recordings) == 1:
        index = len(recordings[0].time) * 4 // 5
        splits = [([recordings[0].during(slice(index))], recordings[0].during(slice(index, None)))]
    residuals: dict[str, list[FloatArray]] = {}
    for fitted_recordings, held_out_recording in splits:
        row_count = sum(len(solution.equations(each).measured) for each in fitted_recordings)
        if row_count < FEWEST_ROWS * len(solution.system.names):
            continue
        equations = fit_system(solution.system, fitted_recordings).equations(held_out_recording)
        for group in np.unique(equations.group):
            row_mask = equations.group == group
            error = (equations.measured - equations.predicted)[row_mask]
            residuals.setdefault(str(group), []).append(error)
    return {group: rms(np.concatenate(errors)) for group, errors in residuals.items()}


def rms(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
