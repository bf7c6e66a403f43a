"""The stiffness profile nearest to the commanded one: a cubic spline between bounds, by a quadratic program.

`vsacli optimize` has a solver of its own, which goes from a profile that keeps all bounds to a local minimum
of any cost. Here such a profile is searched, the minimum is the only one, and bounds may touch,
which leaves nothing between them to start from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray, evenly
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import (
    Acceptance,
    ImpossibleError,
    admissible_stiffness,
    checked_range,
    stiffness_text,
    variable_stiffness_actuator,
)
from vsacli.studies.search.loads import Load

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DEGREE = 3
PIECES_PER_SMOOTHING = 3
"""Pieces of the spline in one smoothing time: the objective leaves nothing finer."""

END_HALVINGS = 4
"""Halvings of the pieces at both ends, where the function begins flat although its bounds may move."""

DECAY_SMOOTHING_TIMES = 8
"""Smoothing times over which a change dies out; e^-8 is left of it."""

MOST_COEFFICIENTS = 100
"""Coefficients that the dense solver handles in a tenth of a second; more make coarser pieces."""

MOST_ROUNDS = 100
"""Rounds of adding the instants at which bounds are missed; about five are needed."""

BOUND_ACCURACY = 1e-7
"""Share of its largest value by which a spline may miss its bounds; a tenth of the reserve."""


class NoSplineError(Exception):
    """No spline with pieces of this length lies between the bounds."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """The bounds of a function over time.

    Attributes:
        time: ascending, (instants,) in s.
        low: smallest value, (instants,).
        high: largest value, above `low`; infinite where nothing bounds it.
    """

    time: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def excluding_zero(self) -> BoolArray:
        """Instants at which the function cannot vanish."""
        return (self.low > 0) | (self.high < 0)

    def missed_by(self, values: FloatArray) -> FloatArray:
        """Return the distance of values outside; zero or negative inside."""
        return np.maximum(self.low - values, values - self.high)


def nearest_spline(bounds: Bounds, smoothing: float, knots: FloatArray | None = None) -> BSpline[np.float64]:
    """Return the C2 function x between bounds that minimises the integral of x^2 + smoothing^4 x''^2.

    Its first and second derivative vanish at both ends, so that the sum starts and stops as the profile
    did. A convex quadratic programme in the coefficients of a cubic spline, solved as a problem of least
    distance by non-negative least squares (Lawson & Hanson, "Solving Least Squares Problems", 1974, chapter
    23). Far from where the bounds exclude zero, x is zero.

    Args:
        bounds: excluding zero at some instants.
        smoothing: time in s within which it is expensive to change.
        knots: times that its pieces may begin and end at, both ends among them; any if None.

    Raises:
        NoSplineError: the bounds are too narrow or change too fast.
    """
    from scipy.interpolate import BSpline

    knots, free, smoothing = _knots(bounds, smoothing, knots)
    shapes = _shapes(free)
    size = float(np.max(bounds.missed_by(np.zeros_like(bounds.time))))
    scaled = Bounds(bounds.time, bounds.low / size, bounds.high / size)
    amounts = _least_amounts(scaled, knots, shapes, smoothing)
    return BSpline(knots, size * (shapes @ amounts), DEGREE)


def _knots(
    bounds: Bounds, smoothing: float, allowed: FloatArray | None
) -> tuple[FloatArray, BoolArray, float]:
    """Pieces, which coefficients are free, and the smoothing that such pieces can follow."""
    first, last = bounds.time[[0, -1]]
    while True:
        pieces = int(np.ceil(PIECES_PER_SMOOTHING * (last - first) / smoothing))
        ends = _graded(np.linspace(first, last, pieces + 1))
        if allowed is not None:
            ends = np.unique(allowed[np.clip(np.searchsorted(allowed, ends), 0, len(allowed) - 1)])
        knots = np.concatenate([[first] * DEGREE, ends, [last] * DEGREE])
        near = _pieces_near(ends, bounds.time[bounds.excluding_zero], DECAY_SMOOTHING_TIMES * smoothing)
        # coefficient i belongs to the pieces i-3..i
        free = np.convolve(near, np.ones(DEGREE + 1)) > 0
        if np.count_nonzero(free) <= MOST_COEFFICIENTS:
            return knots, free, smoothing
        smoothing *= 1.5


def _graded(ends: FloatArray) -> FloatArray:
    """Ends of equal pieces, of which the outer ones are halved again and again towards their ends."""
    halves = (ends[1] - ends[0]) * 0.5 ** np.arange(END_HALVINGS, 0, -1)
    return np.concatenate([ends[:1], ends[0] + halves, ends[1:-1], ends[-1] - halves[::-1], ends[-1:]])


def _shapes(free: BoolArray) -> FloatArray:
    """Coefficients of the shapes that make up the spline, (coefficients, shapes).

    One for each free coefficient; but the first three are one, and so are the last three, since the first two
    derivatives vanish at an end where these are equal.
    """
    rows = np.arange(len(free))
    shape_of = np.clip(rows - DEGREE + 1, 0, len(free) - 2 * DEGREE + 1)
    shapes = np.zeros((len(free), shape_of[-1] + 1))
    shapes[rows, shape_of] = 1.0
    return shapes[:, np.any(shapes[free], axis=0)]


def _pieces_near(ends: FloatArray, times: FloatArray, reach: float) -> BoolArray:
    """Return the pieces with one of these ascending times in reach."""
    next_time = np.append(times, np.inf)[np.searchsorted(times, ends[:-1] - reach)]
    near: BoolArray = next_time <= ends[1:] + reach
    return near


def _least_amounts(bounds: Bounds, knots: FloatArray, shapes: FloatArray, smoothing: float) -> FloatArray:
    """Return the amount of each shape, with as many of the bounds as matter."""
    from scipy.interpolate import BSpline

    root = _objective(knots, shapes, smoothing)
    bounding = np.flatnonzero(bounds.excluding_zero)
    watched = bounding[evenly(len(bounding), MOST_COEFFICIENTS)]
    for _ in range(MOST_ROUNDS):
        rows = BSpline.design_matrix(bounds.time[watched], knots, DEGREE).toarray() @ shapes
        finite = np.isfinite(bounds.high[watched])
        above = np.concatenate([bounds.low[watched], -bounds.high[watched][finite]])
        amounts = _least_distance(root, np.concatenate([rows, -rows[finite]]), above)
        missed = bounds.missed_by(BSpline(knots, shapes @ amounts, DEGREE)(bounds.time))
        if missed.max() <= BOUND_ACCURACY:
            return amounts
        watched = np.union1d(watched, peaks(missed))
    raise NoSplineError


def _objective(knots: FloatArray, shapes: FloatArray, smoothing: float) -> FloatArray:
    """Upper triangular R such that |R x|^2 is the integral, in smoothing times; exact by Gauss' rule."""
    from scipy.interpolate import BSpline

    ends = knots[DEGREE:-DEGREE]
    half = np.diff(ends) / 2
    nodes, weights = np.polynomial.legendre.leggauss(DEGREE + 1)
    time = ((ends[:-1] + half)[:, None] + half[:, None] * nodes).ravel()
    share = np.sqrt(half[:, None] * weights / smoothing).ravel()
    basis = BSpline(knots, shapes, DEGREE)
    rows = [share[:, None] * basis(time), share[:, None] * smoothing**2 * basis(time, nu=2)]
    return np.asarray(np.linalg.qr(np.concatenate(rows), mode="r"), dtype=np.float64)


def _least_distance(root: FloatArray, rows: FloatArray, low: FloatArray) -> FloatArray:
    """Return the x of least |root x| with rows x >= low."""
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    distance_rows = solve_triangular(root, rows.T, trans="T")  # rows of y = root x
    problem = np.concatenate([distance_rows, low[None, :]])
    target = np.append(np.zeros(len(root)), 1.0)
    try:
        multipliers, _ = nnls(problem, target)
    except RuntimeError as error:  # too many iterations
        raise NoSplineError from error
    residual = problem @ multipliers - target
    if -residual[-1] < BOUND_ACCURACY:
        raise NoSplineError
    return np.asarray(solve_triangular(root, residual[:-1] / -residual[-1]), dtype=np.float64)


def peaks(missed: FloatArray) -> IndexArray:
    """Return the worst instant of each stretch at which bounds are missed."""
    padded = np.concatenate([[0.0], np.maximum(missed, 0), [0.0]])
    rising, falling = padded[1:-1] > padded[:-2], padded[1:-1] >= padded[2:]
    return np.flatnonzero(rising & falling & (missed > 0))


MARGIN_FACTORS = (1, 2, 4, 8)
"""Multiples of the margin tried where motor limits refuse the nearest profile: torques grow with 1/margin."""

SMOOTHING_FACTORS = (1, 2, 4, 8)
"""Multiples of the smoothing time tried in the same way: torques grow with the second derivative."""

CLEARANCE = 1e-6
"""Share of the largest change by which a profile keeps clear of its bounds, so that rounding crosses none."""


@dataclass(frozen=True, eq=False)
class Change:
    """The addition to the stiffness of a joint.

    Attributes:
        time: (instants,) in s.
        rows: the change, its rate and its second derivative, (3, instants), N m/rad (N/m) per s^k.
    """

    time: FloatArray
    rows: FloatArray

    @classmethod
    def constant(cls, time: FloatArray, value: float) -> Change:
        """Return a change that is the same at every instant."""
        rows = np.zeros((3, len(time)))
        rows[0] = value
        return cls(time, rows)

    @property
    def rms(self) -> float:
        """Root of the mean square over time, N m/rad (N/m)."""
        from scipy.integrate import trapezoid

        duration = self.time[-1] - self.time[0]
        return math.sqrt(float(trapezoid(self.rows[0] ** 2, self.time)) / duration)


def nearest_change(acceptance: Acceptance, joint: Joint, load: Load, constant: float | None) -> Change:
    """Return the smoothed C2 change of least mean square that fixes a joint; the constant one if nearer.

    Where the limits of the motors refuse it, the nearest of some that are smoother and keep further away from
    the ends of the corridor.

    Args:
        acceptance: the rule.
        joint: the joint, at least one of whose steps is refused.
        load: its steps and instants between them, all of which are to be accepted.
        constant: the constant that fixes the joint, if there is one.

    Raises:
        ImpossibleError: with the reason.
    """
    _check_possible(acceptance, joint, load)
    nearest, *others = product(MARGIN_FACTORS, SMOOTHING_FACTORS)
    change = _change(acceptance, joint, load, *nearest)
    tried = [change] if constant is None else [change, Change.constant(load.time, constant)]
    if not _accepted(acceptance, joint, load, change):
        tried += [_change(acceptance, joint, load, *factors) for factors in others]
    accepted = [each for each in tried if each is not None and _accepted(acceptance, joint, load, each)]
    if not accepted:
        raise ImpossibleError(_reason(acceptance, joint, load, change))
    return min(accepted, key=lambda each: each.rms)


def _check_possible(acceptance: Acceptance, joint: Joint, load: Load) -> None:
    """Refuse a task that no stiffness can fix."""
    low, high = checked_range(acceptance, joint, load)
    worst = int((low - high).argmax())
    if low[worst] > high[worst]:
        raise ImpossibleError(
            f"{joint.name} needs at least {stiffness_text(joint, low[worst])} at t = {load.time[worst]:.3f} s"
            f", but its limits of stiffness and deflection allow at most {high[worst]:.6g}"
        )


def _change(
    acceptance: Acceptance, joint: Joint, load: Load, margins: float, smoothings: float
) -> Change | None:
    """Return the nearest change for multiples of margin and smoothing time, or None if no spline does."""
    near_singular = margins * acceptance.near_singular
    if near_singular >= 1:
        return None
    admissible = admissible_stiffness(joint, load.command, near_singular)
    asked = load.command.commanded["stiffness"]
    bounds = _narrowed(load.time, admissible.low - asked, admissible.high - asked)
    if np.any(bounds.low > bounds.high):
        return None
    if not bounds.excluding_zero.any():
        return Change.constant(load.time, 0.0)
    try:
        # a piece between two steps is what a file with all derivatives at the steps says of the time between
        spline = nearest_spline(bounds, smoothings * _smoothing_time(joint, load), load.time[load.steps])
    except NoSplineError:
        return None
    return Change(load.time, np.stack([spline(load.time, nu=order) for order in range(DEGREE)]))


def _narrowed(time: FloatArray, low: FloatArray, high: FloatArray) -> Bounds:
    """Bounds a little narrower, unless that would leave nothing between them."""
    clearance = CLEARANCE * max(low.max(), -high.min(), 0.0)
    middle = (low + high) / 2
    wide = high - low > 2 * clearance
    return Bounds(time, np.where(wide, low + clearance, middle), np.where(wide, high - clearance, middle))


def _smoothing_time(joint: Joint, load: Load) -> float:
    """sqrt(B/sigma): the motors follow slower changes with little torque of inertia; at least three steps."""
    inertia = max(motor.inertia for motor in variable_stiffness_actuator(joint).motors)
    resonance = math.sqrt(inertia / float(load.command.commanded["stiffness"].min()))
    step = float(np.median(np.diff(load.time[load.steps])))
    return min(max(resonance, 3 * step), float(load.time[-1] - load.time[0]))


def _accepted(acceptance: Acceptance, joint: Joint, load: Load, change: Change | None) -> bool:
    return change is not None and not acceptance.refused_steps(joint, load.changed(*change.rows)).any()


def _reason(acceptance: Acceptance, joint: Joint, load: Load, change: Change | None) -> str:
    if change is None:
        return f"what {joint.name} may have is too narrow, or changes too fast, for a smooth profile"
    reason = acceptance.reason(joint, load.changed(*change.rows))
    return f"none that was tried keeps every limit of {joint.name}; with the nearest, {reason}"
