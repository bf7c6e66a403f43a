"""Inverse dynamics along trajectories, block by block: a single run, or the runs of several variants.

`Batch` yields blocks of samples. Each is computed by `RunDynamics`, searched for minima between samples,
which set flags of the nearest sample, judged by the uncertainty of recorded signals, merged into the
summaries of the reports, and released. Several variants pass through these stages together, in one block.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vsacli.analysis.between_samples import Minima, MinimaSearch
from vsacli.analysis.dry_friction import FrictionPassages
from vsacli.analysis.joint_report import JUDGED
from vsacli.analysis.report import Report
from vsacli.analysis.run_dynamics import RunDynamics, choose_deflections, damped_motions
from vsacli.analysis.self_check import RunCheck, SelfCheck
from vsacli.analysis.summaries import DriftSummary, JointSummary
from vsacli.base.errors import InputError
from vsacli.base.flags import MIN_MARGIN, Flag, check_min_margin, has_flag
from vsacli.base.progress import Tell, unheard
from vsacli.base.variables import TIP_COMPLIANCE, Block
from vsacli.compute.engine import Engine, choose_engine
from vsacli.dynamics.balances import BALANCES
from vsacli.dynamics.energy import RunEnergy
from vsacli.dynamics.inverse import adapt_trajectory, usual_block
from vsacli.dynamics.variants import Variants
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.analysis.joint_report import JointUncertainty
    from vsacli.analysis.run_uncertainty import RunUncertainty
    from vsacli.analysis.tool_stiffness import ToolStiffness
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections


class Batch:
    """One pass over the trajectories of variants: iterate it to obtain the blocks, then call `report`.

    A single run may have any length. Several variants have equal numbers of samples, which are one block, one
    variant after the other; none of them may be a run that `is_alone`.

    Args:
        variants: Robots.
        trajectories: Commanded motion of each.
        stop_on_infeasible: Whether a single run ends with the first infeasible sample, as the paper's
            algorithm does; also with the sample nearest to an infeasible point between samples.
        min_margin: Margin below which a sample is near-singular.
        deflection_solver: "root" solves (14) at each sample; "ode" follows the root of the first sample by
            (19); or deflections that were integrated before; the latter for a single run.
        block_samples: Samples in a block of a single run, `usual_block` if None; results do not depend on it.
        engine: Backend, one of `vsacli.compute.engine.NAMES`.
        threads: Number of threads of compiled code; by default the number of CPU cores.
        asked: Names of the requested variables; if recorded signals leave them too uncertain, the verdict is
            unreliable. Those of `ON_REQUEST` are computed only if they are among them.
        tell: Callback for messages of the choice of the engine: failures, and work that takes long.
        kernel_samples: Number of samples of all batches with this kernel, for the choice of the engine; by
            default those of this batch.

    Attributes:
        choice: Engine that was chosen, with the reason.

    Raises:
        InputError: The margin is impossible, a trajectory does not fit its robot, deflections or engine are
            unknown, or there is no C compiler for the engine.
    """

    def __init__(
        self,
        variants: Variants,
        trajectories: Sequence[Trajectory],
        *,
        stop_on_infeasible: bool = False,
        min_margin: float = MIN_MARGIN,
        deflection_solver: str | IntegratedDeflections = "root",
        block_samples: int | None = None,
        engine: str = "numpy",
        threads: int | None = None,
        asked: Collection[str] = (JUDGED,),
        tell: Tell = unheard,
        kernel_samples: int | None = None,
    ) -> None:
        check_min_margin(min_margin)
        self.variants, self.trajectories = variants, _adapt_trajectories(variants.robots, trajectories)
        robot, trajectory, self._sample_count = variants.robots[0], self.trajectories[0], 0
        self._samples_per_run = trajectory.samples
        self._stop_on_infeasible = stop_on_infeasible
        self._min_margin = min_margin
        samples_per_block = usual_block(len(robot.joints)) if block_samples is None else block_samples
        self._block_samples = samples_per_block if len(variants) == 1 else trajectory.samples
        self._dynamics = RunDynamics(
            variants,
            self.trajectories,
            min_margin=min_margin,
            deflections=choose_deflections(deflection_solver, robot, trajectory),
            internal=damped_motions(robot, trajectory),
        )
        # where memory limits the blocks of a long chain, only one is computed at a time
        is_long = usual_block(len(robot.joints)) < usual_block(1)
        self._computes_ahead = trajectory.samples > self._block_samples and not is_long
        # one thread updates the summaries while the others compute
        summary_threads = int(self._computes_ahead)
        samples = kernel_samples or trajectory.samples * len(variants)
        self.choice = choose_engine(
            engine, self._dynamics.kernel, samples, threads, tell, busy=summary_threads
        )
        self._dynamics.engine = self.choice.engine
        self._uncertainty = _prepare_uncertainty(robot, trajectory, asked, self.choice.engine)
        self._minima_search = MinimaSearch(self._dynamics, min_margin, self._uncertainty)
        self._run_check = RunCheck(self._dynamics)
        self._summaries = [
            [JointSummary(joint, index) for index, joint in enumerate(robot_of_variant.joints)]
            for robot_of_variant in variants.robots
        ]
        self._friction_passages = [FrictionPassages(robot_of_variant) for robot_of_variant in variants.robots]
        self._drifts = _drift_summaries(robot, self._dynamics.deflections)
        self._energy = RunEnergy(variants, self.choice.engine)
        self._tool_stiffness = [
            _prepare_tools(robot_of_variant, trajectory, asked) for robot_of_variant in variants.robots
        ]
        self._stopped = False

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks in time order; each is released before the next is computed."""
        pending: deque[Block] = deque()
        # Blocks wait until the samples after them are known: a minimum between two blocks may set a flag.
        for block in self._computed_blocks():
            self._minima_search.search_around(block)
            pending.append(block)
            del block  # else this name would keep the block alive while the next is computed
            while pending and self._minima_search.is_complete_for(len(pending[0].time)) and not self._stopped:
                yield self._finish(pending.popleft())
            if self._stopped:
                return

    def _computed_blocks(self) -> Iterator[Block]:
        """Return an iterator of computed blocks; with several threads, blocks are computed ahead."""
        block_starts = range(0, self._samples_per_run, self._block_samples)
        motions = (self._dynamics.motion(start, start + self._block_samples) for start in block_starts)
        if self.choice.threads == 1 or not self._computes_ahead:
            return map(self._dynamics.compute, motions)
        from vsacli.base.background import ahead

        return ahead(self._dynamics.compute, motions)

    def _finish(self, block: Block) -> Block:
        """Take the next block through the stages after the search between samples; return what is stored."""
        between = self._minima_search.nearest(block)
        _mark_minima(between, block)
        if self._stop_on_infeasible:
            block, between = self._until_infeasible(block, between)
        if self._uncertainty is not None:
            block = self._uncertainty.add(block)
            _mark_minima(between, block)  # again, since the samples themselves may keep limits within it
        block = self._with_tools(block)
        self._run_check.add(block)
        for variant, variant_block in enumerate(block.divided(len(self.variants))):
            self._summarize(
                variant, variant_block, [minima.where(minima.variant == variant) for minima in between]
            )
        self._sample_count += len(block.time) // len(self.variants)
        arrays = {name: array for name, array in block.arrays().items() if name not in BALANCES}
        return Block(**arrays, motor_energy=self._energy.add(block))

    def _with_tools(self, block: Block) -> Block:
        """Return a block with the variables of the tools, if they are computed."""
        tool_stiffnesses = [
            tools for tools in self._tool_stiffness if tools is not None
        ]  # of all variants, or of none
        if not tool_stiffnesses:
            return block
        parts = zip(tool_stiffnesses, block.divided(len(tool_stiffnesses)), strict=True)
        tool_variables = [tools.add(part) for tools, part in parts]
        return block.replaced(
            **{
                name: np.concatenate([variables[name] for variables in tool_variables])
                for name in tool_variables[0]
            }
        )

    def _until_infeasible(self, block: Block, minima_between: list[Minima]) -> tuple[Block, list[Minima]]:
        """Return a block up to its first infeasible sample, with the minima of these samples."""
        infeasible = has_flag(block.flags, Flag.INFEASIBLE).any(axis=1)
        if not infeasible.any():
            return block, minima_between
        self._stopped, last_sample = True, int(infeasible.argmax())
        return block.taken(slice(last_sample + 1)), [
            minima.where(minima.step <= last_sample) for minima in minima_between
        ]

    def _summarize(self, variant: int, block: Block, between: Sequence[Minima]) -> None:
        """Merge a block of a variant and the minima between its samples into its report."""
        summaries = self._summaries[variant]
        for minima in between:
            self._minima_search.add(minima, variant)
            for index in set(minima.joint.tolist()):
                summaries[index].add_bounded(minima.of_joint(index), between=True)
        self._friction_passages[variant].add(block)
        for summary in summaries:
            summary.add(block)
        for drift in self._drifts:
            drift.add(block)

    @property
    def provenance(self) -> dict[str, str]:
        """Engine and options, for repeating the run."""
        options = {
            "stop_on_infeasible": self._stop_on_infeasible,
            "min_margin": self._min_margin,
            "deflection_solver": "root" if self._dynamics.deflections is None else "ode",
        }
        return {**self.choice.provenance, "options": json.dumps(options)}

    @cached_property
    def _self_checks(self) -> list[SelfCheck]:
        return self._run_check.outcomes()

    def findings(self, variant: int = 0) -> Report:
        """Return the report on the run of a variant without the warnings and notes, which take longer.

        It has the self-check of the whole run.
        """
        trajectory, complete = self.trajectories[variant], self._sample_count == self._samples_per_run
        minima_reports = self._minima_search.reports(variant)
        joint_parts = zip(self._energy.report(variant), minima_reports, self._uncertainties, strict=True)
        return Report(
            robot=self.variants.robots[variant].name,
            trajectory=trajectory.name,
            samples=self._sample_count,
            duration=trajectory.duration,
            complete=complete,
            self_check=self._self_checks[variant],
            joints=tuple(
                summary.report(*parts, complete=complete)
                for summary, parts in zip(self._summaries[variant], joint_parts, strict=True)
            ),
            drifts=tuple(drift.report() for drift in self._drifts),
            fits=trajectory.fits,
            tools=() if (tools := self._tool_stiffness[variant]) is None else tools.reports(),
        )

    @property
    def _uncertainties(self) -> Sequence[JointUncertainty | None]:
        return [None] * len(self._summaries[0]) if self._uncertainty is None else self._uncertainty.report()


def is_alone(robot: Robot, trajectory: Trajectory) -> bool:
    """Return whether a run cannot be part of a batch with others.

    Its signals were recorded, or it has a state that is integrated over time: the deviations of 401 samples,
    or the integration, take more than half the time of the run.
    """
    has_damped_transmission = any(joint.damper_at("transmission") for joint in robot.joints)
    return bool(trajectory.estimates) or has_damped_transmission


def _adapt_trajectories(robots: Sequence[Robot], trajectories: Sequence[Trajectory]) -> list[Trajectory]:
    """Return the trajectories for these robots, see `adapt_trajectory`; equal ones remain one object.

    Otherwise a study of a damped joint takes 1.2 times as long.
    """
    adapted: dict[tuple[object, ...], Trajectory] = {}
    for robot, trajectory in zip(robots, trajectories, strict=True):
        key = id(trajectory), *(joint.damper for joint in robot.joints)
        if key not in adapted:
            adapted[key] = adapt_trajectory(robot, trajectory)
    return [
        adapted[id(trajectory), *(joint.damper for joint in robot.joints)]
        for robot, trajectory in zip(robots, trajectories, strict=True)
    ]


def _mark_minima(between: Iterable[Minima], block: Block) -> None:
    """Set the flags of minima in those of the nearest samples."""
    for minima in between:
        minima.mark(block.flags)


def _prepare_tools(robot: Robot, trajectory: Trajectory, asked: Collection[str]) -> ToolStiffness | None:
    """Return the compliance of the tools along the run; None if neither a request nor a limit needs it."""
    stored = TIP_COMPLIANCE in asked
    if not (stored or robot.limited_tools):
        return None
    from vsacli.analysis.tool_stiffness import ToolStiffness

    if not robot.end_effectors:
        raise InputError.one(f"there is no {TIP_COMPLIANCE}: {robot.name} has no tools")
    frame = None if trajectory.wrench is None else trajectory.wrench.frame
    return ToolStiffness(robot, frame, stored=stored)


def _prepare_uncertainty(
    robot: Robot, trajectory: Trajectory, asked: Collection[str], engine: Engine
) -> RunUncertainty | None:
    """Return the uncertainty of the run; None if no signal was recorded."""
    if not trajectory.estimates:
        return None
    from vsacli.analysis.run_uncertainty import RunUncertainty, judged_variables

    return RunUncertainty(robot, trajectory, judged_variables(asked, robot), engine)


def _drift_summaries(robot: Robot, deflections: IntegratedDeflections | None) -> list[DriftSummary]:
    if deflections is None:
        return []
    pairs = zip(robot.joints, deflections.stops, strict=True)
    return [
        DriftSummary(joint, index, stop)
        for index, (joint, stop) in enumerate(pairs)
        if "stiffness" in joint.actuator.commanded and joint.damper_at("transmission") is None
    ]
