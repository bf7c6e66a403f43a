"""The self-check of a run: residuals of its equations, and derivatives against finite differences.

All bounds stand first. A `RunCheck` collects the residuals of (14) and of the shafts at all samples; then
`ladder` compares each derivative of `RUNGS`, and the energy balances, with differences over several steps at
about 200 times, or fewer for long chains. The equations are in `dynamics.balances`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.reach import margin
from vsacli.actuators.transmission import JointVariables
from vsacli.analysis.difference_errors import MIDDLE, NEIGHBORS, OFFSETS, DifferenceErrors
from vsacli.analysis.run_dynamics import RunDynamics
from vsacli.base.arrays import AnyArray, BoolArray, FloatArray, IndexArray, evenly, of_joint
from vsacli.base.flags import Flag, has_flag
from vsacli.base.json_records import Stored, named
from vsacli.base.signals import COMMANDED
from vsacli.base.variables import VARIABLES, Block
from vsacli.dynamics.balances import (
    balance_errors,
    link_energy,
    link_powers,
    shaft_energy,
    shaft_powers,
)
from vsacli.dynamics.dampers import joints_with_parallel_damper
from vsacli.dynamics.inverse import usual_block
from vsacli.robot.model import Robot

SPRING_BOUND = 1e-11
"""Bound on the scaled residual of (14); solutions have 1e-15, and 1e-12 is required of them."""

DRIFT_BOUND = 1e-6
"""Bound on the residual of (14) of integrated deflections: below the accuracy of spring constants."""

SHAFT_BOUND = 1e-11
"""Bound on the scaled residual of motors and windings, sums of a few products: 2e-15 is usual."""

LADDER_BOUND = 1e-8
"""Bound on derivative errors relative to their peak: a hundred times the usual rounding. Differences over
short steps have larger rounding, see `ROUNDING_GAIN`."""

ROUNDING_GAIN = 30.0
"""Bound on the rounding of a difference over the step h relative to the derivative, in eps T/h.

A time up to T is rounded by eps T/2, a value v by about eps v, so that a difference has the error
eps (T v' + v)/h. Relative to the peak of v' this is a few eps T/h, since v is hardly above T v'. For declared
motions T/h is 4000, and `LADDER_BOUND` is larger. Recordings have a knot at each sample, and h must stay
between knots: with 1e6 samples T/h is 5e7 and the bound 3e-7. On 34 recordings of 2 to 30 s at 5 to 50 kHz,
of arms of 2 to 7 joints, at most 2 eps T/h occurred, and once 21, with interpolated time stamps since 1970.
"""

NOISE_GAIN = 12.0
"""Multiple of the estimated noise beyond which an error fails. The largest of 10^6 normally distributed
errors lies at 5 widths, and the estimate may be a third of the width."""

CLEAR_ERROR = 1e-10
"""Error below which smaller steps are not tried, a hundredth of the bound."""


@dataclass(frozen=True)
class SelfCheck(Stored):
    """Outcome of the self-check.

    Attributes:
        spring_residual: Largest scaled residual of (14); NaN if a value is missing.
        ladder: Largest relative error of a derivative against finite differences; NaN if a value is missing.
        spring_bound: Bound on the residual of (14).
        ladder_bound: Bound on the error of a derivative, where it is nearest to its bound.
        shaft_residual: Largest scaled residual of motors and windings; NaN if a value is missing; 0 in
            results from before these were checked.
    """

    spring_residual: float
    ladder: float
    spring_bound: float = SPRING_BOUND
    ladder_bound: float = LADDER_BOUND
    shaft_residual: float = 0.0

    shape: ClassVar = {
        **named("passed", "spring_residual", "shaft_residual", "ladder"),
        "bound": "ladder_bound",
    }

    @property
    def passed(self) -> bool:
        """Return whether all residuals and errors are within their bounds."""
        springs_and_shafts = self.spring_residual <= self.spring_bound and self.shaft_residual <= SHAFT_BOUND
        return springs_and_shafts and self.ladder <= self.ladder_bound


class RunCheck:
    """Self-check of the runs of a batch; `add` its blocks in order, then call `outcomes`.

    The program of the run computes residuals at all samples, but would be wrong where the program is. So
    NumPy recomputes them from the variables at `PROBES` samples. Except for branches, loops and tables, a
    program has no path that depends on values; if one of these, or the whole program, is wrong, so is a
    stretch of the run, and a stretch of more than a 199th of the samples is met. The variants of a batch have
    one program, and share these samples, as they share the times of `ladder`; each has at least `FEWEST`.
    With samples and times of their own, 300 runs of a 3R take 5 times as long.
    """

    def __init__(self, dynamics: RunDynamics) -> None:
        self._dynamics, self._variant_count = dynamics, len(dynamics.variants)
        samples = dynamics.trajectories[0].samples
        probe_samples = evenly(samples, max(MIN_PROBES, PROBES // self._variant_count))
        self._probe_samples = (np.arange(self._variant_count)[:, None] * samples + probe_samples).ravel()
        self._probe_variants = np.repeat(np.arange(self._variant_count), len(probe_samples))
        self._excerpts: list[dict[str, AnyArray]] = []
        self._sample_count = 0
        self._spring_error, self._shaft_error = np.zeros((2, self._variant_count))
        damped_joints = len(joints_with_parallel_damper(dynamics.robot.joints))
        self._damped_error, self._damped_size = np.zeros((2, self._variant_count, damped_joints))

    def add(self, block: Block) -> None:
        """Merge a block of `BalancedDynamics`, with the samples of one variant after the other."""
        first, last = np.searchsorted(
            self._probe_samples, (self._sample_count, self._sample_count + len(block.time))
        )
        probe_index = self._probe_samples[first:last] - self._sample_count
        self._excerpts.append(
            {
                name: array[probe_index]
                for name, array in block.arrays().items()
                if name in JointVariables._fields
            }
        )
        self._sample_count += len(block.time)
        variant_shape = self._variant_count, len(block.time) // self._variant_count
        self._spring_error, self._shaft_error, self._damped_error, self._damped_size = (
            np.maximum(largest, values.reshape(*variant_shape, *values.shape[1:]).max(axis=1))
            for largest, values in (
                (self._spring_error, block.spring_error),
                (self._shaft_error, block.shaft_error),
                (self._damped_error, block.damped_error),
                (self._damped_size, block.damped_size),
            )
        )

    def outcomes(self) -> list[SelfCheck]:
        """Return the self-check of each run so far; integrated deflections drift off (14)."""
        bound = SPRING_BOUND if self._dynamics.deflections is None else DRIFT_BOUND
        errors, error_bounds = ladder(self._dynamics)
        columns = *self._residuals(), errors, error_bounds
        return [
            SelfCheck(spring_residual, derivative_error, bound, error_bound, shaft_residual)
            for spring_residual, shaft_residual, derivative_error, error_bound in zip(
                *(column.tolist() for column in columns), strict=True
            )
        ]

    def _residuals(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest scaled residuals of springs and shafts, (variants,), NaN where a value is."""
        probed = {name: np.concatenate([part[name] for part in self._excerpts]) for name in self._excerpts[0]}
        variant = self._probe_variants[: len(probed["q"])]
        joints = self._dynamics.variants.robot_with_rows(variant).joints
        of_joints = [JointVariables.of(of_joint(probed, index)) for index in range(len(joints))]
        recomputed = balance_errors(joints, of_joints)
        probe_errors = (
            np.reshape(values, (-1, self._variant_count, len(variant) // self._variant_count)).max(axis=2)
            for values in (recomputed["spring_error"], recomputed["shaft_error"], recomputed["damped_error"])
        )
        springs, shafts, damped_error = (
            np.maximum(block_error, probed_error)
            for block_error, probed_error in zip(
                (self._spring_error, self._shaft_error, self._damped_error.T), probe_errors, strict=True
            )
        )
        damped = damped_error / np.maximum(self._damped_size.T, np.finfo(float).tiny)
        return np.max([*springs, *damped], axis=0), shafts[0]


class Rung(NamedTuple):
    """A variable and its derivative, which is the derivative `order` of another variable."""

    value: str
    derivative: str
    whole: str
    order: int


RUNGS = (
    Rung("tau_e", "dtau_e", "tau_e", 1),
    Rung("dtau_e", "ddtau_e", "tau_e", 2),
    Rung("phi", "dphi", "phi", 1),
    Rung("theta", "dtheta", "theta", 1),
    Rung("dtheta", "ddtheta", "theta", 2),
    Rung("stiffness", "dstiffness", "stiffness", 1),
    Rung("dstiffness", "ddstiffness", "stiffness", 2),
)
"""Compared variables; the deflections too, since the motion of the joint can hide them in theta, and the
stiffness where it is not commanded."""

PROBES = 200
"""Approximate number of times of the derivative check, and of samples at which `RunCheck` recomputes; for all
variants of a batch together."""

MIN_PROBES = 2 * NEIGHBORS + 1
"""Smallest number of these times and samples of a variant: so many estimate the noise."""

JOINTS_AT_ALL_TIMES = 80
"""Number of joints up to which derivatives are checked at `PROBES` times, longer chains at fewer, in inverse
proportion: their blocks are shorter, so that the check would take a time in the square of the joints. A time
compares all joints, whose equations are the same."""

STEP_SCALES = np.array([8.0**-power for power in range(5)])
"""Difference steps tried at each time; the best decides, since a wrong derivative is wrong at every step.

The smallest are for motions that leave the attainable range within a thousandth of their duration.
"""

FIRST_SCALES = STEP_SCALES[:2]
"""Scales tried first: for most motions the smaller ones only add rounding. With all at once, the run of a 3R
takes 1.35 times as long."""


def ladder(run: RunDynamics) -> tuple[FloatArray, FloatArray]:
    """Return the largest error of a derivative of `RUNGS` or of a power, relative to its peak, and its bound.

    Differences are taken at about 200 times, for long chains at fewer, with individual steps, over which the
    trajectories are analytic. Motor motion is compared where it is smooth over the difference. The error of a
    variant is the one nearest to, or farthest beyond, its bound.

    Args:
        run: Dynamics of the runs of a batch.

    Returns:
        Errors and bounds, (variants,) each.
    """
    dynamics = run.from_zero()
    joints = max(len(run.robot.joints), JOINTS_AT_ALL_TIMES)
    time_count = max(MIN_PROBES, PROBES * JOINTS_AT_ALL_TIMES // joints // len(run.variants))
    times, half_spans = np.stack(
        dynamics.by_trajectory(lambda trajectory: trajectory.check_points(time_count)), axis=-1
    )
    duration = np.array([trajectory.duration for trajectory in dynamics.trajectories])
    steps = np.minimum(half_spans / 3, duration / 500)
    all_variants = np.arange(len(duration))
    errors, bounds, compared_throughout = _derivative_errors(
        dynamics, all_variants, times, FIRST_SCALES[:, None, None] * steps
    )
    unclear = np.flatnonzero(~(compared_throughout & (errors.max(axis=(0, 1)) <= CLEAR_ERROR)))
    if unclear.size:
        all_steps = STEP_SCALES[:, None, None] * steps[:, unclear]
        errors[..., unclear], bounds[..., unclear], _ = _derivative_errors(
            dynamics, unclear, times[:, unclear], all_steps
        )
    rounding = ROUNDING_GAIN * np.finfo(float).eps * duration / (FIRST_SCALES[-1] * steps)
    bounds = np.maximum(bounds, np.maximum(LADDER_BOUND, rounding)).reshape(-1, len(all_variants))
    errors = errors.reshape(bounds.shape)
    nearest_bound = np.argmax(errors / bounds, axis=0)
    return errors[nearest_bound, all_variants], bounds[nearest_bound, all_variants]


def _derivative_errors(
    dynamics: RunDynamics, variants: IndexArray, times: FloatArray, steps: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return errors (derivatives, times, variants) at the best scale, bounds by noise, and what was compared.

    Times are computed together up to the size of a block, which bounds the memory as in a run.

    Args:
        dynamics: Inverse dynamics along trajectories that start at zero.
        variants: Indices of the variants to check, (variants,).
        times: Times to check, (times, variants), s.
        steps: Difference steps, (scales, times, variants), s.

    Returns:
        Whether motor motion was compared at all times is (variants,).
    """
    joints = len(dynamics.robot.joints)
    durations = np.array([dynamics.trajectories[variant].duration for variant in variants])
    compared_throughout = np.ones(len(variants), dtype=bool)
    differences = [DifferenceErrors(steps, LADDER_BOUND, NOISE_GAIN) for _ in (*RUNGS, "energy")]
    times_per_block = max(1, usual_block(joints) // (len(steps) * len(OFFSETS) * len(variants)))
    for start in range(0, len(times), times_per_block):
        time_slice = slice(start, start + times_per_block)
        grid = times[time_slice] + steps[:, None, time_slice] * OFFSETS[:, None, None]
        variant = np.broadcast_to(variants, grid.shape).ravel()
        block = dynamics.at(grid.ravel(), variant)
        robot = dynamics.variants.robot_with_rows(variant)
        smooth = _motors_move_smoothly(block, grid.shape)
        compared_throughout &= np.all(np.any(smooth, axis=0), axis=(0, 2))
        for rung, rung_errors in zip(RUNGS, differences, strict=False):
            value, derivative, whole = (
                _variable_on_grid(dynamics.robot, block, name, grid.shape)
                for name in (rung.value, rung.derivative, rung.whole)
            )
            compared = np.ones_like(smooth) if rung.value.endswith("tau_e") else smooth
            lower_scale = np.abs(whole[0, MIDDLE]) / durations[:, None, None] ** rung.order
            rung_errors.add(
                value, derivative, compared, np.maximum(np.abs(derivative[0, MIDDLE]), lower_scale)
            )
        energy, power, scale, grain = (
            array.reshape(*grid.shape, -1, 1) for array in _energy_balances(dynamics, robot, block)
        )
        compared = np.concatenate((smooth, np.ones_like(smooth[..., :1])), axis=-1)
        lower_scale = np.abs(energy[0, MIDDLE]) / durations[:, None, None]
        differences[-1].add(
            energy, power, compared, np.maximum(scale[0, MIDDLE], lower_scale), grain[:, MIDDLE]
        )
    relative = [array.relative() for array in differences]
    return (
        np.stack([error for error, _ in relative]),
        np.stack([bound for _, bound in relative]),
        compared_throughout,
    )


def _energy_balances(dynamics: RunDynamics, robot: Robot, block: Block) -> Iterator[FloatArray]:
    """Return energy, the power that changes it, the size of its terms, and the grain; (samples, joints + 1).

    The robot has the numbers of the variant of each sample.

    The columns are rotors and springs of each joint, then all links together. The grain is the rounding of
    elastic energies that a formula computes as a difference of terms of the size of stiffness times a radian
    squared, such as K (1 - cos(2 phi)): the result changes by jumps, between which it shows no noise.
    """
    of_joints = [JointVariables.of(block.of_joint(index)) for index in range(len(robot.joints))]
    pairs = list(zip(robot.joints, of_joints, strict=True))
    powers = [shaft_powers(*pair) for pair in pairs] + [link_powers(robot, block, dynamics.frame)]
    yield np.stack([*(shaft_energy(*pair) for pair in pairs), link_energy(robot, block)], axis=-1)
    yield np.stack([np.sum(terms, axis=0) for terms in powers], axis=-1)
    yield np.stack([np.sum(np.abs(terms), axis=0) for terms in powers], axis=-1)
    grains = [np.finfo(float).eps * np.nan_to_num(of_joint.stiffness) for of_joint in of_joints]
    squared_radii = [1.0 if joint.is_revolute else of_joint.q**2 for joint, of_joint in pairs]
    yield np.stack([*map(np.multiply, grains, squared_radii), 0 * block.time], axis=-1)


def _variable_on_grid(robot: Robot, block: Block, name: str, shape: tuple[int, ...]) -> FloatArray:
    """Return a variable of a block on a grid of times and variants, (*shape, joints, motors or 1)."""
    values: FloatArray = getattr(block, name).reshape(*shape, len(robot.joints), -1)
    return np.where([_computed_columns(joint.actuator, name) for joint in robot.joints], values, 0.0)


def _computed_columns(actuator: Actuator, name: str) -> list[bool]:
    """Return whether each column of a variable is computed, not commanded, for this actuator."""
    commanded = {name for key in actuator.commanded for name in COMMANDED[key].names}
    return [False] if name in commanded else actuator.has_columns(VARIABLES[name])


def _motors_move_smoothly(block: Block, shape: tuple[int, ...]) -> BoolArray:
    """Return which differences, (scales, times, variants, joints), are smooth in a block on a grid.

    No sample is infeasible, singular or near-singular, and the margin changes by less than a tenth: motor
    motion has features as short as the distance to the end of the attainable range.
    """
    is_troubled = has_flag(block.flags, Flag.INFEASIBLE | Flag.SINGULAR | Flag.NEAR_SINGULAR).reshape(
        *shape, -1
    )
    margins = margin(block.stiffness, block.stiffness_min, block.stiffness_max).reshape(*shape, -1)
    changes_fast = np.ptp(margins, axis=1) > margins[:, MIDDLE] / 10
    smooth: BoolArray = ~(np.any(is_troubled, axis=1) | changes_fast)
    return smooth
