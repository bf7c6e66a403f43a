"""Uncertainty of a run by its recorded signals: standard deviations, their effect on limits, summaries."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from vsacli.actuators.reach import ALLOWED_DEVIATIONS, margin
from vsacli.analysis.joint_report import JUDGED, JointUncertainty, Spread
from vsacli.base.arrays import FLAG_TYPE, AnyArray, BoolArray, FloatArray
from vsacli.base.flags import Flag, has_flag
from vsacli.base.variables import UNCERTAIN, VARIABLES, Block, deviation
from vsacli.compute.engine import NUMPY, Engine
from vsacli.dynamics.limits import Finding, keep_worse, limit_checks, worst_excess
from vsacli.dynamics.uncertainty import MARGIN, Uncertainty
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

SMALLEST_SHARE = 0.01
"""Smallest scale of a torque's uncertainty, as a share of the largest torque of any joint: the torque of a
resting joint may be only noise."""

UNDECIDED_FLAGS = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR}
"""Kinds of samples that are counted if they are within the uncertainty."""


def judged_variables(names: Iterable[str], robot: Robot) -> tuple[str, ...]:
    """Return the variables whose uncertainty decides whether the requested ones are determined.

    `flags` depends on elastic torques, and on the variables with limits. A variable without a deviation is
    judged by the motor torques, which depend on everything.

    Args:
        names: Names of the requested variables.
        robot: Robot, with its limits.
    """
    judged: set[str] = set()
    for name in (name.removesuffix(deviation("")) for name in names):
        if name == "flags":
            limited_variables = {limit.variable for joint in robot.joints for limit in limit_checks(joint)}
            judged |= {"tau_e", *limited_variables}
        elif "joint" in VARIABLES[name].dims:
            judged.add(name if name in UNCERTAIN else JUDGED)
    return tuple(name for name in UNCERTAIN if name in judged)


class RunUncertainty:
    """Standard deviations of a run along recorded signals; `add` blocks in order, then call `report`."""

    def __init__(
        self, robot: Robot, trajectory: Trajectory, asked: Sequence[str], engine: Engine = NUMPY
    ) -> None:
        """Prepare the deviations.

        Args:
            robot: Robot.
            trajectory: Trajectory with at least one recorded and fitted signal.
            asked: Variables that decide, see `judged_variables`.
            engine: Backend.
        """
        self._robot, self._trajectory, self._asked, self._engine = robot, trajectory, asked, engine
        first, last = trajectory.times.span
        unreliable_spans = [estimate.fit.unreliable for estimate in trajectory.estimates.values()]
        start, end = np.minimum(np.max(unreliable_spans, axis=0), (last - first) / 4).tolist()
        self._reliable_span = first + start, last - end
        self._reported_variables = {JUDGED, *asked}
        self._sums: dict[str, _SumsOfSquares] = {}
        self._undecided_counts = [dict.fromkeys(UNDECIDED_FLAGS, 0) for _ in robot.joints]
        self._limits: list[dict[str, Finding]] = [{} for _ in robot.joints]
        self._end_velocity_deviations: list[FloatArray] = []

    @cached_property
    def _deviations(self) -> Uncertainty:
        return Uncertainty(self._robot, self._trajectory, self._engine)

    def add(self, block: Block) -> Block:
        """Merge a block into the report, and return it with its deviations and limit flags."""
        deviations = self._deviations.at(block.time)
        self._count_steps(block, deviations.pop(MARGIN))
        inside = (block.time >= self._reliable_span[0]) & (block.time <= self._reliable_span[1])
        for name, array in deviations.items():
            values = getattr(block, name)
            array[np.isnan(values)] = np.nan
            unstated = self._deviations.unstated[name]
            if name in self._reported_variables:
                powers = self._sums.setdefault(name, _SumsOfSquares(unstated))
                powers.add(values[inside], array[inside])
        block = self._with_deviations(deviations, block)
        first, last = np.fmax.reduce(getattr(block, deviation("dtheta"))[[0, -1]], axis=-1)
        self._end_velocity_deviations = [
            self._end_velocity_deviations[0] if self._end_velocity_deviations else first,
            last,
        ]
        return block

    def judged(self, block: Block) -> Block:
        """Return a block of times between the samples with its deviations and limit flags."""
        deviations = self._deviations.at(block.time)
        del deviations[MARGIN]
        return self._with_deviations(deviations, block, between=True)

    def _with_deviations(
        self, deviations: Mapping[str, FloatArray], block: Block, *, between: bool = False
    ) -> Block:
        for name, array in deviations.items():
            array[:, self._deviations.unstated[name]] = np.nan
        deviation_variables = {deviation(name): array for name, array in deviations.items()}
        block = block.replaced(**deviation_variables, flags=block.flags.copy())
        for index in range(len(self._robot.joints)):
            self._judge_limits(block, index, between=between)
        return block

    def _count_steps(self, block: Block, deviations: FloatArray) -> None:
        """Count samples that the uncertainty of the margin could make feasible, or regular."""
        margins = margin(block.stiffness, block.stiffness_min, block.stiffness_max)
        is_undecided = np.abs(margins) <= ALLOWED_DEVIATIONS * deviations
        for kind, bit in UNDECIDED_FLAGS.items():
            for counts, joint_undecided in zip(
                self._undecided_counts, (has_flag(block.flags, bit) & is_undecided).T, strict=True
            ):
                counts[kind] += int(np.count_nonzero(joint_undecided))

    def _judge_limits(self, block: Block, index: int, *, between: bool) -> None:
        """Clear the bits of limits where the excess is within the uncertainty."""
        joint, values = self._robot.joints[index], block.of_joint(index)
        seeming_flags, certain_flags = np.zeros((2, len(block.time)), dtype=FLAG_TYPE)
        for limit in limit_checks(joint):
            seeming, certain = limit.flags(values), limit.flags(values, limit.allowance(values))
            seeming_flags |= seeming
            certain_flags |= certain
            is_uncertain = (seeming & ~certain) != 0
            worst = worst_excess(joint, limit, values, block.time, is_uncertain, between=between)
            keep_worse(self._limits[index], worst)
        block.flags[:, index] &= ~(
            seeming_flags & ~certain_flags
        )  # other bits are of minima between the samples

    def report(self) -> list[JointUncertainty]:
        """Return the findings so far, for each joint."""
        types = np.array(self._robot.joint_types)
        spreads = [spread for name, powers in self._sums.items() for spread in powers.spreads(name, types)]
        return [
            JointUncertainty(
                variables={each.name: each for joint_index, each in spreads if joint_index == index},
                asked=tuple(self._asked),
                samples=dict(self._undecided_counts[index]),
                limits=dict(self._limits[index]),
                start_dtheta=float(self._end_velocity_deviations[0][index]),
                end_dtheta=float(self._end_velocity_deviations[1][index]),
            )
            for index in range(len(types))
        ]


def _add_in_order(total_before: FloatArray, terms: FloatArray) -> FloatArray:
    """Sum one term after the other, so that rounding does not depend on the division into blocks."""
    total: FloatArray = np.cumsum(np.concatenate([total_before[None], terms]), axis=0)[-1]
    return total


class _SumsOfSquares:
    """Sums over samples of the squares of a variable and of its deviation, (joints[, 2])."""

    def __init__(self, unstated: BoolArray) -> None:
        """Begin with empty sums.

        Args:
            unstated: Whether a deviation must not be stated, (joints[, 2]).
        """
        self._unstated = unstated
        self._count, self._value_squares, self._deviations = np.zeros((3, *unstated.shape))
        self._peak, self._largest = np.zeros((2, *unstated.shape))

    def add(self, values: FloatArray, deviations: FloatArray) -> None:
        """Add samples, (samples, joints[, 2]); samples without a value are left out."""
        exists = np.isfinite(values)
        self._count += np.sum(exists, axis=0)
        self._value_squares = _add_in_order(self._value_squares, np.where(exists, values, 0.0) ** 2)
        self._deviations = _add_in_order(self._deviations, np.where(exists, deviations, 0.0) ** 2)
        self._peak = np.maximum(self._peak, np.max(np.abs(values), axis=0, where=exists, initial=0.0))
        self._largest = np.maximum(self._largest, np.max(deviations, axis=0, where=exists, initial=0.0))

    def spreads(self, name: str, types: AnyArray) -> Iterator[tuple[int, Spread]]:
        """Yield the spread and index of the joints that have the variable; types of joints are (joints,)."""
        with np.errstate(invalid="ignore"):
            rms_value, rms_deviation = np.sqrt(
                [self._value_squares / self._count, self._deviations / self._count]
            )
        for index, joint_type in enumerate(types):
            has_values = self._count[index] > 0
            if not has_values.any():
                continue
            smallest_scale = SMALLEST_SHARE * np.nanmax(rms_value[types == joint_type])
            scale = np.maximum(rms_value[index], smallest_scale)
            share = np.divide(
                rms_deviation[index], scale, out=np.zeros_like(scale), where=rms_deviation[index] != 0
            )
            stated_values = {"rms": rms_deviation[index], "max": self._largest[index], "share": share}
            stated_values = {
                key: np.where(self._unstated[index], np.nan, values) for key, values in stated_values.items()
            }
            all_values = {**stated_values, "bound": ALLOWED_DEVIATIONS * share, "peak": self._peak[index]}
            largest_of_motors = {
                key: float(np.max(values, where=has_values, initial=0.0))
                for key, values in all_values.items()
            }
            yield (
                index,
                Spread(name=name, unit=VARIABLES[name].quantity.unit(joint_type), **largest_of_motors),
            )
