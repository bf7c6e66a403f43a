"""A spring given by a measured torque-deflection curve, fitted by a smooth curve that hardens."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import scipy

from vsacli.actuators.laws.inversion import FirstGuess, deflection_at_torque
from vsacli.actuators.laws.law import LawByDerivatives, SpringLaw, SpringState
from vsacli.actuators.laws.spline_curve import SplineCurve, spline_curve, spline_knots, times_deflection
from vsacli.actuators.laws.tendons import Mirrored
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.compute.control_flow import subroutine
from vsacli.documents.fields import FINITE, LARGEST, NON_ZERO, SMALLEST, TablePath, value
from vsacli.documents.record_checks import fault_of_number
from vsacli.documents.source import Source
from vsacli.documents.table import CsvTable

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


DEGREE = 3
MAX_PIECES = 24
"""Largest number of knot spans of g: a few dozen measured points show no finer features of a spring."""

REST_STIFFNESS_SHARE = 1e-3
"""Smallest stiffness at rest of a spring that pushes and pulls, as a share of the mean: sigma must be > 0."""

LEAST_SHAPE_SIZE = float(np.finfo(float).tiny)
"""Size of a shape that is zero at all measured deflections, to avoid 0/0."""


def fit_curve(deflection: FloatArray, torque: FloatArray) -> SplineCurve:
    """Fit torques (samples,) measured at ascending deflections (samples,), which begin at or below zero."""
    pieces = int(np.clip(len(deflection) // 2, 1, MAX_PIECES))
    knots = spline_knots(float(deflection[0]), float(deflection[-1]), pieces, DEGREE)
    shapes = [_energy_curve(knots, weights, 0.0) for weights in np.eye(len(knots) - DEGREE - 1)]
    columns = np.column_stack([deflection, *(shape(deflection, 1, 1)[0] for shape in shapes)])
    scales = np.maximum(np.abs(columns).max(axis=0), LEAST_SHAPE_SIZE)
    smallest_stiffness = (
        REST_STIFFNESS_SHARE * np.ptp(torque) / np.ptp(deflection) if deflection[0] < 0 else 0.0
    )
    excess_stiffness, *weights = (
        scipy.optimize.nnls(columns / scales, torque - smallest_stiffness * deflection)[0] / scales
    )
    return _energy_curve(knots, np.array(weights), smallest_stiffness + excess_stiffness)


def _energy_curve(knots: FloatArray, weights: FloatArray, stiffness_at_rest: float) -> SplineCurve:
    """Return the energy of a spring with the slope phi g(phi)."""

    def energy(spline: PPoly) -> PPoly:
        stiffness = times_deflection(spline).antiderivative()
        stiffness.c[-1] += stiffness_at_rest
        return stiffness.antiderivative(2)

    return spline_curve(knots, weights, DEGREE, energy)


MIN_ROWS = 6
GUESS_NODES = 25
"""Number of initial nodes on either side of the first guess of the inverse."""

SHAPE_TOLERANCE = 1e-3
"""Violation of the shape that counts as measurement noise, as a share of the torque range; for example, of a
point above its chord."""

NEGLIGIBLE_MISFIT, POOR_MISFIT = 1e-6, 0.01
"""Misfits of points, as shares of the range: below the first, no test bench could measure it; smooth devices
stay below the second, while a kink in 20 to 120 points causes 1 to 6 %."""


@dataclass(frozen=True)
class MeasuredSpring(LawByDerivatives):
    """Torques measured over deflections, fitted by a smooth hardening curve, without extrapolation.

    A table that begins at zero deflection describes a tendon.
    """

    file: CsvTable = value(
        TablePath(("deflection", "torque")),
        "CSV file with the header deflection,torque in rad,N m (m,N), path relative to the robot file",
    )

    examples: ClassVar = {"revolute": {"file": "measured_spring.csv"}}  # the bundled table is in rad and N m

    def _problems(self) -> tuple[()]:
        problems = list(_hardening_problems(self.file))
        if problems:
            raise InputError(problems)
        return ()

    @cached_property
    def _curve(self) -> SplineCurve:
        return fit_curve(*self.file.values.T)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of a poor fit."""
        deflection, torque = self.file.values.T
        return misfit_warnings(self.file, self._curve(deflection, 1, 1)[0] - torque)

    @property
    def sources(self) -> tuple[Source, ...]:
        """The table."""
        return (self.file.source,)

    @property
    def domain(self) -> tuple[float, float]:
        """The measured range."""
        return float(self.file.values[0, 0]), float(self.file.values[-1, 0])

    @cached_property
    def torque_range(self) -> tuple[float, float]:
        """Fitted torques at the ends of the measured range."""
        low, high = self.torque(np.array(self.domain))
        return float(low), float(high)

    @property
    def pulls_only(self) -> bool:
        """Whether the table begins at zero deflection."""
        return self.domain[0] == 0

    def as_second(self) -> SpringLaw:
        """Return the mirrored law if it only pulls."""
        return Mirrored(law=self) if self.pulls_only else self

    def hardening(self, phi: FloatArray) -> FloatArray:
        """Return the relative hardening, infinite where a spring without stiffness at rest goes slack."""
        state = self.state(phi)
        slack = state.sigma == 0
        return np.where(slack, np.inf, state.zeta / np.where(slack, 1.0, state.sigma))

    def derivatives(self, phi: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return the derivatives of the fitted curve, whose piece is looked up once."""
        return self._curve(phi, 1, order + 1)

    def state(self, phi: FloatArray) -> SpringState:
        """Return the state of the fitted curve, as a subroutine of compiled code."""
        return SpringState(*subroutine(lambda phi: self.derivatives(phi, 3), (phi,)))

    def energy(self, phi: FloatArray) -> FloatArray:
        """Return the energy of the fitted curve."""
        return self._curve(phi, 0, 0)[0]

    def deflection(self, torque: FloatArray) -> FloatArray:
        """Return the inverse, by safeguarded iteration within the measured range."""
        return self.deflection_and_state(torque)[0]

    def deflection_and_state(self, torque: FloatArray) -> tuple[FloatArray, SpringState]:
        """Return deflection and state by one iteration."""
        low, high = (np.full_like(torque, end) for end in self.domain)
        smallest, largest = self.torque_range
        clipped = np.minimum(np.maximum(torque, smallest), largest)
        start = np.minimum(np.maximum(self._first_guess(clipped), low), high)
        return deflection_at_torque(self, clipped, low, high, start)

    @cached_property
    def _first_guess(self) -> FirstGuess:
        low, high = self.domain
        shares = np.linspace(0, 1, GUESS_NODES)
        return FirstGuess(self, np.unique(np.concatenate((low * shares, high * shares))))


def misfit_warnings(table: CsvTable, misfit: FloatArray) -> tuple[str, ...]:
    """Return warnings if the misfit of a curve at the points of a table, (rows,), is large."""
    row, share = worst_misfit(table, misfit)
    if share < NEGLIGIBLE_MISFIT:
        return ()
    message = f"the curve through {table.source.path} misses a measured {table.columns[1]} by up to "
    amount = f"{abs(misfit[row]):.2g} ({100 * share:.2g} % of its range)"
    if share < POOR_MISFIT:
        return (message + amount,)
    line = table.line_of(row)
    place = f"at the deflection {table.values[row, 0]:.4g}{f' in line {line}' if line else ''}"
    return (f"{message}{amount}, {place}: near a kink or an outlier, which the curve does not follow",)


def worst_misfit(table: CsvTable, misfit: FloatArray) -> tuple[int, float]:
    """Return the row with the largest misfit, and the misfit as a share of the range."""
    row = int(np.abs(misfit).argmax())
    return row, float(abs(misfit[row]) / np.ptp(table.values[:, 1]))


def wrong_rows(table: CsvTable) -> Iterator[Problem]:
    """Yield why the rows are no curve over the deflection: too few, out of bounds or out of order."""
    deflection, path = table.values[:, 0], table.source.path
    if len(deflection) < MIN_ROWS:
        yield Problem(path, 0, f"expected at least {MIN_ROWS} rows, found {len(deflection)}")
    elif problems := list(_unusable_values(table)):
        yield from problems
    elif (steps := np.flatnonzero(np.diff(deflection) <= 0)).size:
        message = "the deflection does not increase from the row before"
        yield Problem(path, table.line_of(steps[0] + 1), message)


def _hardening_problems(table: CsvTable) -> Iterator[Problem]:
    """Yield why the rows are no hardening spring, with the lines."""
    deflection, torque = table.values.T
    path = table.source.path

    def problem_at(row: int, message: str) -> Problem:
        return Problem(path, table.line_of(row), message)

    if rows := list(wrong_rows(table)):
        yield from rows
    elif not deflection[0] <= 0 < deflection[-1]:
        yield problem_at(
            0, "the deflections must go from zero (a spring that only pulls) or below to above zero"
        )
    elif (steps := np.flatnonzero(np.diff(torque) <= 0)).size:
        yield problem_at(steps[0] + 1, "the torque does not increase from the row before, as a spring's does")
    elif (offset := abs(np.interp(0, deflection, torque))) > 10 * SHAPE_TOLERANCE * np.ptp(torque):
        yield Problem(
            path, 0, f"the torque at zero deflection is {offset:.4g}, expected zero; remove the offset"
        )
    else:
        yield from (problem_at(row, message) for row, message in _non_hardening_rows(deflection, torque))


def _unusable_values(table: CsvTable) -> Iterator[Problem]:
    """Yield rows with values too large, or an end of the curve too near to zero, as in declared fields."""
    for name, column in zip(table.columns, table.values.T, strict=True):
        for row in np.flatnonzero(np.abs(column) > LARGEST)[:1]:
            yield Problem(
                table.source.path,
                table.line_of(int(row)),
                f"the {name} {fault_of_number(column[row], FINITE)}",
            )
        for row in (0, len(column) - 1):
            if 0 < abs(column[row]) < SMALLEST:
                message = f"the {name} {fault_of_number(column[row], NON_ZERO)}"
                yield Problem(table.source.path, table.line_of(row), message)


def _non_hardening_rows(deflection: FloatArray, torque: FloatArray) -> Iterator[tuple[int, str]]:
    """Yield rows where the torque is not convex for positive, or not concave for negative deflections."""
    left, middle, right = deflection[:-2], deflection[1:-1], deflection[2:]
    fraction = (middle - left) / (right - left)
    chord = (1 - fraction) * torque[:-2] + fraction * torque[2:]
    above_chord = torque[1:-1] - chord
    tolerance = SHAPE_TOLERANCE * np.ptp(torque)
    for row in np.flatnonzero((left >= 0) & (above_chord > tolerance)):
        yield int(row) + 1, _describe_bend(torque[row + 1], "above", chord[row], "convex")
    for row in np.flatnonzero((right <= 0) & (above_chord < -tolerance)):
        yield int(row) + 1, _describe_bend(torque[row + 1], "below", chord[row], "concave")


def _describe_bend(torque: float, side: str, chord: float, shape: str) -> str:
    where = f"the torque {torque:.4g} lies {side} {chord:.4g}, the line between the rows before and after"
    return f"{where}: it is not {shape} here, so the spring would not harden away from zero"
