"""The stiffness profile nearest to the commanded one: a spline between bounds, by a quadratic program.

`vsacli optimize` has another solver, `interior_point`, which needs a profile inside all bounds to start from.
Here no such profile is known, and none exists where bounds touch; in return, the minimum is unique.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import significant
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import (
    Acceptance,
    ImpossibleError,
    Range,
    admissible_stiffness,
    checked_range,
    variable_stiffness_actuator,
)
from vsacli.studies.search.cutting_planes import smallest_offset
from vsacli.studies.search.loads import Load

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DEGREE = 5
PIECES_PER_SMOOTHING = 2
"""Pieces of the spline per smoothing time; the objective suppresses finer detail."""

FLAT_ENDS = 2
"""Number of derivatives that are zero at both ends."""

PENALIZED_ORDER = 3
"""Derivative that the objective suppresses. Its square has no integral where the second one jumps; if the
second derivative itself is suppressed, it jumps at both ends, from the zero that is prescribed there."""

END_HALVINGS = 4
"""Halvings of the first and last pieces: the function is flat at the ends although its bounds may move."""

DECAY_SMOOTHING_TIMES = 16
"""Smoothing times over which a change decays, to e^-8."""

MAX_COEFFICIENTS = 100
"""Number of coefficients that the dense solver handles in 0.1 s; if there are more, pieces become coarser."""

MAX_ROUNDS = 100
"""Limit on rounds that add instants of violated bounds; about five are needed."""

BOUND_ACCURACY = 1e-7
"""Share of its peak by which a spline may violate its bounds; a tenth of `CLEARANCE`."""


class NoSplineError(Exception):
    """Error: no spline with pieces of this length lies between the bounds."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of a function over time.

    Attributes:
        time: ascending times, (instants,) in s.
        low: lower bound, (instants,).
        high: upper bound, not below `low`; infinite where there is none.
    """

    time: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def excluding_zero(self) -> BoolArray:
        """Mask of the instants at which the function cannot be zero."""
        return (self.low > 0) | (self.high < 0)

    def missed_by(self, values: FloatArray) -> FloatArray:
        """Return the violation of the bounds by values; zero or negative between the bounds."""
        return np.maximum(self.low - values, values - self.high)


def nearest_spline(bounds: Bounds, smoothing: float, knots: FloatArray | None = None) -> BSpline[np.float64]:
    """Return the C2 function x between bounds that minimizes the integral of x^2 + smoothing^6 x'''^2.

    Its first and second derivatives are zero at both ends, so that the changed profile starts and stops like
    the commanded one. A convex quadratic program in the coefficients of a quintic spline yields it, solved
    as a least-distance problem by non-negative least squares (Lawson & Hanson, "Solving Least Squares
    Problems", 1974, chapter 23). Far from the instants at which the bounds exclude zero, x is zero.

    Args:
        bounds: bounds that exclude zero at some instants.
        smoothing: time scale below which variation is penalized, s.
        knots: times at which pieces may begin and end, both ends included; any time if None.

    Raises:
        NoSplineError: the bounds are too narrow or change too fast.
    """
    knots, is_free, smoothing = _choose_knots(bounds, smoothing, knots)
    shapes = _shapes(is_free)
    largest_violation = float(np.max(bounds.missed_by(np.zeros_like(bounds.time))))
    scaled = Bounds(bounds.time, bounds.low / largest_violation, bounds.high / largest_violation)
    coefficients = _least_norm_coefficients(scaled, knots, shapes, smoothing)
    return scipy.interpolate.BSpline(knots, largest_violation * (shapes @ coefficients), DEGREE)


def _choose_knots(
    bounds: Bounds, smoothing: float, allowed: FloatArray | None
) -> tuple[FloatArray, BoolArray, float]:
    """Return the knots, a mask of the free coefficients, and the smoothing time that the pieces resolve."""
    first, last = bounds.time[[0, -1]]
    while True:
        pieces = int(np.ceil(PIECES_PER_SMOOTHING * (last - first) / smoothing))
        piece_ends = _graded_piece_ends(np.linspace(first, last, pieces + 1))
        if allowed is not None:
            piece_ends = np.unique(
                allowed[np.clip(np.searchsorted(allowed, piece_ends), 0, len(allowed) - 1)]
            )
        knots = np.concatenate([[first] * DEGREE, piece_ends, [last] * DEGREE])
        is_near_bounds = _pieces_near(
            piece_ends, bounds.time[bounds.excluding_zero], DECAY_SMOOTHING_TIMES * smoothing
        )
        # coefficient i belongs to the pieces i-5..i
        is_free = np.convolve(is_near_bounds, np.ones(DEGREE + 1)) > 0
        if np.count_nonzero(is_free) <= MAX_COEFFICIENTS:
            return knots, is_free, smoothing
        smoothing *= 1.5


def _graded_piece_ends(ends: FloatArray) -> FloatArray:
    """Return the ends of equal pieces, with the first and last pieces halved repeatedly towards the ends."""
    end_lengths = (ends[1] - ends[0]) * 0.5 ** np.arange(END_HALVINGS, 0, -1)
    return np.concatenate(
        [ends[:1], ends[0] + end_lengths, ends[1:-1], ends[-1] - end_lengths[::-1], ends[-1:]]
    )


def _shapes(is_free: BoolArray) -> FloatArray:
    """Return the B-spline coefficients of each shape, (coefficients, shapes).

    There is one shape per free coefficient; only the first three coefficients share one, and so do the last
    three, since the first two derivatives are zero at an end where these are equal.
    """
    rows = np.arange(len(is_free))
    shape_indices = np.clip(rows - FLAT_ENDS, 0, len(is_free) - 1 - 2 * FLAT_ENDS)
    shapes = np.eye(shape_indices[-1] + 1)[shape_indices]
    return shapes[:, np.any(shapes[is_free], axis=0)]


def _pieces_near(ends: FloatArray, times: FloatArray, max_distance: float) -> BoolArray:
    """Return a mask of the pieces within `max_distance` of any of the ascending times."""
    next_time = np.append(times, np.inf)[np.searchsorted(times, ends[:-1] - max_distance)]
    return next_time <= ends[1:] + max_distance


def _least_norm_coefficients(
    bounds: Bounds, knots: FloatArray, shapes: FloatArray, smoothing: float
) -> FloatArray:
    """Return the coefficient of each shape; bounds are added at instants where they are violated."""
    objective_factor = _objective(knots, shapes, smoothing)
    excluding_indices = np.flatnonzero(bounds.excluding_zero)
    constrained = excluding_indices[evenly(len(excluding_indices), MAX_COEFFICIENTS)]
    for _ in range(MAX_ROUNDS):
        constraint_rows = (
            scipy.interpolate.BSpline.design_matrix(bounds.time[constrained], knots, DEGREE).toarray()
            @ shapes
        )
        finite = np.isfinite(bounds.high[constrained])
        lower_bounds = np.concatenate([bounds.low[constrained], -bounds.high[constrained][finite]])
        coefficients = _least_distance(
            objective_factor, np.concatenate([constraint_rows, -constraint_rows[finite]]), lower_bounds
        )
        violation = bounds.missed_by(
            scipy.interpolate.BSpline(knots, shapes @ coefficients, DEGREE)(bounds.time)
        )
        if violation.max() <= BOUND_ACCURACY:
            return coefficients
        constrained = np.union1d(constrained, peaks(violation))
    raise NoSplineError


def _objective(knots: FloatArray, shapes: FloatArray, smoothing: float) -> FloatArray:
    """Return upper triangular R such that |R x|^2 is the integral in smoothing times, by Gauss quadrature."""
    ends = knots[DEGREE:-DEGREE]
    half_lengths = np.diff(ends) / 2
    nodes, weights = np.polynomial.legendre.leggauss(DEGREE + 1)
    time = ((ends[:-1] + half_lengths)[:, None] + half_lengths[:, None] * nodes).ravel()
    root_weights = np.sqrt(half_lengths[:, None] * weights / smoothing).ravel()
    basis = scipy.interpolate.BSpline(knots, shapes, DEGREE)
    scaled_derivative = smoothing**PENALIZED_ORDER * basis(time, nu=PENALIZED_ORDER)
    rows = [root_weights[:, None] * basis(time), root_weights[:, None] * scaled_derivative]
    return np.asarray(np.linalg.qr(np.concatenate(rows), mode="r"), dtype=np.float64)


def _least_distance(objective_factor: FloatArray, rows: FloatArray, lower_bounds: FloatArray) -> FloatArray:
    """Return the x that minimizes |root x| subject to rows x >= low."""
    distance_rows = scipy.linalg.solve_triangular(objective_factor, rows.T, trans="T")  # rows of y = root x
    dual_matrix = np.concatenate([distance_rows, lower_bounds[None, :]])
    target = np.append(np.zeros(len(objective_factor)), 1.0)
    try:
        multipliers, _ = scipy.optimize.nnls(dual_matrix, target)
    except RuntimeError as error:  # too many iterations
        raise NoSplineError from error
    residual = dual_matrix @ multipliers - target
    if -residual[-1] < BOUND_ACCURACY:
        raise NoSplineError
    return np.asarray(
        scipy.linalg.solve_triangular(objective_factor, residual[:-1] / -residual[-1]), dtype=np.float64
    )


def peaks(violation: FloatArray) -> IndexArray:
    """Return the index of the worst instant of each stretch with violated bounds."""
    padded = np.concatenate([[0.0], np.maximum(violation, 0), [0.0]])
    rising, falling = padded[1:-1] > padded[:-2], padded[1:-1] >= padded[2:]
    return np.flatnonzero(rising & falling & (violation > 0))


MARGIN_FACTORS = (1, 2, 4, 8)
"""Multiples of the margin to try if motor limits refuse the nearest profile: torques grow with 1/margin."""

SMOOTHING_FACTORS = (1, 2, 4, 8)
"""Multiples of the smoothing time to try then: torques grow with the second derivative."""

MAX_CHANGES = 4
"""Changes to try one after the other between bounds that depend on the rates of the last one."""

RATES_RESERVE = 1e-3
"""Share of a limit that is left to the difference between the rates of two successive changes."""

GRID = 24
"""Values of stiffness at which an instant is tried to find those that it accepts."""

GRID_HALVINGS = 12
"""Halvings of the interval of the grid at the end of the accepted range, to 1e-5 of the command."""

RESONANCE_SHARE = 0.7
"""Smoothing time as a share of that of the resonance."""

MIN_SMOOTHING_INTERVALS = 10
"""Sampling intervals in a smoothing time, at least: samples resolve the second derivative."""

CLEARANCE = 1e-6
"""Distance of a profile from its bounds, relative to the largest change, so that rounding crosses none."""


@dataclass(frozen=True, eq=False)
class Change:
    """An addition to the stiffness of a joint.

    Attributes:
        time: times, (instants,) in s.
        rows: addition with its first two derivatives, (3, instants), N m/rad (N/m) per s^k.
    """

    time: FloatArray
    rows: FloatArray

    @classmethod
    def constant(cls, time: FloatArray, value: float) -> Change:
        """Return a constant change."""
        rows = np.zeros((3, len(time)))
        rows[0] = value
        return cls(time, rows)

    @property
    def rms(self) -> float:
        """Root mean square over time, N m/rad (N/m)."""
        duration = self.time[-1] - self.time[0]
        return math.sqrt(float(scipy.integrate.trapezoid(self.rows[0] ** 2, self.time)) / duration)


def nearest_change(
    acceptance: Acceptance, joint: Joint, load: Load, judged: Callable[[Load], Load]
) -> Change:
    """Return the smoothed C2 change of least mean square that fixes a joint; the constant one if nearer.

    If the limits of the motors refuse it, the nearest of several others is returned: those that are smoother
    or keep further away from the ends of the attainable range, and one within the limits of each instant.

    Args:
        acceptance: acceptance rule.
        joint: joint with at least one refused sample.
        load: load of the joint at samples and between, all of which must be accepted.
        judged: returns the part of the load at which a constant must be accepted.

    Raises:
        ImpossibleError: no change that was tried is accepted; the error has the reason.
    """
    _check_possible(acceptance, joint, load)
    first_factors, *other_factors = product(MARGIN_FACTORS, SMOOTHING_FACTORS)
    change = _change_with_margins(acceptance, joint, load, *first_factors)
    accepted = _accepted(acceptance, joint, load, [change])
    candidates: list[Change | None] = []
    with suppress(ImpossibleError):
        candidates.append(Change.constant(load.time, smallest_offset(acceptance, joint, judged(load))))
    if not accepted:
        candidates += [_change_with_margins(acceptance, joint, load, *factors) for factors in other_factors]
    accepted += _accepted(acceptance, joint, load, candidates)
    if change not in accepted:
        accepted += _change_within_limits(acceptance, joint, load)
    if not accepted:
        raise ImpossibleError(_refusal_reason(acceptance, joint, load, change))
    return min(accepted, key=lambda each: each.rms)


def _check_possible(acceptance: Acceptance, joint: Joint, load: Load) -> None:
    """Raise ImpossibleError if no stiffness is admissible at some instant."""
    low, high = checked_range(acceptance, joint, load)
    index = int((low - high).argmax())
    if low[index] > high[index]:
        raise ImpossibleError(
            f"{joint.name} needs a stiffness of at least {significant(low[index], toward=math.inf)} at t = "
            f"{load.time[index]:.3f} s, but its limits of stiffness and deflection allow at most "
            f"{significant(high[index])} {units.STIFFNESS.unit(joint.type)}"
        )


def _change_with_margins(
    acceptance: Acceptance, joint: Joint, load: Load, margin_factor: float, smoothing_factor: float
) -> Change | None:
    """Return the nearest change for multiples of margin and smoothing time; None if no spline is found."""
    min_margin = margin_factor * acceptance.min_margin
    if min_margin >= 1:
        return None
    return _change_within(
        admissible_stiffness(joint, load.command, min_margin), joint, load, smoothing_factor
    )


def _change_within(admissible: Range, joint: Joint, load: Load, smoothing_factor: float) -> Change | None:
    """Return the nearest change to a stiffness within a range; None if no spline is found."""
    commanded_stiffness = load.command.commanded["stiffness"]
    bounds = _narrowed_bounds(
        load.time, admissible.low - commanded_stiffness, admissible.high - commanded_stiffness
    )
    if np.any(bounds.low > bounds.high):
        return None
    if not bounds.excluding_zero.any():
        return Change.constant(load.time, 0.0)
    try:
        # pieces end at samples: a file with derivatives at the samples then describes exactly this spline
        spline = nearest_spline(
            bounds, smoothing_factor * _smoothing_time(joint, load), load.time[load.steps]
        )
    except NoSplineError:
        return None
    return Change(load.time, np.stack([spline(load.time, nu=order) for order in range(STIFFNESS.orders)]))


def _change_within_limits(acceptance: Acceptance, joint: Joint, load: Load) -> list[Change]:
    """Return the accepted change within the stiffness that each instant accepts, if one is found.

    Each is found at the rates of the one before.
    """
    reserved_acceptance = replace(acceptance, reserve=acceptance.reserve + RATES_RESERVE)
    rates = np.zeros((2, len(load.time)))
    for _ in range(MAX_CHANGES):
        admissible = _accepted_stiffness(reserved_acceptance, joint, load, rates)
        change = None if admissible is None else _change_within(admissible, joint, load, 1)
        if change is None:
            break
        if accepted := _accepted(acceptance, joint, load, [change]):
            return accepted
        rates = change.rows[1:]
    return []


def _accepted_stiffness(acceptance: Acceptance, joint: Joint, load: Load, rates: FloatArray) -> Range | None:
    """Return the accepted range of stiffness nearest to the command, with rates added; None without one.

    Ranges, or gaps in them, between two neighbors of a grid are not seen: a profile is checked as a whole.

    Args:
        acceptance: acceptance rule.
        joint: joint whose stiffness can be chosen.
        load: load of the joint at all instants.
        rates: addition to the first two derivatives of the stiffness, (2, instants).
    """
    instants = np.arange(len(load.time))
    commanded_stiffness = load.command.commanded["stiffness"]

    def accepts(stiffness: FloatArray) -> BoolArray:
        additions = (stiffness - commanded_stiffness).ravel(), *np.tile(rates, len(stiffness))
        changed = load.at(np.tile(instants, len(stiffness))).changed(*additions)
        return ~acceptance.refused_steps(joint, changed).reshape(stiffness.shape)

    low, high = admissible_stiffness(joint, load.command, acceptance.min_margin)
    shares = np.arange(GRID)[:, None] / GRID
    grid = np.minimum(low + commanded_stiffness * shares / (1 - shares), high)
    grid = np.sort(np.concatenate([grid, np.clip(commanded_stiffness, low, high)[None]]), axis=0)
    accepted_mask = accepts(grid)
    if not accepted_mask.any(axis=0).all():
        return None
    nearest_row = np.where(accepted_mask, np.abs(grid - commanded_stiffness), np.inf).argmin(axis=0)
    row_indices = np.arange(len(grid))[:, None]
    refused_below = np.where(~accepted_mask & (row_indices < nearest_row), row_indices, -1).max(axis=0)
    refused_above = np.where(~accepted_mask & (row_indices > nearest_row), row_indices, len(grid)).min(axis=0)
    accepted_ends = np.stack([grid[refused_below + 1, instants], grid[refused_above - 1, instants]])
    refused_ends = np.stack(
        [grid[np.maximum(refused_below, 0), instants], grid[np.minimum(refused_above, GRID), instants]]
    )
    for _ in range(GRID_HALVINGS):
        middles = (accepted_ends + refused_ends) / 2
        accepted_ends, refused_ends = np.where(
            accepts(middles), (middles, refused_ends), (accepted_ends, middles)
        )
    return Range(*accepted_ends)


def _narrowed_bounds(time: FloatArray, low: FloatArray, high: FloatArray) -> Bounds:
    """Return the bounds, narrowed by `CLEARANCE` where they are wide enough and else to their middle."""
    clearance = CLEARANCE * max(low.max(), -high.min(), 0.0)
    middle = (low + high) / 2
    is_wide = high - low > 2 * clearance
    return Bounds(
        time, np.where(is_wide, low + clearance, middle), np.where(is_wide, high - clearance, middle)
    )


def _smoothing_time(joint: Joint, load: Load) -> float:
    """Return `RESONANCE_SHARE` of sqrt(B/sigma), at least `MIN_SMOOTHING_INTERVALS` sampling intervals, s."""
    # changes slower than this resonance require little inertial torque of the motors
    inertia = max(motor.inertia for motor in variable_stiffness_actuator(joint).motors)
    resonance = math.sqrt(inertia / float(load.command.commanded["stiffness"].min()))
    sampling_interval = float(np.median(np.diff(load.time[load.steps])))
    return min(
        max(RESONANCE_SHARE * resonance, MIN_SMOOTHING_INTERVALS * sampling_interval),
        float(load.time[-1] - load.time[0]),
    )


def _accepted(
    acceptance: Acceptance, joint: Joint, load: Load, changes: Sequence[Change | None]
) -> list[Change]:
    """Return the changes after which every instant is accepted."""
    return [
        change
        for change in changes
        if change is not None and not acceptance.refused_steps(joint, load.changed(*change.rows)).any()
    ]


def _refusal_reason(acceptance: Acceptance, joint: Joint, load: Load, change: Change | None) -> str:
    if change is None:
        return f"what {joint.name} may have is too narrow, or changes too fast, for a smooth profile"
    reason = acceptance.reason(joint, load.changed(*change.rows))
    return f"none that was tried keeps every limit of {joint.name}; with the nearest, {reason}"
