"""Cost and bounds of a joint along a fixed motion, as functions of its stiffness with two derivatives.

A search starts from smooth profiles within the admissible range of the stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.signals import STIFFNESS
from vsacli.compute.duals import Dual
from vsacli.dynamics.drive import drive_without_limits
from vsacli.dynamics.limits import limit_checks
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import Range
from vsacli.studies.search.criteria import (
    ENDS_OF_CORRIDOR,
    SMOOTHINGS,
    Criterion,
    Scale,
    limit_bounds,
    limit_names,
    with_seeded_stiffness,
)
from vsacli.studies.search.interior_point import minimize
from vsacli.studies.search.loads import Load
from vsacli.studies.search.separable import Group, SeparableProblem, interior

CLEARANCE = 1e-6
"""Relative distance that a profile keeps from each bound, so that rounding does not cross it."""

OF_MOTORS = ("phi", "dtheta", "tau_motor", "current", "voltage")
"""Limited variables that depend on the stiffness."""


class FixedMotion:
    """The `Functions` of a stiffness and its first two derivatives, and of a level if the cost is one.

    Args:
        joint: joint whose stiffness varies.
        load: load of the joint at all instants.
        admissible: admissible stiffness at these instants.
        criterion: objective.
        scale: scale of the cost.
        reserve: required clearance to the limits of the motors, as a share of each.
    """

    def __init__(
        self,
        joint: Joint,
        load: Load,
        admissible: Range,
        criterion: Criterion,
        scale: Scale,
        reserve: float = 0.0,
    ) -> None:
        self.joint, self.load, self.admissible = joint, load, admissible
        self.criterion, self.scale, self._clearance = criterion, scale, CLEARANCE + reserve
        self.stiffness = float(np.median(load.command.commanded[STIFFNESS.key]))
        self.smoothings = SMOOTHINGS if _has_sharp_friction(joint) else criterion.smoothings
        self._rms_velocity = math.sqrt(float(np.mean(load.command.dq**2))) or 1.0
        self._limit_checks = [check for check in limit_checks(joint) if check.variable in OF_MOTORS]

    @property
    def bound_names(self) -> list[str]:
        """Names of the first bounds; the bounds after these belong to levels."""
        return [*ENDS_OF_CORRIDOR, *limit_names(self._limit_checks)]

    @property
    def further_bounds(self) -> int:
        """Number of bounds after the two of the stiffness itself."""
        return len(self.bound_names) - 2 + self.criterion.bound_count(self.joint)

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Return integrands of the cost, and bounds; see `Functions`."""
        drive_variables = self.driven(rows[: STIFFNESS.orders], instants)
        level = rows[STIFFNESS.orders] if self.criterion.levels else None
        cost_arguments = (self.joint, drive_variables, level, self.scale)
        min_stiffness, max_stiffness = (row[instants] for row in self.admissible)
        scale = self.stiffness
        bounds = [
            (min_stiffness - rows[0]) / scale + CLEARANCE,
            (rows[0] - max_stiffness) / scale + CLEARANCE,
        ]
        bounds += limit_bounds(self._limit_checks, drive_variables.by_name(), self._clearance)
        return list(self.criterion.integrands(*cost_arguments)), [
            *bounds,
            *self.criterion.bounds(*cost_arguments),
        ]

    def driven(self, rows: Sequence[Dual] | FloatArray, instants: IndexArray) -> JointVariables:
        """Return the variables of the motors for a stiffness and its derivatives."""
        load = self.load.at(instants).command
        commanded: dict[str, Any] = {**load.commanded, **dict(zip(STIFFNESS.names, rows, strict=True))}
        joint = self._smoothed_joint()
        if isinstance(rows[0], Dual):
            joint = with_seeded_stiffness(joint, STIFFNESS.orders, moving_corridor=False)
        with np.errstate(all="ignore"):  # a step of the search may leave the attainable range
            return drive_without_limits(joint, load._replace(commanded=commanded), MIN_MARGIN)

    def costs_of_constants(self, constants: FloatArray, instants: IndexArray) -> FloatArray:
        """Return the cost of each constant, (constants,); infinite if a motor exceeds a limit."""
        stiffness = np.repeat(constants, len(instants))
        zeros = np.zeros_like(stiffness)
        drive_variables = self.driven(np.stack([stiffness, zeros, zeros]), np.tile(instants, len(constants)))
        excess = np.max(
            [zeros - 1, *limit_bounds(self._limit_checks, drive_variables.by_name(), self._clearance)], axis=0
        )
        within_limits = np.all(excess.reshape(len(constants), -1) < 0, axis=1)
        time, costs = self.load.time[instants], np.full(len(constants), np.inf)
        for number in np.flatnonzero(within_limits).tolist():
            constant_slice = slice(number * len(instants), (number + 1) * len(instants))
            variables = {
                name: variable[..., constant_slice] for name, variable in drive_variables.by_name().items()
            }
            costs[number] = self.criterion.of(self.joint, JointVariables.of(variables), time)
        return np.where(np.isnan(costs), np.inf, costs)

    def _smoothed_joint(self) -> Joint:
        """Return the joint with its sharp friction smoothed."""
        if not _has_sharp_friction(self.joint):
            return self.joint
        return _with_friction_width(self.joint, self.scale.smoothing * self._rms_velocity)


def _has_sharp_friction(joint: Joint) -> bool:
    return any(motor.friction is not None and motor.friction.sharp for motor in joint.actuator.motors)


def _with_friction_width(joint: Joint, width: float) -> Joint:
    """Return a joint whose motors' friction changes its sign over a width of their velocity at the joint.

    A sharp change would make a sum over instants jump wherever a motor stops at another one.
    """
    actuator: Any = joint.actuator
    motors = []
    for motor in actuator.motor:
        min_width = abs(motor.ratio_of_side) * width
        friction = motor.friction and replace(motor.friction, width=max(motor.friction.width, min_width))
        motors.append(replace(motor, friction=friction))
    return replace(joint, actuator=replace(actuator, motor=tuple(motors)))


GRID, CONSTANT_TOLERANCE = 33, 1e-6
"""Constants that are compared at once, and the relative width of their range at which the search ends."""


def best_constant_stiffness(
    motion: FixedMotion, low: float, high: float, instants: IndexArray
) -> tuple[float, float] | None:
    """Return the best constant between two and its cost, with limits at some instants; None if there is none.

    Grids become finer and finer around the best of the one before.
    """
    best, grid = None, np.geomspace(low, high, GRID)
    while best is None or grid[-1] - grid[0] > CONSTANT_TOLERANCE * best[0]:
        costs = motion.costs_of_constants(grid, instants)
        index = int(costs.argmin())
        if costs[index] == np.inf:
            return best
        if best is None or costs[index] <= best[1]:
            best = float(grid[index]), float(costs[index])
        grid = np.geomspace(grid[max(index - 1, 0)], grid[min(index + 1, GRID - 1)], GRID)
    return best


START_CLEARANCE = 1e-3
"""Relative distance that a start keeps from the ends of the admissible range, if possible."""

RANDOM_TARGETS, LEVELS = 2, 6
"""Number of random targets, and of the random levels that each of them interpolates."""


class _Distance:
    """The `Functions` of the squared distance from a target stiffness, within bounds."""

    def __init__(self, target: FloatArray, bounds: Range, scale: float) -> None:
        self._target, self._bounds, self._scale = target, bounds, scale

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Dual | FloatArray], list[Dual | FloatArray]]:
        """Return the square of the distance, and the excess over the bounds."""
        low, high = (row[instants] for row in self._bounds)
        distance = (rows[0] - self._target[instants]) / self._scale
        return [distance * distance], [(low - rows[0]) / self._scale, (rows[0] - high) / self._scale]


def targets(
    commanded_stiffness: FloatArray, admissible: Range, time: FloatArray, seed: int
) -> Iterator[FloatArray]:
    """Yield targets for starts: the command, the lower end of the range, constants, random profiles."""
    min_constant = float(admissible.low.max())
    generator = np.random.default_rng(seed)
    yield commanded_stiffness
    yield 1.05 * admissible.low
    yield np.full_like(time, 1.05 * min_constant)
    yield np.full_like(time, 2 * min_constant)
    level_times = np.linspace(time[0], time[-1], LEVELS)
    for _ in range(RANDOM_TARGETS):
        yield admissible.low * np.interp(time, level_times, generator.uniform(1.0, 2.0, LEVELS))


def nearest_profile(
    basis: FloatArray, time: FloatArray, target: FloatArray, admissible: Range
) -> FloatArray | None:
    """Return the coefficients of the admissible spline nearest to a target, (shapes,), or None.

    Args:
        basis: splines per unit of each coefficient, (instants, shapes).
        time: instants, (instants,) in s.
        target: target, (instants,).
        admissible: range in which the spline must lie at the instants.
    """
    scale = float(np.median(admissible.low))
    clearance = np.minimum(START_CLEARANCE * scale, (admissible.high - admissible.low) / 4)
    bounds = Range(admissible.low + clearance, admissible.high - clearance)
    clipped_target = np.minimum(np.maximum(target, bounds.low), bounds.high)
    coefficients = np.asarray(np.linalg.lstsq(basis, clipped_target, rcond=None)[0], dtype=np.float64)
    profile = basis @ coefficients
    if np.all((bounds.low < profile) & (profile < bounds.high)):
        return coefficients
    group = Group(
        functions=_Distance(target, bounds, scale),
        instants=np.arange(len(time)),
        basis=basis[None],
        unknowns=np.arange(basis.shape[1]),
        weights=trapezoidal_weights(time)[None] / (time[-1] - time[0]),
        bound_mask=np.isfinite(np.stack(bounds)),
        scales=np.array([scale]),
    )
    problem = SeparableProblem([group])
    start = interior(problem, coefficients)
    return None if start is None else minimize(problem, start).unknowns
