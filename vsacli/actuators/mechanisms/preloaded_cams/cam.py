"""A cam with a profile given by points, a smooth lift, one minimum: MACCEPA 2.0, DLR VS-Joint, QA-Joint."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy

from vsacli.actuators.laws.spline_curve import SplineCurve, spline_curve, spline_knots, times_deflection
from vsacli.actuators.laws.table import SHAPE_TOLERANCE, misfit_warnings, worst_misfit, wrong_rows
from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift
from vsacli.actuators.mechanisms.preloaded_cams.preloaded_cam import PreloadedCam
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem, InputError, Problem
from vsacli.documents.fields import TablePath, value
from vsacli.documents.source import Source
from vsacli.documents.table import CsvTable

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


DEGREE = 4
PIECES = (2, 4, 6, 8, 12, 16, 24)
"""Numbers of knot spans of g that are tried; even, so that the spans of a symmetric profile are symmetric."""

ROWS_PER_PIECE = 4
"""Smallest number of points per span. In trials with noise on 40 points, the criterion chose too many
shorter spans."""

PIECE_PENALTY = 2.0
"""Weight of the number of pieces relative to that of the usual criterion. In trials with noise of 1e-4 on 120
points, the usual weight chose too many in one draw of ten, with thirty times the fourth derivative."""

FIRST_PIECES = 6
"""Largest number of spans in the first search for rest."""

LEAST_CURVATURE_SHARE = 1e-3
"""Smallest g, as a share of its mean: without curvature at rest, pretension causes no stiffness."""

ROUNDING_SHARE = 1e-12
"""Share of the range of the lift below which a misfit is rounding."""


class CamProfile(NamedTuple):
    """A fitted profile.

    Attributes:
        rest: Deflection of the minimum, rad (m).
        curve: Lift over the deflection from there, but for a constant.
        misfit: Distance of the curve from the points, (rows,).
    """

    rest: float
    curve: SplineCurve
    misfit: FloatArray


def fit_profile(deflection: FloatArray, lift: FloatArray) -> CamProfile:
    """Fit lifts (rows,) at ascending deflections (rows,), the lowest neither first nor last."""
    most_pieces = max(PIECES[0], len(lift) // ROWS_PER_PIECE)
    if _is_symmetric(deflection, lift):
        rest, pieces = 0.0, _choose_piece_count(deflection, lift, most_pieces)
    else:
        lowest = float(deflection[np.argmin(lift)])
        first_rest = lowest + _best_rest(deflection - lowest, lift, min(FIRST_PIECES, most_pieces))
        pieces = _choose_piece_count(deflection - first_rest, lift, most_pieces)
        rest = first_rest + _best_rest(deflection - first_rest, lift, pieces)
    fit = _fit_pieces(deflection - rest, lift, pieces)
    return CamProfile(rest, fit.curve, fit.misfit)


def _choose_piece_count(phi: FloatArray, lift: FloatArray, most_pieces: int) -> int:
    """Return the number of pieces that the points require, over deflections from rest."""
    counts = [pieces for pieces in PIECES if pieces <= most_pieces]
    return min(counts, key=lambda pieces: _fit_pieces(phi, lift, pieces).criterion)


class _ProfileFit(NamedTuple):
    """A curve, and the Bayesian information criterion that weighs its misfit against its pieces."""

    curve: SplineCurve
    misfit: FloatArray
    criterion: float


def _fit_pieces(phi: FloatArray, lift: FloatArray, pieces: int) -> _ProfileFit:
    """Return the fit with this number of pieces, over deflections from rest."""
    knots = spline_knots(float(phi[0]), float(phi[-1]), pieces, DEGREE)
    weight_count = len(knots) - DEGREE - 1
    shapes = [spline_curve(knots, weights, DEGREE, _integrate_lift) for weights in np.eye(weight_count)]
    columns = np.column_stack([shape(phi, 0, 0)[0] for shape in shapes])
    weights, _ = _fit_weights(columns, lift, _smallest_curvature(phi, lift))
    if _is_symmetric(phi, lift):
        weights = (weights + weights[::-1]) / 2
    curve = spline_curve(knots, weights, DEGREE, _integrate_lift)
    misfit = lift - curve(phi, 0, 0)[0]
    misfit -= (misfit.min() + misfit.max()) / 2
    mean_square = np.sum(misfit**2) / len(lift) + (ROUNDING_SHARE * np.ptp(lift)) ** 2
    criterion = len(lift) * math.log(mean_square) + PIECE_PENALTY * weight_count * math.log(len(lift))
    return _ProfileFit(curve, misfit, criterion)


def _integrate_lift(spline: PPoly) -> PPoly:
    return times_deflection(spline).antiderivative()


def _smallest_curvature(phi: FloatArray, lift: FloatArray) -> float:
    """Return the smallest g: a share of that of a parabola as high as the lift."""
    return LEAST_CURVATURE_SHARE * 2 * float(np.ptp(lift)) / float(np.abs(phi).max()) ** 2


def _fit_weights(columns: FloatArray, lift: FloatArray, smallest: float) -> tuple[FloatArray, float]:
    """Fit weights of columns, at least `smallest`, and a constant to a lift; return also the misfit."""
    constant = np.ones((len(lift), 1))
    columns_with_level = np.hstack((constant, -constant, columns))
    scales = np.maximum(np.abs(columns_with_level).max(axis=0), np.finfo(float).tiny)
    excess_weights, distance = scipy.optimize.nnls(
        columns_with_level / scales, lift - smallest * columns.sum(axis=1) - lift.min()
    )
    return smallest + (excess_weights / scales)[2:], distance


def _best_rest(phi: FloatArray, lift: FloatArray, pieces: int) -> float:
    """Return the deflection of rest with the best fit, between the neighbors of the lowest point."""
    knots = spline_knots(float(phi[0]), float(phi[-1]), pieces, DEGREE)
    bases = [
        scipy.interpolate.PPoly.from_spline((knots, weights, DEGREE))
        for weights in np.eye(len(knots) - DEGREE - 1)
    ]
    moment_columns = np.column_stack([times_deflection(basis).antiderivative()(phi) for basis in bases])
    basis_columns = np.column_stack([basis.antiderivative()(phi) for basis in bases])
    smallest_curvature, lowest = _smallest_curvature(phi, lift), int(np.argmin(lift))
    minimum = scipy.optimize.minimize_scalar(
        lambda rest: _fit_weights(moment_columns - rest * basis_columns, lift, smallest_curvature)[1],
        bounds=(phi[lowest - 1], phi[lowest + 1]),
        method="bounded",
        options={"xatol": float(np.finfo(float).eps * np.ptp(phi))},
    )
    return float(minimum.x)


def _is_symmetric(phi: FloatArray, lift: FloatArray) -> bool:
    """Return whether lifts are those of the opposite deflections."""
    return all(
        np.allclose(column, negated[::-1], rtol=0, atol=ROUNDING_SHARE * float(np.ptp(column)))
        for column, negated in ((phi, -phi), (lift, lift))
    )


LARGEST_MISFIT = 0.03
"""Largest misfit of a point, as a share of the range of the lift; beyond it, the profile is refused."""


@dataclass(frozen=True)
class Cam(PreloadedCam):
    """A spring compressed by the lift of a cam, whose profile is measured or designed.

    A smooth curve with one minimum, from which the lift is counted, is fitted to the points; it is not
    extrapolated.
    """

    profile: CsvTable = value(
        TablePath(("deflection", "lift")),
        "CSV file with the header deflection,lift in rad,m (m,m), path relative to the robot file",
    )

    def _problems(self) -> list[FieldProblem]:
        field_problems = super()._problems()
        table_problems = (
            [] if field_problems else list(_profile_problems(self.profile)) or list(self._misfit_problems())
        )
        if table_problems:
            raise InputError(table_problems)
        return field_problems

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Return the profile of the bundled example, which turns."""
        if joint_type == "prismatic":
            return {}
        return {"k": 60000, "r": 0.005, "pretension": [0.01, 0.05], "profile": "cam_profile.csv"}

    @cached_property
    def _profile_fit(self) -> CamProfile:
        return fit_profile(*self.profile.values.T)

    def _misfit_problems(self) -> Iterator[Problem]:
        """Yield the point that the fitted curve misses most, if the fit is refused."""
        row, share = worst_misfit(self.profile, self._profile_fit.misfit)
        if share > LARGEST_MISFIT:
            description = (
                f"misses the lift {self.profile.values[row, 1]:.4g} by {100 * share:.2g} % of its range"
            )
            message = (
                f"a smooth profile {description}, more than {100 * LARGEST_MISFIT:g} %: there is a kink or"
                " an outlier nearby, or rows are too few"
            )
            yield Problem(self.profile.source.path, self.profile.line_of(row), message)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of a poor fit."""
        return misfit_warnings(self.profile, self._profile_fit.misfit)

    @property
    def sources(self) -> tuple[Source, ...]:
        """The profile."""
        return (self.profile.source,)

    @property
    def rest(self) -> float:
        """Minimum of the fitted curve."""
        return self._profile_fit.rest

    @property
    def deflection_range(self) -> tuple[float, float]:
        """Range of the points."""
        return float(self.profile.values[0, 0]), float(self.profile.values[-1, 0])

    def lift(self, from_rest: FloatArray) -> Lift:
        """Return the fitted curve."""
        return Lift(*self._profile_fit.curve(from_rest, 0, 4))


def _profile_problems(table: CsvTable) -> Iterator[Problem]:
    """Yield why the rows are no profile with one minimum, with the lines."""
    deflection, lift = table.values.T
    if problems := list(wrong_rows(table)):
        yield from problems
        return
    lowest = int(np.argmin(lift))
    if lowest in {0, len(lift) - 1}:
        message = "the lift is lowest at an end; a cam needs points on both sides of its minimum"
        yield Problem(table.source.path, table.line_of(lowest), message)
        return
    tolerance = SHAPE_TOLERANCE * np.ptp(lift)
    lifts_from_minimum = lift[lowest:], lift[lowest::-1]
    for side, step in zip(lifts_from_minimum, (1, -1), strict=True):
        falling = np.flatnonzero(np.maximum.accumulate(side) - side > tolerance)
        if falling.size:
            row = lowest + step * int(falling[0])
            message = (
                f"the lift {lift[row]:.4g} lies below that of a row nearer to the minimum at "
                f"{deflection[lowest]:.4g}: a cam needs one minimum"
            )
            yield Problem(table.source.path, table.line_of(row), message)
