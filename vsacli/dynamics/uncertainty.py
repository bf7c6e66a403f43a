"""Uncertainty of result variables that depend on recorded signals, propagated to first order.

With the covariance C of recorded signals, a variable with the gradient g over these has the variance g C g'
(JCGM 100:2008, Guide to the expression of uncertainty in measurement, equation (13)). Derivatives of one
component are correlated; components are independent of each other. Gradients are differences over one
standard deviation to both sides, computed as one batch of samples by the kernel of the run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.actuators.reach import margin
from vsacli.base.arrays import AnyArray, BoolArray, FloatArray, of_joint
from vsacli.base.signals import COMMANDED, Signal, orders_of_derivation
from vsacli.base.variables import UNCERTAIN
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES, Wrench
from vsacli.compute.engine import NUMPY, Engine
from vsacli.dynamics.balances import BalancedBlock, BalancedDynamics
from vsacli.dynamics.drive import drive
from vsacli.dynamics.inverse import (
    COMPUTED,
    InverseDynamics,
    block_of,
    command_of,
    link_torques_along,
    usual_block,
)
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Motion, Trajectory

if TYPE_CHECKING:
    from vsacli.trajectory.recorded.samples import SampledProfile

MARGIN = "margin"
"""Name of the margin of the stiffness, which has a deviation but is no result variable."""

PROBES_OF_A_KNOT, FEWEST_PROBES, MOST_PROBES = 4, 2048, 32768
"""Numbers of times at which deviations are computed. Each costs about thirty samples of a run with three
joints, and seventy with seven. Between knots of the fits, deviations change as slowly as the motion does."""


_COMPUTED = [name for name in COMPUTED if name in UNCERTAIN and name not in orders_of_derivation()]
"""Variables with a deviation that follow from signals."""


class Uncertainty:
    """Standard deviations of variables that depend on recorded signals: computed at some times, else linear.

    Times at which a value does not exist, at an infeasible or singular sample, are left out. A deviation is
    NaN where the value depends on components of unknown deviation, or does not exist one deviation away to
    either side.

    Attributes:
        unstated: Whether a variable, by name, depends on components whose deviation is only a bound and must
            not be stated, (joints[, 2]).
    """

    def __init__(self, robot: Robot, trajectory: Trajectory, engine: Engine = NUMPY) -> None:
        """Compute the deviations.

        Args:
            robot: Robot.
            trajectory: Trajectory for this robot, with estimated signals.
            engine: Backend.
        """
        estimates = trajectory.estimates
        self._start, self._elapsed = trajectory.start, probe_times(trajectory)
        block_size = times_per_block(robot, estimates)
        blocks: list[Deviations] = []
        for start in range(0, len(self._elapsed), block_size):
            elapsed = self._elapsed[start : start + block_size]
            motion = trajectory.at(trajectory.start + elapsed)
            covariances = {signal: estimate.covariance(elapsed) for signal, estimate in estimates.items()}
            blocks.append(propagate_deviations(robot, motion, estimates, covariances, engine))
        self._at_probes, self.unstated = Deviations.concatenated(blocks, axis=0)

    def at(self, time: FloatArray) -> dict[str, FloatArray]:
        """Return the deviations at any times by variable, and of `MARGIN`: each (samples, joints[, 2])."""
        return {
            name: self._interpolate_deviations(deviations, time)
            for name, deviations in self._at_probes.items()
        }

    def _interpolate_deviations(self, at_probes: FloatArray, time: FloatArray) -> FloatArray:
        interpolated = np.full((at_probes[0].size, len(time)), np.nan)
        for row, column in zip(interpolated, at_probes.reshape(len(at_probes), -1).T, strict=True):
            exists = ~np.isnan(column)
            if exists.any():
                row[:] = np.interp(time - self._start, self._elapsed[exists], column[exists])
        interpolated[np.isinf(interpolated)] = np.nan
        return np.moveaxis(interpolated.reshape(*at_probes.shape[1:], len(time)), -1, 0)


def times_per_block(robot: Robot, estimates: Mapping[Signal, SampledProfile]) -> int:
    """Return the number of times whose deviations are computed as one block."""
    components = sum(estimate.fit.components for estimate in estimates.values())
    # each component has at most five orders, each shifted to both sides
    return max(1, usual_block(len(robot.joints)) // (10 * components))


def probe_times(trajectory: Trajectory) -> FloatArray:
    """Return the times at which deviations are computed, equally spaced, from the first sample on."""
    fits = [estimate.fit for estimate in trajectory.estimates.values()]
    knots = [len(part.knots) for fit in fits for part in fit.parts if not part.exact]
    probe_count = max(FEWEST_PROBES, PROBES_OF_A_KNOT * max(knots, default=0))
    return np.linspace(0.0, trajectory.duration, max(2, min(probe_count, MOST_PROBES, trajectory.samples)))


class Deviations(NamedTuple):
    """Standard deviations at some times, by variable.

    Attributes:
        deviations: (times, joints[, 2]), NaN where there is no value, infinite where unknown.
        unstated: Whether a deviation must not be stated, (joints[, 2]).
    """

    deviations: dict[str, FloatArray]
    unstated: dict[str, BoolArray]

    @classmethod
    def concatenated(cls, parts: Sequence[Deviations], axis: int) -> Deviations:
        """Return the deviations at the times of all parts; `axis` is that of the times."""
        names = parts[0].deviations
        return cls(
            {name: np.concatenate([part.deviations[name] for part in parts], axis) for name in names},
            {name: np.any([part.unstated[name] for part in parts], axis=0) for name in names},
        )


class _Shift(NamedTuple):
    """A change of one component of a signal or of a derivative by its standard deviation.

    Attributes:
        name: Name of the signal or derivative.
        component: Index of the component.
        stated: Whether the deviation may be stated.
        deviation: Standard deviation, (times,).
    """

    name: str
    component: int
    stated: bool
    deviation: FloatArray


def propagate_deviations(
    robot: Robot,
    motion: Motion,
    estimates: Mapping[Signal, SampledProfile],
    covariances: Mapping[Signal, FloatArray],
    engine: Engine = NUMPY,
) -> Deviations:
    """Return the deviations of all variables that depend on recorded signals, along a motion.

    Args:
        robot: Robot.
        motion: Motion at some times.
        estimates: Signals that were recorded.
        covariances: Their covariances, (components, orders, orders, times), as in `SampledProfile`.
        engine: Backend.
    """
    undamped = _without_inner_dampers(robot)
    frame = None if motion.wrench is None else motion.wrench.frame
    # Equal to that of the run, so that compiled code is shared.
    kernel = BalancedDynamics(InverseDynamics(undamped, frame))

    def variables(shifted: Motion) -> dict[str, AnyArray]:
        block = block_of(kernel, shifted, engine, block=BalancedBlock)
        relative_margin = margin(block.stiffness, block.stiffness_min, block.stiffness_max)
        return {**{name: getattr(block, name) for name in _COMPUTED}, MARGIN: relative_margin}

    components = {signal: range(len(covariance)) for signal, covariance in covariances.items()}
    computed = _propagate(variables, motion, estimates, covariances, components)
    of_signals = _signal_deviations(robot, estimates, covariances)
    return Deviations(computed.deviations | of_signals.deviations, computed.unstated | of_signals.unstated)


def deviations_of_joint(
    robot: Robot,
    index: int,
    motion: Motion,
    estimates: Mapping[Signal, SampledProfile],
    covariances: Mapping[Signal, FloatArray],
) -> Deviations:
    """Return the deviations of one joint, (times,) or (2, times), which take a fraction of the time of all.

    Args:
        robot: Robot.
        index: Index of the joint.
        motion: Motion at some times.
        estimates: Signals that were recorded.
        covariances: Their covariances, as in `propagate_deviations`.

    Returns:
        The values that `propagate_deviations` has for the joint, except that of `MARGIN`.
    """
    undamped = _without_inner_dampers(robot)

    def variables(shifted: Motion) -> dict[str, AnyArray]:
        command = command_of(index, {**shifted.variables(), **link_torques_along(undamped, shifted)})
        joint_variables = drive(undamped.joints[index], command)
        return {name: getattr(joint_variables, name).T[:, None] for name in _COMPUTED}

    components = {  # what other joints are commanded beside their motion has no effect on this one
        signal: [index] if signal.key in COMMANDED else range(len(covariance))
        for signal, covariance in covariances.items()
    }
    computed = _propagate(variables, motion, estimates, covariances, components)
    joint_covariances = {signal: array for signal, array in covariances.items() if not signal.is_wrench}
    of_signals = _signal_deviations(robot, estimates, joint_covariances)
    return Deviations(
        {**of_joint(computed.deviations, 0), **of_joint(of_signals.deviations, index)},
        {
            **{name: row[0] for name, row in computed.unstated.items()},
            **{name: row[index] for name, row in of_signals.unstated.items()},
        },
    )


_Variables = Callable[[Motion], Mapping[str, AnyArray]]
"""Function that computes variables along a motion, by name, each (times, joints[, 2])."""


def _propagate(
    variables: _Variables,
    motion: Motion,
    estimates: Mapping[Signal, SampledProfile],
    covariances: Mapping[Signal, FloatArray],
    components: Mapping[Signal, Sequence[int]],
) -> Deviations:
    """Return the deviations of variables that are computed from some components of recorded signals."""
    # A gradient has a row for each shift: signals in order, then components, then orders.
    covariances = {signal: covariances[signal][list(indices)] for signal, indices in components.items()}
    deviations = {signal: _standard_deviations(covariance) for signal, covariance in covariances.items()}
    shifts = [
        _Shift(name, signal.first + component, bool(estimates[signal].stated[component]), row)
        for signal, deviation in deviations.items()
        for component, rows in zip(components[signal], deviation, strict=True)
        for name, row in zip(signal.variables, rows, strict=True)
    ]
    values, changes = _values_and_changes(variables, motion, shifts)
    deviations_by_name, unstated = {}, {}
    is_unstated = np.array([not shift.stated for shift in shifts])
    for name, value in values.items():
        unstated[name] = np.any(changes[name][is_unstated] != 0, axis=(0, 1))
        variance, start = np.zeros_like(value), 0
        for signal, covariance in covariances.items():
            change = changes[name][start : start + len(covariance) * signal.orders]
            variance += _variance(change, _correlations(covariance, deviations[signal]))
            start += len(change)
        deviation = np.sqrt(np.maximum(variance, 0))  # below zero by rounding only
        deviations_by_name[name] = np.where(
            np.isnan(value), np.nan, np.nan_to_num(deviation, nan=np.inf, posinf=np.inf)
        )
    return Deviations(deviations_by_name, unstated)


def _signal_deviations(
    robot: Robot, estimates: Mapping[Signal, SampledProfile], covariances: Mapping[Signal, FloatArray]
) -> Deviations:
    """Return the deviations of the recorded signals themselves, and of their derivatives.

    They are NaN for wrenches on tools that were not recorded.
    """
    deviations_by_name: dict[str, FloatArray] = {}
    unstated: dict[str, BoolArray] = {}
    for signal, covariance in covariances.items():
        for name, rows in zip(
            signal.variables, np.moveaxis(_standard_deviations(covariance), 1, 0), strict=True
        ):
            if name in estimates[signal].estimated:
                rows[_joints_without_signal(robot, signal)] = np.nan
                components = len(WRENCH_AXES) * len(robot.tool_names) if signal.tool else len(rows)
                deviation = deviations_by_name.setdefault(name, np.full((rows.shape[1], components), np.nan))
                deviation[:, signal.columns] = rows.T
                is_unstated = unstated.setdefault(name, np.zeros(components, dtype=bool))
                is_unstated[signal.columns] = ~estimates[signal].stated
    return Deviations(deviations_by_name, unstated)


def _joints_without_signal(robot: Robot, signal: Signal) -> list[int]:
    """Return the joints that ignore a signal, although it may have a column for them."""
    commanded = signal.key in COMMANDED
    return [
        index for index, joint in enumerate(robot.joints) if commanded and signal.key not in joint.commanded
    ]


def _standard_deviations(covariance: FloatArray) -> FloatArray:
    """Return the standard deviations, (components, orders, times)."""
    return np.sqrt(np.moveaxis(np.diagonal(covariance, axis1=1, axis2=2), -1, 1))


def _correlations(covariance: FloatArray, deviation: FloatArray) -> FloatArray:
    """Return correlations from covariances; zero for components that are given or unknown."""
    product = deviation[:, :, None] * deviation[:, None]
    return np.divide(covariance, product, out=np.zeros_like(covariance), where=product > 0)


def _values_and_changes(
    compute_variables: _Variables, motion: Motion, shifts: Sequence[_Shift]
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return variables by name, (times, joints[, 2]), and changes by the shifts, (shifts, times, ...)."""
    values, changes = {}, {}
    for name, array in compute_variables(_shifted_motions(motion, shifts)).items():
        batches = array.reshape(1 + 2 * len(shifts), len(motion.time), *array.shape[1:])
        values[name], forward, backward = batches[0], batches[1::2], batches[2::2]
        one_sided = np.where(np.isnan(forward), batches[0] - backward, forward - batches[0])
        central = (forward - backward) / 2
        changes[name] = np.where(np.isnan(central), one_sided, central)
    return values, changes


def _without_inner_dampers(robot: Robot) -> Robot:
    """Return the robot without dampers parallel to its springs.

    With them, motors respond to the links later and less, so deviations without them are upper estimates.
    """
    joints = (replace(joint, damper=joint.damper_at("link")) for joint in robot.joints)
    return replace(robot, joints=tuple(joints))


def _shifted_motions(motion: Motion, shifts: Sequence[_Shift]) -> Motion:
    """Return the motion, followed for each shift by the motion with it added and with it subtracted."""
    variables = motion.variables()
    times = variables.pop("time")
    copies = {name: np.repeat(array[None], 1 + 2 * len(shifts), axis=0) for name, array in variables.items()}
    for index, shift in enumerate(shifts):
        copies[shift.name][1 + 2 * index, :, shift.component] += shift.deviation
        copies[shift.name][2 + 2 * index, :, shift.component] -= shift.deviation
    rows = {name: array.reshape(-1, array.shape[-1]) for name, array in copies.items()}
    wrench = motion.wrench
    if wrench is not None:
        wrench = Wrench(*(rows[name] for name in WRENCH_NAMES), frame=wrench.frame)
    return Motion.of(np.tile(times, 1 + 2 * len(shifts)), rows, wrench)


def _variance(gradient: FloatArray, correlation: FloatArray) -> FloatArray:
    """Return the variance of variables that depend on one signal, (times, joints[, 2]).

    Args:
        gradient: Changes by one deviation of each component and order, (components * orders, times, ...).
        correlation: Correlation of the orders of each component, (components, orders, orders, times).
    """
    components, orders = correlation.shape[:2]
    by_order = gradient.reshape(components, orders, *gradient.shape[1:])
    return np.asarray(np.einsum("cmt...,cmnt,cnt...->t...", by_order, correlation, by_order, optimize=True))
