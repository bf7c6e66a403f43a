"""Solution of (14) for a potential by numerical continuation, on the branch of a start.

`LevelCurves.step` is a predictor-corrector step along a level curve of the torque that stays on one monotone
piece of the stiffness. `ContinuedBranch` continues the start to the torque of a sample, and from there to
both ends of the piece and to the demanded stiffness.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms.potentials.potential_energy import STIFFNESS_DERIVATIVES, PotentialEnergy
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.control_flow import Values, repeat
from vsacli.compute.rounding import OfRounding

# With the bounds below no step left its branch on any of 4,000 level curves of 100 random potentials, of the
# kind that tests/actuators/test_potential_mechanism.py draws.

MAX_STEP = 0.1
"""Longest step, as a share of the ranges."""

LEAST_STEP = OfRounding(1e-13, power=0.9)
"""Length below which a step changes nothing."""

LEAST_COSINE = 0.95
"""Smallest cosine of the angle between the level curve before and after a step."""

LEAST_SHARE = 0.25
"""Smallest ratio of stiffness, and of the sine, after and before a step, so that a step passes no zero."""

SHORT_STEP = 1e-3
"""Step, as a share of the ranges, below which the change of stiffness is not checked. The steps from the
start to another torque have no length along the level curve."""

MOST_UNEXPLAINED = 0.1
"""Largest share of the change of stiffness that its slopes at both ends of a step do not explain. If the
slope changes its sign twice in between, they explain little."""

LEVEL_ERROR = OfRounding(1e-5, power=0.25)
"""Largest distance from the level curve after a step, as a share of the ranges; the next step corrects it."""

CONTRACTION = 0.1
"""Largest ratio of two successive Newton corrections with which the method counts as convergent."""


class LevelPoint(NamedTuple):
    """A point (phi, theta_2); arrays (samples,).

    Attributes:
        phi: Deflection.
        s: theta_2.
        tau_e: Elastic torque.
        stiffness: Stiffness of the joint.
        torque_1: Change of the torque with phi, over the range of phi.
        torque_2: Change of the torque with theta_2, over the range of theta_2.
        stiffness_1: Change of the stiffness with phi, over the range of phi.
        stiffness_2: Change of the stiffness with theta_2, over the range of theta_2.
    """

    phi: FloatArray
    s: FloatArray
    tau_e: FloatArray
    stiffness: FloatArray
    torque_1: FloatArray
    torque_2: FloatArray
    stiffness_1: FloatArray
    stiffness_2: FloatArray

    @property
    def steepness(self) -> FloatArray:
        """Length of the torque's gradient."""
        return vector_length(self.torque_1, self.torque_2)

    @property
    def sine(self) -> FloatArray:
        """Sine of the angle from the torque's gradient to that of the stiffness: zero where A is singular."""
        determinant = self.torque_1 * self.stiffness_2 - self.torque_2 * self.stiffness_1
        return determinant / (self.steepness * vector_length(self.stiffness_1, self.stiffness_2))

    @property
    def slope(self) -> FloatArray:
        """Slope of the stiffness along the level curve."""
        return (self.torque_1 * self.stiffness_2 - self.torque_2 * self.stiffness_1) / self.steepness

    @property
    def along(self) -> tuple[FloatArray, FloatArray]:
        """Unit vector along the level curve, over the ranges; the stiffness grows if the sine is positive."""
        return -self.torque_2 / self.steepness, self.torque_1 / self.steepness

    def newton_step(self, tau_e: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the Newton step to a torque and a stiffness, as a share of the ranges."""
        errors = tau_e - self.tau_e, stiffness - self.stiffness
        determinant = self.torque_1 * self.stiffness_2 - self.torque_2 * self.stiffness_1
        return (
            (self.stiffness_2 * errors[0] - self.torque_2 * errors[1]) / determinant,
            (self.torque_1 * errors[1] - self.stiffness_1 * errors[0]) / determinant,
        )

    def where(self, mask: BoolArray, other: LevelPoint) -> LevelPoint:
        """Return this point where the mask holds, else the other."""
        return LevelPoint(*(np.where(mask, *pair) for pair in zip(self, other, strict=True)))


def vector_length(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the length of a vector; `numpy.hypot` takes ten times as long to avoid overflow."""
    return np.sqrt(a * a + b * b)


class LevelCurves:
    """The level curves of a potential within ranges.

    Args:
        potential: Potential.
        phi: Range of the deflection.
        theta_2: Range of motor 2.
    """

    def __init__(
        self, potential: PotentialEnergy, phi: tuple[float, float], theta_2: tuple[float, float]
    ) -> None:
        self._potential = potential
        self._low = phi[0], theta_2[0]
        self._width = phi[1] - phi[0], theta_2[1] - theta_2[0]

    def point_at(self, phi: FloatArray, s: FloatArray, q: FloatArray) -> LevelPoint:
        """Return the point at a deflection, a position of motor 2 and one of the joint."""
        derivatives = self._potential.derivatives((phi, s, q), STIFFNESS_DERIVATIVES)
        matrix, (phi_width, s_width) = derivatives.matrix, self._width
        return LevelPoint(
            phi,
            s,
            -derivatives(0),
            derivatives(0, 0),
            matrix.torque_1 * phi_width,
            matrix.torque_2 * s_width,
            matrix.stiffness_1 * phi_width,
            matrix.stiffness_2 * s_width,
        )

    def move(self, point: LevelPoint, step: tuple[FloatArray, FloatArray], q: FloatArray) -> LevelPoint:
        """Return a point moved by a step, as a share of the ranges."""
        return self.point_at(point.phi + self._width[0] * step[0], point.s + self._width[1] * step[1], q)

    def project_onto(self, point: LevelPoint, tau_e: FloatArray) -> LevelPoint:
        """Return the nearest point on the level curve of a torque, with its stiffness, to first order."""
        share = (tau_e - point.tau_e) / (point.steepness * point.steepness)
        stiffness_change = point.stiffness_1 * point.torque_1 + point.stiffness_2 * point.torque_2
        return point._replace(
            phi=point.phi + self._width[0] * point.torque_1 * share,
            s=point.s + self._width[1] * point.torque_2 * share,
            stiffness=point.stiffness + stiffness_change * share,
        )

    def distance_to_range_end(self, point: LevelPoint) -> FloatArray:
        """Return the distance to the nearest end of a range, as a share of it; negative outside."""
        phi, s = (
            (value - low) / width for value, low, width in zip(point[:2], self._low, self._width, strict=True)
        )
        return np.minimum(np.minimum(phi, 1 - phi), np.minimum(s, 1 - s))

    def room(self, point: LevelPoint) -> FloatArray:
        """Return a measure of the distance from all ends of the piece, zero at each of them."""
        room: FloatArray = np.abs(point.sine) * point.stiffness
        for value, low, width in zip(point[:2], self._low, self._width, strict=True):
            share_of_range = (value - low) / width
            room = room * share_of_range * (1 - share_of_range)
        return room

    def step(
        self, point: LevelPoint, h: FloatArray, tau_e: FloatArray, q: FloatArray, dq: FloatArray | float = 0.0
    ) -> tuple[LevelPoint, BoolArray]:
        """Return a step of length h along a level curve, back onto tau_e, and whether it stays on the piece.

        Args:
            point: Point at which to begin.
            h: Length, as a share of the ranges; the stiffness grows with it if the sine is positive.
            tau_e: Torque of the level curve.
            q: Position of the joint.
            dq: Distance of q from the joint position at `point`.
        """
        along_phi, along_s = point.along
        torque_slope_q = (
            point.torque_1 / self._width[0] - point.stiffness
        )  # of the torque, at constant phi and theta_2
        normal_step = (tau_e - point.tau_e - torque_slope_q * dq) / (point.steepness * point.steepness)
        step = h * along_phi + normal_step * point.torque_1, h * along_s + normal_step * point.torque_2
        predicted = self.move(point, step, q)
        normal_step = (tau_e - predicted.tau_e) / (predicted.steepness * predicted.steepness)
        correction = normal_step * predicted.torque_1, normal_step * predicted.torque_2
        reached = self.move(point, (step[0] + correction[0], step[1] + correction[1]), q)
        correction_length, remaining_error = (
            vector_length(*correction),
            np.abs(tau_e - reached.tau_e) / reached.steepness,
        )
        expected_change = h * (point.slope + reached.slope) / 2
        stiffness_change = (
            self.project_onto(reached, tau_e).stiffness - self.project_onto(point, tau_e).stiffness
        )
        cosine = along_phi * reached.along[0] + along_s * reached.along[1]
        stays = (
            (vector_length(step[0], step[1]) + correction_length <= 2 * MAX_STEP)
            & (remaining_error <= np.minimum(CONTRACTION * correction_length + LEAST_STEP, LEVEL_ERROR))
            & (cosine >= LEAST_COSINE)
            & (
                (np.abs(h) < SHORT_STEP)
                | (np.abs(stiffness_change - expected_change) <= MOST_UNEXPLAINED * np.abs(expected_change))
            )
            & (reached.stiffness >= LEAST_SHARE * point.stiffness)
            & (reached.sine / point.sine >= LEAST_SHARE)
        )
        return reached, stays


CLOSE, NEWTON_STEPS = 1e-4, 4
"""Length of a Newton step to a torque and a stiffness, as a share of the ranges and for a sine of one, from
which `NEWTON_STEPS` steps converge to rounding: each squares it."""

LEAST_SINE = OfRounding(1e-8, power=0.5)
"""Sine that counts as zero; the stiffness differs from that of the critical point by the square of this."""

LEAST_STIFFNESS = 1e-9
"""Stiffness relative to that at the start that counts as zero."""

MAX_STEPS = 400
"""Largest number of steps. About 60 suffice; more are needed only where the level curve winds."""

RESIDUAL = OfRounding(1e-10, power=0.75)
"""Largest error of a solution: of the stiffness; of the torque, as a share of its change over the ranges."""


class StiffnessPiece(NamedTuple):
    """A point of the piece, and its ends of least and of largest stiffness."""

    seed: LevelPoint
    low: LevelPoint
    high: LevelPoint


class ContinuedBranch:
    """Solutions continued from a start, at which q = 0.

    Attributes:
        start: Start, arrays (1,).
        orientation: Sign of the sine on the branch.
    """

    def __init__(self, curves: LevelCurves, phi: float, theta_2: float) -> None:
        self._curves = curves
        self._cached_piece: tuple[tuple[FloatArray, FloatArray], StiffnessPiece] | None = None
        with np.errstate(all="ignore"):
            self.start = curves.point_at(np.array([phi]), np.array([theta_2]), np.zeros(1))
            self.orientation = float(np.sign(self.start.sine[0]))

    @property
    def stiffest(self) -> LevelPoint:
        """Point of the largest stiffness at the torque of the start, arrays (1,)."""
        with np.errstate(all="ignore"):
            return self._piece_by_walks(self.start.tau_e, np.zeros(1)).high

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """See `Mechanism.solve`."""
        with np.errstate(all="ignore"):  # trial steps may leave the range; they are rejected
            seed, low, high = self._pieces_at(tau_e, q)
            is_zero = low.stiffness <= LEAST_STIFFNESS * self.start.stiffness
            lower = np.where(is_zero, 0.0, low.stiffness)
            is_attainable = (stiffness > lower) & (stiffness < high.stiffness)
            solution = self._point_of_stiffness(
                seed, np.where(is_attainable, stiffness, seed.stiffness), tau_e, q
            )
            is_failed = is_attainable & ~self._is_solved(solution, stiffness, tau_e)
            end = high.where(stiffness >= high.stiffness, low)
        return PairSolution(
            lower=np.where(is_failed, np.nan, lower),
            upper=np.where(is_failed, np.nan, high.stiffness),
            lower_critical=~is_zero & self._is_critical(low),
            upper_critical=self._is_critical(high),
            slack_below=np.zeros_like(is_failed),
            phi_1=np.where(is_attainable, solution.phi, end.phi),
            phi_2=np.where(is_attainable, solution.s, end.s),
        )

    def _pieces_at(self, tau_e: FloatArray, q: FloatArray) -> StiffnessPiece:
        """Return the pieces at torques and positions.

        The last pieces are kept, since searches solve for the same torques repeatedly.
        """
        if not isinstance(tau_e, np.ndarray):
            return self._piece_by_walks(tau_e, q)
        last = self._cached_piece
        if last is None or not all(map(np.array_equal, last[0], (tau_e, q))):
            self._cached_piece = last = (tau_e.copy(), q.copy()), self._piece_by_walks(tau_e, q)
        return last[1]

    def _piece_by_walks(self, tau_e: FloatArray, q: FloatArray) -> StiffnessPiece:
        """Return the pieces, by walks to both ends, computed as one array."""
        seed, count = self._seed_point(tau_e, q), len(tau_e)
        doubled = [np.concatenate((values, values)) for values in (tau_e, q, *seed)]
        side = np.concatenate((np.full_like(tau_e, -1.0), np.ones_like(tau_e)))
        ends = self._walk_to_goal(LevelPoint(*doubled[2:]), side, side * np.inf, doubled[0], doubled[1])
        return StiffnessPiece(
            seed,
            LevelPoint(*(values[:count] for values in ends)),
            LevelPoint(*(values[count:] for values in ends)),
        )

    def _seed_point(self, tau_e: FloatArray, q: FloatArray) -> LevelPoint:
        """Return a point of the branch at torques and positions, NaN where there is none.

        Torque and position move proportionally from the start to their values. Meanwhile the point moves
        along the level curve away from the ends of the piece, so that the continuation survives a short one.
        """

        def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
            share, gain, h, *values = state
            point, (tau_e, q) = LevelPoint(*values), constants
            start = self.start.tau_e + np.zeros_like(tau_e)
            target = np.minimum(share + gain, 1.0)
            reached, stays = self._curves.step(
                point, np.zeros_like(h), start + target * (tau_e - start), target * q, (target - share) * q
            )
            stays = stays & (self._curves.distance_to_range_end(reached) >= 0)
            point, share = reached.where(stays, point), np.where(stays, target, share)
            sidestep, is_better = self._curves.step(point, h, start + share * (tau_e - start), share * q)
            is_better = is_better & (self._curves.distance_to_range_end(sidestep) >= 0)
            is_better = is_better & (self._curves.room(sidestep) > self._curves.room(point))
            h = np.where(is_better, 1.5 * h, -h / 2)
            h = np.where(np.abs(h) > MAX_STEP, MAX_STEP, h)
            gain = np.where(stays, 2 * gain, gain / 3)
            return (share, gain, h, *sidestep.where(is_better, point)), (share == 1) | ~(gain > LEAST_STEP)

        zero = np.zeros_like(tau_e)
        initial_state = (zero, zero + 0.25, zero + 0.02, *(zero + component for component in self.start))
        share, _, _, *values = repeat(step, initial_state, (tau_e, q), MAX_STEPS)
        return LevelPoint(*(np.where(share == 1, component, np.nan) for component in values))

    def _walk_to_goal(
        self, seed: LevelPoint, direction: FloatArray, goal: FloatArray, tau_e: FloatArray, q: FloatArray
    ) -> LevelPoint:
        """Return the goal, or the end of the piece before it; direction 1 for growing stiffness, else -1."""

        def step(state: Values, constants: Values) -> tuple[Values, BoolArray]:
            h, *values = state
            point, (direction, goal, tau_e, q) = LevelPoint(*values), constants
            reached, stays = self._curves.step(point, h * direction * self.orientation, tau_e, q)
            room_before, room_after = (
                np.minimum(
                    self._curves.distance_to_range_end(projected),
                    direction * (goal - projected.stiffness) / point.stiffness,
                )
                for projected in (
                    self._curves.project_onto(point, tau_e),
                    self._curves.project_onto(reached, tau_e),
                )
            )
            is_inside = stays & (room_after >= 0)
            share = np.where(
                stays, np.minimum(np.maximum(room_before / (room_before - room_after), 0.02), 0.98), 1 / 3
            )
            is_finished = ~is_inside & ((h * share <= LEAST_STEP) | (room_before <= LEAST_STEP))
            is_finished = is_finished | (
                vector_length(*point.newton_step(tau_e, goal)) <= CLOSE * np.abs(point.sine)
            )
            point = reached.where(is_inside, point)
            is_zero = point.stiffness <= LEAST_STIFFNESS * self.start.stiffness
            h = np.where(is_inside, np.minimum(1.5 * h, MAX_STEP), h * share)
            return (h, *point), is_finished | is_zero | ~(point.sine * self.orientation > LEAST_SINE)

        initial_state = (np.full_like(tau_e, MAX_STEP / 4), *seed)
        _, *values = repeat(step, initial_state, (direction, goal, tau_e, q), MAX_STEPS)
        end = self._curves.project_onto(LevelPoint(*values), tau_e)
        return self._curves.point_at(end.phi, end.s, q)

    def _point_of_stiffness(
        self, seed: LevelPoint, demand: FloatArray, tau_e: FloatArray, q: FloatArray
    ) -> LevelPoint:
        """Return the point of the piece with a stiffness: by a walk, then by Newton's method."""
        direction = np.where(demand >= seed.stiffness, 1.0, -1.0)
        point = self._walk_to_goal(seed, direction, demand, tau_e, q)
        for _ in range(NEWTON_STEPS):
            step = point.newton_step(tau_e, demand)
            is_small = vector_length(*step) <= CONTRACTION * np.abs(point.sine)
            point = self._curves.move(
                point, (np.where(is_small, step[0], 0.0), np.where(is_small, step[1], 0.0)), q
            )
        return point

    def _is_solved(self, point: LevelPoint, demand: FloatArray, tau_e: FloatArray) -> BoolArray:
        return (np.abs(tau_e - point.tau_e) <= RESIDUAL * point.steepness) & (
            np.abs(demand - point.stiffness) <= RESIDUAL * (self.start.stiffness + demand)
        )

    def _is_critical(self, point: LevelPoint) -> BoolArray:
        return np.abs(point.sine) / 10 <= LEAST_SINE
