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

WITHIN = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR}
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
            bounded = {check.variable for joint in robot.joints for check in limit_checks(joint)}
            judged |= {"tau_e", *bounded}
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
        ends = [estimate.fit.unreliable for estimate in trajectory.estimates.values()]
        start, end = np.minimum(np.max(ends, axis=0), (last - first) / 4).tolist()
        self._inside = first + start, last - end
        self._shown = {JUDGED, *asked}
        self._powers: dict[str, _Powers] = {}
        self._steps = [dict.fromkeys(WITHIN, 0) for _ in robot.joints]
        self._limits: list[dict[str, Finding]] = [{} for _ in robot.joints]
        self._velocities: list[FloatArray] = []

    @cached_property
    def _deviations(self) -> Uncertainty:
        return Uncertainty(self._robot, self._trajectory, self._engine)

    def add(self, block: Block) -> Block:
        """Merge a block into the report, and return it with its deviations and limit flags."""
        deviations = self._deviations.at(block.time)
        self._count_steps(block, deviations.pop(MARGIN))
        inside = (block.time >= self._inside[0]) & (block.time <= self._inside[1])
        for name, array in deviations.items():
            values = getattr(block, name)
            array[np.isnan(values)] = np.nan
            unstated = self._deviations.unstated[name]
            if name in self._shown:
                powers = self._powers.setdefault(name, _Powers(unstated))
                powers.add(values[inside], array[inside])
        block = self._with(deviations, block)
        first, last = np.fmax.reduce(getattr(block, deviation("dtheta"))[[0, -1]], axis=-1)
        self._velocities = [self._velocities[0] if self._velocities else first, last]
        return block

    def judged(self, block: Block) -> Block:
        """Return a block of times between the samples with its deviations and limit flags."""
        deviations = self._deviations.at(block.time)
        del deviations[MARGIN]
        return self._with(deviations, block, between=True)

    def _with(self, deviations: Mapping[str, FloatArray], block: Block, *, between: bool = False) -> Block:
        for name, array in deviations.items():
            array[:, self._deviations.unstated[name]] = np.nan
        stored = {deviation(name): array for name, array in deviations.items()}
        block = block.replaced(**stored, flags=block.flags.copy())
        for index in range(len(self._robot.joints)):
            self._judge_limits(block, index, between=between)
        return block

    def _count_steps(self, block: Block, deviations: FloatArray) -> None:
        """Count samples that the uncertainty of the margin could make feasible, or regular."""
        gap = margin(block.stiffness, block.stiffness_min, block.stiffness_max)
        near = np.abs(gap) <= ALLOWED_DEVIATIONS * deviations
        for kind, bit in WITHIN.items():
            for steps, undecided in zip(self._steps, (has_flag(block.flags, bit) & near).T, strict=True):
                steps[kind] += int(np.count_nonzero(undecided))

    def _judge_limits(self, block: Block, index: int, *, between: bool) -> None:
        """Clear the bits of limits where the excess is within the uncertainty."""
        joint, values = self._robot.joints[index], block.of_joint(index)
        seen, exceeded = np.zeros((2, len(block.time)), dtype=FLAG_TYPE)
        for check in limit_checks(joint):
            seeming, certain = check.flags(values), check.flags(values, check.allowance(values))
            seen |= seeming
            exceeded |= certain
            within = (seeming & ~certain) != 0
            worst = worst_excess(joint, check, values, block.time, within, between=between)
            keep_worse(self._limits[index], worst)
        block.flags[:, index] &= ~(seen & ~exceeded)  # other bits are of minima between the samples

    def report(self) -> list[JointUncertainty]:
        """Return the findings so far, for each joint."""
        types = np.array(self._robot.joint_types)
        spreads = [spread for name, powers in self._powers.items() for spread in powers.spreads(name, types)]
        return [
            JointUncertainty(
                variables={each.name: each for at, each in spreads if at == index},
                asked=tuple(self._asked),
                samples=dict(self._steps[index]),
                limits=dict(self._limits[index]),
                start_dtheta=float(self._velocities[0][index]),
                end_dtheta=float(self._velocities[1][index]),
            )
            for index in range(len(types))
        ]


def _sum(before: FloatArray, terms: FloatArray) -> FloatArray:
    """Sum one term after the other, so that rounding does not depend on the division into blocks."""
    total: FloatArray = np.cumsum(np.concatenate([before[None], terms]), axis=0)[-1]
    return total


class _Powers:
    """Sums over samples of the squares of a variable and of its deviation, (joints[, 2])."""

    def __init__(self, unstated: BoolArray) -> None:
        """Begin with empty sums.

        Args:
            unstated: Whether a deviation must not be stated, (joints[, 2]).
        """
        self._unstated = unstated
        self._count, self._values, self._deviations = np.zeros((3, *unstated.shape))
        self._peak, self._largest = np.zeros((2, *unstated.shape))

    def add(self, values: FloatArray, deviations: FloatArray) -> None:
        """Add samples, (samples, joints[, 2]); samples without a value are left out."""
        exists = np.isfinite(values)
        self._count += np.sum(exists, axis=0)
        self._values = _sum(self._values, np.where(exists, values, 0.0) ** 2)
        self._deviations = _sum(self._deviations, np.where(exists, deviations, 0.0) ** 2)
        self._peak = np.maximum(self._peak, np.max(np.abs(values), axis=0, where=exists, initial=0.0))
        self._largest = np.maximum(self._largest, np.max(deviations, axis=0, where=exists, initial=0.0))

    def spreads(self, name: str, types: AnyArray) -> Iterator[tuple[int, Spread]]:
        """Yield the spread and index of the joints that have the variable; types of joints are (joints,)."""
        with np.errstate(invalid="ignore"):
            size, rms = np.sqrt([self._values / self._count, self._deviations / self._count])
        for index, joint_type in enumerate(types):
            has_values = self._count[index] > 0
            if not has_values.any():
                continue
            least = SMALLEST_SHARE * np.nanmax(size[types == joint_type])
            scale = np.maximum(size[index], least)
            share = np.divide(rms[index], scale, out=np.zeros_like(scale), where=rms[index] != 0)
            stated = {"rms": rms[index], "max": self._largest[index], "share": share}
            stated = {key: np.where(self._unstated[index], np.nan, each) for key, each in stated.items()}
            every = {**stated, "bound": ALLOWED_DEVIATIONS * share, "peak": self._peak[index]}
            worst = {key: float(np.max(each, where=has_values, initial=0.0)) for key, each in every.items()}
            yield index, Spread(name=name, unit=VARIABLES[name].quantity.unit(joint_type), **worst)
