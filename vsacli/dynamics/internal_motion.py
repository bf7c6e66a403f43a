"""Internal motion of transmissions with a damper: states of the inverse dynamics, integrated over time.

Collocation at Radau points solves the implicit differential equation d w = tau_l - T in cells of time. Radau
IIA methods are L-stable and stiffly accurate (Hairer & Wanner, Solving Ordinary Differential Equations II,
IV.5): a fast motion that has decayed does not shorten the cells, whose polynomial is the dense output.
`internal_motions` marches each joint through the trajectory; `actuators.damped_springs` has the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from vsacli.actuators.damped_springs import DampedSprings
from vsacli.actuators.transmission import Command, InternalMotion
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import DAMPING
from vsacli.dynamics.dampers import joints_with_parallel_damper
from vsacli.dynamics.integrated_deflections import Pieces
from vsacli.dynamics.inverse import DeflectionStop, command_of, link_torques_along
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

STAGES = 12
"""Stages per cell: with 12, half a second from rest to rest is exact to rounding in about 40 cells."""


class Collocation:
    """Collocation at the Radau points of the cell [-1, 1], scaled to cells of time."""

    def __init__(self, stages: int = STAGES) -> None:
        self._nodes = np.append(scipy.special.roots_jacobi(stages - 1, 1, 0)[0], 1.0)
        # From values at -1 and the nodes to coefficients of Chebyshev polynomials, and from the nodes alone.
        self._to_coefficients = np.linalg.inv(chebyshev.chebvander(np.append(-1.0, self._nodes), stages))
        self._nodes_to_coefficients = np.linalg.inv(chebyshev.chebvander(self._nodes, stages - 1))
        derivatives = chebyshev.chebder(self._to_coefficients)
        self._slopes: FloatArray = chebyshev.chebvander(self._nodes, stages - 1) @ derivatives

    def times(self, start: float, end: float) -> FloatArray:
        """Return the nodes of a cell, (stages,), s."""
        return start + (end - start) / 2 * (1 + self._nodes)

    def slopes(self, start: float, end: float) -> FloatArray:
        """Return the matrix from values at start and nodes to rates at nodes, (stages, stages + 1), 1/s."""
        return self._slopes * (2 / (end - start))

    def coefficients(self, values: FloatArray) -> FloatArray:
        """Return the coefficients from values at the start and at the nodes, (..., stages + 1)."""
        return values @ self._to_coefficients.T

    def coefficients_of_rates(self, values: FloatArray) -> FloatArray:
        """Return the coefficients from values at the nodes, (..., stages)."""
        return values @ self._nodes_to_coefficients.T


class Piecewise:
    """A piecewise polynomial, with coefficients of Chebyshev polynomials in each cell.

    Args:
        ends: Ends of the cells, ascending, (cells + 1,), s.
        coefficients: (cells, rows, degree + 1).
    """

    def __init__(self, ends: FloatArray, coefficients: FloatArray) -> None:
        self.ends, self._coefficients = ends, coefficients

    def at(self, time: FloatArray) -> FloatArray:
        """Return the values, (rows, samples); beyond the ends those of the nearest cell."""
        cell = np.clip(np.searchsorted(self.ends, time, side="right") - 1, 0, len(self.ends) - 2)
        left, right = self.ends[cell], self.ends[cell + 1]
        local_time = np.clip(2 * (time - left) / (right - left) - 1, -1.0, 1.0)
        basis = chebyshev.chebvander(local_time, self._coefficients.shape[2] - 1)
        return np.asarray(np.einsum("srd,sd->rs", self._coefficients[cell], basis), dtype=np.float64)


FIRST_CELLS = 8
"""Number of cells of a trajectory at first; cells that a polynomial does not fit are halved."""

RESOLVED = 1e-14
"""Size of the last coefficients of a polynomial, relative to the largest deflection, that is rounding."""

POSITION_ROUNDING = 2 * np.finfo(float).eps
"""Rounding of a deflection theta - q, relative to q: that of q and that of theta, which is about as large."""

LEAST_SHARE, LEAST_SPREAD = 1e-6, 1e-9
"""Smallest scale of a spread: as a share of the largest deflection, and in rad (m)."""

TOLERATED, GAIN = 1e-9, 4.0
"""Share below which a cell is halved again only if two halvings lowered it by the factor `GAIN`. Otherwise
it is noise of the trajectory itself, whose knots may be denser than the cells."""

HALVINGS = 20
"""Largest number of halvings; they locate the end of a motion to a millionth of a first cell."""

LAYER = 4.0
"""Largest cell, in time constants, at a breakpoint of the demand: the polynomial of a longer one could miss a
fast decay there."""

FAST = 100.0
"""Time constants of a cell above which rates come from the polynomial of the spread, not from the equation.

The equation has the rounding error eps T/d, the polynomial about eps spread STAGES^2 2/duration, which is
smaller beyond 288 time constants, and for the next derivative beyond 170.
"""

NEWTON_STEPS = 20
"""Largest number of Newton steps; five are usual."""

CONVERGED = 1e-12
"""Step relative to the spread after which the next, which is quadratic in it, is rounding.

Where the load passes zero, the spread is rounding itself; the step is then relative to the spread of the peak
torque.
"""

LOST, SINGULAR = (
    "its springs cannot have the stiffness at the deflection that the damper has let through",
    "the stiffness does not determine the second motor any more",
)
"""Reasons why a motion ends."""


class MarchedMotion(NamedTuple):
    """An internal motion as functions of time.

    Attributes:
        phi: Deflections, (2, samples), up to `end`; None if the motion ends at once.
        rates: w and its derivative, (2, samples), as above.
        end: End of the motion, s.
        reason: Reason of the end; None at the end of the trajectory.
    """

    phi: Piecewise | None
    rates: Piecewise | None
    end: float
    reason: str | None


class _CellSolution(NamedTuple):
    """Solution in a cell, at its start and nodes, or at its nodes alone.

    Attributes:
        phi: Deflections, (2, 1 + stages).
        rates: w and its derivative by the equation, (2, stages).
        torque: Largest |tau_e| in the cell.
        damping: Largest damping in the cell.
        constants: Duration of the cell in its smallest time constant.
        rounding: Rounding of the deflections.
        slope: Largest slope of the torque of the springs in the cell.
    """

    phi: FloatArray
    rates: FloatArray
    torque: float
    damping: float
    time_constants: float
    rounding: float
    slope: float


class _Cell(NamedTuple):
    """A cell to be solved.

    Attributes:
        left, right: Ends of the cell, s.
        new: Whether the cell begins at a breakpoint of the demand.
        shares: Shares of the last coefficients two halvings and one halving before.
        halvings: Number of halvings.
    """

    left: float
    right: float
    at_breakpoint: bool = True
    shares: tuple[float, float] = (np.inf, np.inf)
    halvings: int = 0

    def halves(self, share: float) -> tuple[_Cell, _Cell]:
        """Return the left and the right half."""
        middle = (self.left + self.right) / 2
        return (
            _Cell(self.left, middle, self.at_breakpoint, (self.shares[1], share), self.halvings + 1),
            _Cell(middle, self.right, False, (self.shares[1], share), self.halvings + 1),
        )


class March:
    """Solver of d w = tau_l - T, cell after cell, from initial deflections.

    Args:
        springs: Springs of the joint.
        demand: Function from times (samples,), s, to the command of the joint.
    """

    def __init__(self, springs: DampedSprings, demand: Callable[[FloatArray], Command]) -> None:
        self._springs, self._demand, self._rule = springs, demand, Collocation()

    def solve_cells(self, ends: FloatArray, phi: FloatArray) -> MarchedMotion:
        """Return the motion from deflections (2, 1); the demand is smooth between adjacent `ends`, s."""
        cell_ends, fits = [float(ends[0])], list[tuple[FloatArray, FloatArray]]()
        peaks = _Peaks(self._springs, self._demand(ends), phi)
        pending = [_Cell(left, right) for left, right in pairwise(ends.tolist())][::-1]
        while pending:
            cell = pending.pop()
            outcome = self._solve_cell(cell, phi, peaks.torque)
            if isinstance(outcome, str):
                share, unresolved = np.inf, True
            else:
                fit = self._fit_cell(cell, outcome)
                share = peaks.share(*fit, outcome)
                settling = cell.at_breakpoint and outcome.time_constants > LAYER
                decreasing = share < cell.shares[0] / GAIN
                unresolved = share > RESOLVED and (share > TOLERATED or decreasing or settling)
            if unresolved and cell.halvings < HALVINGS:
                pending += cell.halves(share)[::-1]
            elif isinstance(outcome, str):
                return MarchedMotion(*_concatenate_cells(cell_ends, fits), cell.left, outcome)
            else:
                phi = outcome.phi[:, -1:]
                fits.append(fit)
                cell_ends.append(cell.right)
        return MarchedMotion(*_concatenate_cells(cell_ends, fits), cell_ends[-1], None)

    def _fit_cell(self, cell: _Cell, solution: _CellSolution) -> tuple[FloatArray, FloatArray]:
        """Return coefficients of deflections and rates; in fast cells, rates are derivatives of the fit."""
        phi = self._rule.coefficients(solution.phi)
        if solution.time_constants <= FAST:
            return phi, self._rule.coefficients_of_rates(solution.rates)
        half = (cell.right - cell.left) / 2
        first = chebyshev.chebder(self._springs.spread(phi)) / half
        second = np.append(chebyshev.chebder(first) / half, 0.0)
        return phi, np.stack((first, second))

    def _solve_cell(self, cell: _Cell, start: FloatArray, peak: float) -> _CellSolution | str:
        """Return deflections in a cell from those at its start, by Newton's method, or a reason of failure.

        Args:
            cell: Cell to solve.
            start: Deflections (2, 1).
            peak: Torque so far, N m (N).
        """
        springs, command = self._springs, self._demand(self._rule.times(cell.left, cell.right))
        slopes, damping = self._rule.slopes(cell.left, cell.right), command.commanded[DAMPING.key]
        initial_spread, pivot_sign = (
            springs.spread(start),
            np.sign(springs.springs_at(start, command.q[:1]).pivot),
        )
        spread, phi = initial_spread + 0 * command.q, start + 0 * command.q
        converged, rounding = False, POSITION_ROUNDING * _largest_size(command.q)
        for _ in range(NEWTON_STEPS):
            phi = springs.deflections_at_spread(spread, phi, command)
            if np.isnan(phi[0]).any() or not springs.laws_hold(phi).all():
                return LOST
            springs_at_phi = springs.springs_at(phi, command.q)
            if (np.sign(springs_at_phi.pivot) != pivot_sign).any():
                return SINGULAR
            if converged:
                fastest = np.max(np.abs(springs_at_phi.slope) / damping)
                return _CellSolution(
                    np.hstack((start, phi)),
                    np.stack(springs.damper_motion(phi, command)),
                    float(np.max(np.abs(command.tau_e))),
                    float(np.max(damping)),
                    (cell.right - cell.left) * float(fastest),
                    rounding,
                    _largest_size(springs_at_phi.slope),
                )
            rate = slopes[:, 0] * initial_spread + slopes[:, 1:] @ spread
            torque_error = command.tau_e - springs_at_phi.state.tau_e - damping * rate
            slope = springs_at_phi.slope
            jacobian = damping[:, None] * slopes[:, 1:] + np.diag(slope)
            step = np.asarray(np.linalg.solve(jacobian, torque_error), dtype=np.float64)
            spread = spread + step
            converged = _largest_size(step) <= max(
                CONVERGED * _largest_size(spread), CONVERGED * peak / _largest_size(slope), rounding
            )
        return LOST


class _Peaks:
    """Largest values so far, as scales of the last coefficients.

    A motion from rest begins with torques that are only rounding, so torques at the ends of the first cells
    are included from the start.

    Args:
        springs: Springs of the joint.
        demand: Commands at the ends of the first cells.
        start: Deflections at the first end.

    Attributes:
        torque: Largest torque, N m (N).
    """

    def __init__(self, springs: DampedSprings, demand: Command, start: FloatArray) -> None:
        self._springs = springs
        self._start_slope = _largest_size(springs.slope(start, demand.q[:1]))
        self.torque = _largest_size(demand.tau_e)
        self._phi_peak, self._spread_peak = 0.0, LEAST_SPREAD

    def share(self, phi: FloatArray, rates: FloatArray, solution: _CellSolution) -> float:
        """Return the last coefficients of deflections, spread and torque, relative to the peaks so far.

        Positions of many turns are rounded; no cell is short enough for coefficients below that.
        """
        spread = self._springs.spread(phi)
        self._phi_peak = max(self._phi_peak, float(np.nanmax(np.abs(phi))))
        self._spread_peak = max(self._spread_peak, _largest_size(spread), LEAST_SHARE * self._phi_peak)
        self.torque = max(self.torque, solution.torque, self._start_slope * self._spread_peak)
        truncation = (
            float(np.nanmax(np.abs(phi[:, -2:]))) - solution.rounding,
            _largest_size(spread[-2:]) - solution.rounding,
        )
        share = max(0.0, truncation[0] / max(self._phi_peak, LEAST_SPREAD), truncation[1] / self._spread_peak)
        if solution.time_constants > FAST:
            return share
        torque_truncation = (
            solution.damping * _largest_size(rates[0, -2:]) - solution.slope * solution.rounding
        )
        return max(share, torque_truncation / self.torque)


def _largest_size(values: FloatArray) -> float:
    return float(np.max(np.abs(values)))


def _concatenate_cells(
    cell_ends: list[float], fits: list[tuple[FloatArray, FloatArray]]
) -> tuple[Piecewise | None, Piecewise | None]:
    """Return the deflections and rates over all cells."""
    if not fits:
        return None, None
    phi, rates = (
        Piecewise(np.array(cell_ends), np.stack(coefficients)) for coefficients in zip(*fits, strict=True)
    )
    return phi, rates


@dataclass(frozen=True)
class InternalMotions:
    """Internal motions of damped transmissions; a joint whose damping is always zero has none.

    Attributes:
        joints: Indices of the joints with an internal motion.
        stops: Time and reason, by joint, if the motion ends before the trajectory does.
    """

    joints: tuple[int, ...]
    stops: Mapping[int, DeflectionStop]
    _motions: Mapping[int, MarchedMotion] = field(repr=False)

    @property
    def breakpoints(self) -> FloatArray:
        """Ends of the cells, s after the first sample; cells are short where an internal motion decays."""
        ends = [motion.phi.ends for motion in self._motions.values() if motion.phi is not None]
        return np.unique(np.concatenate([np.zeros(0), *ends]))

    def at(self, elapsed: FloatArray) -> dict[int, InternalMotion]:
        """Return the motion of each joint at times, s after the first sample; NaN from a stop on."""
        return {joint: self._motion_of_joint(joint, elapsed) for joint in self.joints}

    def _motion_of_joint(self, joint: int, elapsed: FloatArray) -> InternalMotion:
        marched = self._motions[joint]
        if marched.phi is None or marched.rates is None:
            absent = np.full_like(elapsed, np.nan)
            return InternalMotion(np.stack((absent, absent)), absent, absent)
        ended = (elapsed >= marched.end) & (marched.reason is not None)
        phi, rates = (
            np.where(ended, np.nan, polynomial.at(elapsed)) for polynomial in (marched.phi, marched.rates)
        )
        return InternalMotion(phi, *rates)


def internal_motions(robot: Robot, trajectory: Trajectory) -> InternalMotions:
    """Integrate the internal motions of a robot's damped transmissions over the trajectory.

    The integration uses the smooth functions of the trajectory and ignores derivatives given with samples.
    """
    start, trajectory = trajectory.start, trajectory.from_zero()
    joints = damped_joints(robot, trajectory)
    demand = _JointCommands(robot, trajectory)
    uniform_ends = np.linspace(0.0, trajectory.duration, FIRST_CELLS + 1)
    ends = np.union1d(uniform_ends, Pieces.of(trajectory, 0.0).ends)
    springs = {index: DampedSprings(robot.joints[index].actuator) for index in joints}
    marched = {}
    with np.errstate(all="ignore"):  # a trial step may leave the range of a law
        for index in joints:
            initial_phi = springs[index].equilibrium(
                demand.of(index, ends[:1]), robot.joints[index].damper_start
            )
            march = March(springs[index], partial(demand.of, index))
            has_equilibrium = not np.isnan(initial_phi[0]).any()
            marched[index] = (
                march.solve_cells(ends, initial_phi)
                if has_equilibrium
                else MarchedMotion(None, None, 0.0, LOST)
            )
    stops = {
        index: DeflectionStop(start + motion.end, motion.reason)
        for index, motion in marched.items()
        if motion.reason is not None
    }
    return InternalMotions(joints, stops, marched)


def damped_joints(robot: Robot, trajectory: Trajectory) -> tuple[int, ...]:
    """Return the joints with a damper parallel to their springs whose damping is not always zero."""
    joints = joints_with_parallel_damper(robot.joints)
    if not joints:
        return ()
    # The first sample decides: `with_devices` refuses a damping that is zero only somewhere.
    damping = trajectory.block(0, 1).commanded[DAMPING.key][0]
    return tuple(index for index in joints if damping[index])


def refuse_damped_transmissions(robot: Robot, trajectory: Trajectory, work: str) -> None:
    """Raise an error in work on single samples if a transmission is damped, where samples depend on the past.

    Args:
        robot: Robot.
        trajectory: Fitted to the robot.
        work: Subject of the message, a plural.

    Raises:
        InputError: a transmission is damped.
    """
    names = ", ".join(robot.joint_names[index] for index in damped_joints(robot, trajectory))
    if names:
        raise InputError.one(
            f"{work} do not know transmissions with a damper ({names}): what moves inside depends on the "
            "whole motion; set their damping to 0, or move the dampers between the links"
        )


class _JointCommands:
    """Commands of joints over time; joints share the recursion's pass at the times of a cell."""

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self._robot, self._trajectory = robot, trajectory
        self._commands: dict[bytes, Mapping[str, FloatArray]] = {}

    def of(self, joint: int, time: FloatArray) -> Command:
        key = time.tobytes()
        if key not in self._commands:
            motion = self._trajectory.at(time)
            self._commands[key] = {**motion.variables(), **link_torques_along(self._robot, motion)}
        return command_of(joint, self._commands[key])
