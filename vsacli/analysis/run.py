"""Inverse dynamics along a trajectory, computed block by block.

`Run` yields blocks of samples. Each is computed by `RunDynamics`, searched for minima between samples, which
set flags of the nearest sample, judged by the uncertainty of recorded signals, merged into the summaries of
the report, and released. `inverse_dynamics` joins the blocks in memory.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vsacli.analysis.between_samples import Minima, MinimaSearch
from vsacli.analysis.dry_friction import FrictionPassages
from vsacli.analysis.joint_report import JUDGED
from vsacli.analysis.report import Report
from vsacli.analysis.run_dynamics import RunDynamics, choose_deflections, damped_motions
from vsacli.analysis.self_check import RunCheck
from vsacli.analysis.summaries import DriftSummary, JointSummary
from vsacli.base.arrays import AnyArray
from vsacli.base.errors import InputError
from vsacli.base.flags import MIN_MARGIN, Flag, check_min_margin, has_flag
from vsacli.base.progress import Tell, unheard
from vsacli.base.signals import POSITION
from vsacli.base.units import time_text
from vsacli.base.variables import TIP_COMPLIANCE, Block
from vsacli.compute.engine import Engine, choose
from vsacli.dynamics.balances import BALANCES
from vsacli.dynamics.energy import JointEnergy, RunEnergy
from vsacli.dynamics.inverse import adapt_trajectory, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.analysis.joint_report import JointUncertainty
    from vsacli.analysis.result import Result
    from vsacli.analysis.run_uncertainty import RunUncertainty
    from vsacli.analysis.tool_stiffness import ToolStiffness
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections


class Run:
    """One pass over a trajectory: iterate it to obtain the blocks, then call `report`.

    Args:
        robot: Robot.
        trajectory: Commanded motion.
        stop_on_infeasible: Whether to end with the first infeasible sample, as the paper's algorithm does;
            also with the sample nearest to an infeasible point between samples.
        min_margin: Margin below which a sample is near-singular.
        deflection_solver: "root" solves (14) at each sample; "ode" follows the root of the first sample by
            (19); or deflections that were integrated before.
        block_samples: Samples in a block, `usual_block` if None; results do not depend on it.
        engine: Backend, one of `vsacli.compute.engine.NAMES`.
        threads: Number of threads of compiled code; by default the number of CPU cores.
        asked: Names of the requested variables; if recorded signals leave them too uncertain, the verdict is
            unreliable. Those of `ON_REQUEST` are computed only if they are among them.
        tell: Callback for messages of the choice of the engine: failures, and work that takes long.

    Attributes:
        choice: Engine that was chosen, with the reason.

    Raises:
        InputError: The margin is impossible, the trajectory does not fit the robot, deflections or engine are
            unknown, or there is no C compiler for the engine.
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        *,
        stop_on_infeasible: bool = False,
        min_margin: float = MIN_MARGIN,
        deflection_solver: str | IntegratedDeflections = "root",
        block_samples: int | None = None,
        engine: str = "numpy",
        threads: int | None = None,
        asked: Collection[str] = (JUDGED,),
        tell: Tell = unheard,
    ) -> None:
        check_min_margin(min_margin)
        trajectory = adapt_trajectory(robot, trajectory)
        self.robot = robot
        self.trajectory = trajectory
        self._stop_on_infeasible = stop_on_infeasible
        self._min_margin = min_margin
        self._block_samples = usual_block(len(robot.joints)) if block_samples is None else block_samples
        self._dynamics = RunDynamics(
            robot,
            trajectory,
            min_margin=min_margin,
            deflections=choose_deflections(deflection_solver, robot, trajectory),
            internal=damped_motions(robot, trajectory),
        )
        self._ahead = trajectory.samples > self._block_samples and not _is_long(robot)
        busy = int(self._ahead)  # one thread updates the summaries while the others compute
        self.choice = choose(engine, self._dynamics.kernel, trajectory.samples, threads, tell, busy=busy)
        self._dynamics.engine = self.choice.engine
        self._uncertainty = _prepare_uncertainty(robot, trajectory, asked, self.choice.engine)
        self._minima_search = MinimaSearch(self._dynamics, min_margin, self._uncertainty)
        self._passages = FrictionPassages(robot)
        self._check = RunCheck(self._dynamics)
        self._summaries = [JointSummary(joint, index) for index, joint in enumerate(robot.joints)]
        self._drifts = _drift_summaries(robot, self._dynamics.deflections)
        self._energy = RunEnergy(robot, self.choice.engine)
        self._tools = _prepare_tools(robot, trajectory, asked)
        self._samples = 0
        self._stopped = False

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks in time order; each is released before the next is computed."""
        waiting: deque[Block] = deque()
        # Blocks wait until the samples after them are known: a minimum between two blocks may set a flag.
        for block in self._computed():
            self._minima_search.search_around(block)
            waiting.append(block)
            del block  # else this name would keep the block alive while the next is computed
            while waiting and self._minima_search.is_complete_for(len(waiting[0].time)) and not self._stopped:
                yield self._finish(waiting.popleft())
            if self._stopped:
                return

    def _computed(self) -> Iterator[Block]:
        """Return an iterator of computed blocks; with several threads, blocks are computed ahead."""
        starts = range(0, self.trajectory.samples, self._block_samples)
        motions = (self.trajectory.block(start, start + self._block_samples) for start in starts)
        if self.choice.threads == 1 or not self._ahead:
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
        if self._tools is not None:
            block = self._tools.add(block)
        self._summarize(block, between)
        return self._without_balances(block)

    def _until_infeasible(self, block: Block, between: list[Minima]) -> tuple[Block, list[Minima]]:
        """Return a block up to its first infeasible sample, with the minima of these samples."""
        infeasible = has_flag(block.flags, Flag.INFEASIBLE).any(axis=1)
        if not infeasible.any():
            return block, between
        self._stopped, last = True, int(infeasible.argmax())
        return block.taken(slice(last + 1)), [minima.where(minima.step <= last) for minima in between]

    def _summarize(self, block: Block, between: Sequence[Minima]) -> None:
        """Merge a block and the minima between its samples into the report."""
        self._samples += len(block.time)
        for minima in between:
            self._minima_search.add(minima)
            for index in set(minima.joint.tolist()):
                self._summaries[index].add_bounded(minima.of_joint(index), between=True)
        self._passages.add(block)
        self._check.add(block)
        for summary in self._summaries:
            summary.add(block)
        for drift in self._drifts:
            drift.add(block)

    def _without_balances(self, block: Block) -> Block:
        """Return a block without the quantities of the self-check, and with the energy of its motors."""
        stored = {name: array for name, array in block.arrays().items() if name not in BALANCES}
        return Block(**stored, motor_energy=self._energy.add(block))

    @property
    def provenance(self) -> dict[str, str]:
        """Engine and options, for repeating the run."""
        options = {
            "stop_on_infeasible": self._stop_on_infeasible,
            "min_margin": self._min_margin,
            "deflection_solver": "root" if self._dynamics.deflections is None else "ode",
        }
        return {**self.choice.provenance, "options": json.dumps(options)}

    def report(self) -> Report:
        """Return the report on the blocks so far, with the self-check of the whole run."""
        complete = self._samples == self.trajectory.samples
        uncertainties = self._uncertainties()
        joint_parts = zip(self._energy.report(), self._minima_search.reports(), uncertainties, strict=True)
        undetermined = any(each is not None and each.undetermined for each in uncertainties)
        return Report(
            robot=self.robot.name,
            trajectory=self.trajectory.name,
            samples=self._samples,
            duration=self.trajectory.duration,
            complete=complete,
            warnings=(*self.robot.warnings, *self._of_recording(undetermined=undetermined)),
            notes=(
                *self.trajectory.notes,
                *self._minima_search.notes,
                *self._internal_stops(),
                *self._passages.notes(self._dynamics),
            ),
            self_check=self._check.outcome(),
            joints=tuple(
                summary.report(*of_joint, complete=complete)
                for summary, of_joint in zip(self._summaries, joint_parts, strict=True)
            ),
            drifts=tuple(drift.report() for drift in self._drifts),
            fits=self.trajectory.fits,
            tools=() if self._tools is None else self._tools.reports(),
        )

    def _of_recording(self, *, undetermined: bool) -> tuple[str, ...]:
        """Return the trajectory's warnings. Rigid robots use no derivative beyond the second.

        With them, warnings on the highest derivative become advice if a variable is undetermined.
        """
        warnings, estimate = self.trajectory.warnings, self.trajectory.estimates.get(POSITION)
        if estimate is None or any(joint.actuator.sprung for joint in self.robot.joints):
            return warnings
        advice = estimate.advice_without_derivative()
        return tuple(advice.get(each, each) for each in warnings if undetermined or each not in advice)

    def energies(self) -> Sequence[JointEnergy]:
        """Return the energy of each joint over the blocks so far, as `report` does, without a self-check."""
        return self._energy.report()

    def _uncertainties(self) -> Sequence[JointUncertainty | None]:
        return [None] * len(self._summaries) if self._uncertainty is None else self._uncertainty.report()

    def _internal_stops(self) -> Iterator[str]:
        """Yield a note for each internal motion that ends before the trajectory does."""
        internal = self._dynamics.internal
        for index, stop in internal.stops.items() if internal is not None else ():
            joint = self.robot.joint_names[index]
            when = f"cannot go on beyond t = {time_text(stop.time)}"
            yield f"{joint}: what moves inside its damped transmission {when}: {stop.reason}"


def _mark_minima(between: Iterable[Minima], block: Block) -> None:
    """Set the flags of minima in those of the nearest samples."""
    for minima in between:
        minima.mark(block.flags)


def _is_long(robot: Robot) -> bool:
    """Return whether memory limits the blocks of a chain; then only one is computed at a time."""
    return usual_block(len(robot.joints)) < usual_block(1)


def inverse_dynamics(
    robot: Robot,
    trajectory: Trajectory,
    *,
    stop_on_infeasible: bool = False,
    deflection_solver: str | IntegratedDeflections = "root",
    engine: str = "numpy",
    tip_compliance: bool = False,
) -> Result:
    """Compute the motor torques that execute a motion and a stiffness profile, VSA-NEA (36)-(74).

    The function prints and writes nothing, except for compiled code in the user's cache folder.

    Args:
        robot: Robot, from `load_robot` or built in Python.
        trajectory: Trajectory for this robot, from `load_trajectory` or `Trajectory.from_samples`.
        stop_on_infeasible: Whether to end with the first infeasible sample.
        deflection_solver: "root" solves (14) at each sample; "ode" follows the root of the first sample by
            (19); or deflections that were integrated before.
        engine: Backend: "numpy", compiled "c", or "auto", which uses compiled code where that saves time.
        tip_compliance: Whether to compute the compliance of each tool as well, (samples, tools, 6, 6), see
            `vsacli.tip_compliance`, with its smallest stiffness in the report.

    Returns:
        Every variable of `Block` over (samples, joints[, 2]), the wrenches on several tools over (samples,
        tools, 6); `report` holds the verdict.

    Raises:
        InputError: The trajectory has a different number of joints than the robot, or no stiffness for a
            joint that needs one; deflections or engine are unknown, or there is no C compiler.
    """
    from vsacli.analysis.result import Result

    run = Run(
        robot,
        trajectory,
        stop_on_infeasible=stop_on_infeasible,
        deflection_solver=deflection_solver,
        engine=engine,
        asked=(JUDGED, *((TIP_COMPLIANCE,) if tip_compliance else ())),
    )
    return Result(**_concatenate_blocks(list(run)), report=run.report(), robot=robot, trajectory=trajectory)


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


def _concatenate_blocks(blocks: list[Block]) -> dict[str, AnyArray]:
    """Return the variables of consecutive blocks, concatenated, with the samples contiguous in memory."""
    rows = [{name: np.moveaxis(array, 0, -1) for name, array in block.arrays().items()} for block in blocks]
    return {
        name: np.moveaxis(np.concatenate([row[name] for row in rows], axis=-1), -1, 0) for name in rows[0]
    }
