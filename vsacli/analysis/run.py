"""Inverse dynamics along a trajectory: the one place that walks over time, block by block."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vsacli.analysis.between_samples import Between
from vsacli.analysis.derivative_check import DRIFT_BOUND, SPRING_BOUND, BalanceCheck, SelfCheck, ladder
from vsacli.analysis.dry_friction import FrictionPassages
from vsacli.analysis.joint_report import JUDGED
from vsacli.analysis.report import Report
from vsacli.analysis.summaries import DriftSummary, JointSummary
from vsacli.base.arrays import AnyArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, Flag, check_near_singular, has
from vsacli.base.progress import Tell, unheard
from vsacli.base.units import time_text
from vsacli.base.variables import Block
from vsacli.compute.engine import Engine, choose
from vsacli.dynamics.balances import BALANCES, BalancedDynamics
from vsacli.dynamics.energy import RunEnergy
from vsacli.dynamics.inverse import block_of, fitted, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.analysis.joint_report import JointUncertainty
    from vsacli.analysis.result import Result
    from vsacli.analysis.run_uncertainty import RunUncertainty
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections
    from vsacli.dynamics.internal_motion import InternalMotions

DEFLECTIONS = ("root", "integrate")
"""Methods for deflections: the root of (14) at each sample, or integration of (19) from the first root."""


class Run:
    """One pass over a trajectory: iterate it for the blocks, then ask it for the report.

    Args:
        robot: the robot.
        trajectory: the commanded motion.
        stop_on_infeasible: end with the first infeasible step, as the paper's algorithm does; one that is
            nearest to something infeasible between the steps counts.
        near_singular: margin below which a step is near-singular.
        deflections: "root" of (14) at each step; "integrate" follows that of the first step by (19); or those
            that were integrated before.
        block_samples: steps in a block, as `usual_block` has it if None; results do not depend on it.
        engine: what computes, one of `vsacli.compute.engine.NAMES`.
        threads: of compiled code; as many as there are processors if None.
        asked: names of the variables that the run is for; if recorded signals leave them too uncertain, the
            run is doubtful.
        tell: learns of the engine what goes wrong before one is found, and what will take long.

    Attributes:
        choice: the engine that was chosen, and why.

    Raises:
        InputError: the margin is impossible, the trajectory does not fit the robot, deflections or engine are
            unknown, or there is no C compiler for it.
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        *,
        stop_on_infeasible: bool = False,
        near_singular: float = NEAR_SINGULAR_MARGIN,
        deflections: str | IntegratedDeflections = "root",
        block_samples: int | None = None,
        engine: str = "numpy",
        threads: int | None = None,
        asked: Collection[str] = (JUDGED,),
        tell: Tell = unheard,
    ) -> None:
        check_near_singular(near_singular)
        trajectory = fitted(robot, trajectory)
        self.robot = robot
        self.trajectory = trajectory
        self._stop_on_infeasible = stop_on_infeasible
        self._near_singular = near_singular
        self._block_samples = usual_block(len(robot.joints)) if block_samples is None else block_samples
        self._deflections = _integrated(deflections, robot, trajectory)
        frame = None if trajectory.wrench is None else trajectory.wrench.frame
        self._internal = _internal_motions(robot, trajectory)
        inside = () if self._internal is None else self._internal.joints
        integrated = self._deflections is not None
        self._kernel = BalancedDynamics(robot, frame, near_singular, integrated, inside)
        self._ahead = trajectory.samples > self._block_samples and not _is_long(robot)
        busy = int(self._ahead)  # one thread updates the report while the others compute
        self.choice = choose(engine, self._kernel, trajectory.samples, threads, tell, busy=busy)
        self._summaries = [JointSummary(joint, index) for index, joint in enumerate(robot.joints)]
        self._drifts = [] if self._deflections is None else _drift_summaries(robot, self._deflections)
        self._energy = RunEnergy(robot, self.choice.engine)
        self._passages = FrictionPassages(robot)
        self._uncertainty = _uncertainty(robot, trajectory, asked, self.choice.engine)
        self._between = Between(robot, trajectory, near_singular, self._compute, self._judged)
        self._balances = BalanceCheck(robot, trajectory.samples)
        self._samples = 0
        self._stopped = False

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks in time order; each is released before the next is computed."""
        waiting: deque[Block] = deque()
        for block in self._computed():
            self._between.look(block)
            waiting.append(block)
            del block
            while waiting and self._between.knows(len(waiting[0].time)) and not self._stopped:
                yield self._merged(waiting.popleft())
            if self._stopped:
                return

    def _computed(self) -> Iterator[Block]:
        """Return all samples in blocks, as computed; of several threads all but one compute ahead."""
        starts = range(0, self.trajectory.samples, self._block_samples)
        motions = (self.trajectory.block(start, start + self._block_samples) for start in starts)
        if self.choice.threads == 1 or not self._ahead:
            return map(self._compute, motions)
        from vsacli.base.background import ahead

        return ahead(self._compute, motions)

    def _compute(self, motion: Motion) -> Block:
        integrated = None if self._deflections is None else self._deflections.at(motion.time)
        internal = {} if self._internal is None else self._internal.at(motion.time - self.trajectory.start)
        engine = self.choice.engine
        return block_of(self._kernel, motion, engine, integrated=integrated, internal=internal)

    def _judged(self, block: Block) -> Block:
        """Return the block with flags of limits exceeded beyond the uncertainty of recorded signals."""
        return block if self._uncertainty is None else self._uncertainty.judged(block)

    def _merged(self, block: Block) -> Block:
        """Return the next block with flags that hold between its samples, deviations and motor energy.

        It is merged into the report, up to the first infeasible sample if the run stops there.
        """
        between = self._between.mark(block)
        if self._stop_on_infeasible:
            infeasible = has(block.flags, Flag.INFEASIBLE).any(axis=1)
            self._stopped = bool(infeasible.any())
        if self._stopped:
            last = int(infeasible.argmax())
            block, between = block.taken(slice(last + 1)), [each.where(each.step <= last) for each in between]
        if self._uncertainty is not None:
            block = self._uncertainty.add(block)
        self._samples += len(block.time)
        for minima in between:
            self._between.add(minima)
            for index in set(minima.joint.tolist()):
                self._summaries[index].add_bounded(minima.of_joint(index))
        self._passages.add(block)
        self._balances.add(block)
        for summary in self._summaries:
            summary.add(block)
        for drift in self._drifts:
            drift.add(block)
        stored = {name: array for name, array in block.arrays().items() if name not in BALANCES}
        return Block(**stored, motor_energy=self._energy.add(block))

    @property
    def provenance(self) -> dict[str, str]:
        """Values needed to repeat the run: engine and options."""
        options = {
            "stop_on_infeasible": self._stop_on_infeasible,
            "near_singular": self._near_singular,
            "deflections": "root" if self._deflections is None else "integrate",
        }
        return {**self.choice.provenance, "options": json.dumps(options)}

    def report(self) -> Report:
        """Return the verdict on the blocks so far, with the self-check of the whole."""
        complete = self._samples == self.trajectory.samples
        found = zip(self._energy.report(), self._between.reports(), self._uncertainties(), strict=True)
        return Report(
            robot=self.robot.name,
            trajectory=self.trajectory.name,
            samples=self._samples,
            duration=self.trajectory.duration,
            complete=complete,
            warnings=(*self.robot.warnings, *self.trajectory.warnings),
            notes=(
                *self.trajectory.notes,
                *self._between.notes,
                *self._internal_stops(),
                *self._passages.notes(self.trajectory, self._compute),
            ),
            self_check=self._self_check(),
            joints=tuple(
                summary.report(*of_joint, complete=complete)
                for summary, of_joint in zip(self._summaries, found, strict=True)
            ),
            drifts=tuple(drift.report() for drift in self._drifts),
            fits=self.trajectory.fits,
        )

    def _uncertainties(self) -> Sequence[JointUncertainty | None]:
        return [None] * len(self._summaries) if self._uncertainty is None else self._uncertainty.report()

    def _internal_stops(self) -> Iterator[str]:
        """Yield where motions inside damped transmissions end before the trajectory does."""
        for index, stop in self._internal.stops.items() if self._internal is not None else ():
            joint = self.robot.joint_names[index]
            when = f"cannot go on beyond t = {time_text(stop.time)}"
            yield f"{joint}: what moves inside its damped transmission {when}: {stop.reason}"

    def _self_check(self) -> SelfCheck:
        """Followed deflections satisfy (14) up to their drift, the rest is held to the same bound."""
        bound = SPRING_BOUND if self._deflections is None else DRIFT_BOUND
        error, error_bound = ladder(self.robot, self.trajectory, self.choice.engine, self._internal)
        of_springs, of_shafts = self._balances.residuals()
        return SelfCheck(of_springs, error, bound, error_bound, of_shafts)


def _is_long(robot: Robot) -> bool:
    """Return whether memory bounds the blocks of a chain, so that none is computed beside another."""
    return usual_block(len(robot.joints)) < usual_block(1)


def inverse_dynamics(
    robot: Robot,
    trajectory: Trajectory,
    *,
    stop_on_infeasible: bool = False,
    deflections: str | IntegratedDeflections = "root",
    engine: str = "numpy",
) -> Result:
    """Motor torques that execute a motion and a stiffness profile, VSA-NEA (36)-(74).

    Pure: prints nothing, writes nothing; but compiled code is kept in the user's cache folder.

    Args:
        robot: the robot, from `load_robot` or built in Python.
        trajectory: for this robot, from `load_trajectory` or `Trajectory.from_samples`.
        stop_on_infeasible: end with the first infeasible step.
        deflections: "root" of (14) at each step; "integrate" follows that of the first step by (19); or those
            that were integrated before.
        engine: what computes, "numpy", compiled "c", or "auto", which takes the latter where that saves
            time.

    Returns:
        Every variable of `Block` over (samples, joints[, 2]); `report` holds the verdict.

    Raises:
        InputError: the trajectory has another number of joints than the robot, or no stiffness for a joint
            that needs one; there are no such deflections, there is no such engine, or no C compiler for it.
    """
    from vsacli.analysis.result import Result

    run = Run(
        robot, trajectory, stop_on_infeasible=stop_on_infeasible, deflections=deflections, engine=engine
    )
    return Result(**_joined(list(run)), report=run.report(), robot=robot, trajectory=trajectory)


def _integrated(
    deflections: str | IntegratedDeflections, robot: Robot, trajectory: Trajectory
) -> IntegratedDeflections | None:
    """Return the deflections to use instead of the root of (14) at each step; None for the root."""
    if not isinstance(deflections, str):
        return deflections
    if deflections not in DEFLECTIONS:
        raise InputError.one(f"unknown deflections {deflections!r}{did_you_mean(deflections, DEFLECTIONS)}")
    if deflections == "root":
        return None
    from vsacli.dynamics.integrated_deflections import integrate_deflections

    return integrate_deflections(robot, trajectory)


def _internal_motions(robot: Robot, trajectory: Trajectory) -> InternalMotions | None:
    """Return the motions inside damped transmissions; None if there are none."""
    if not any(joint.damper_at("transmission") for joint in robot.joints):
        return None
    from vsacli.dynamics.internal_motion import internal_motions

    return internal_motions(robot, trajectory)


def _uncertainty(
    robot: Robot, trajectory: Trajectory, asked: Collection[str], engine: Engine
) -> RunUncertainty | None:
    """Return the uncertainty of the run; None if no signal was recorded."""
    if not trajectory.estimates:
        return None
    from vsacli.analysis.run_uncertainty import RunUncertainty, judged_variables

    return RunUncertainty(robot, trajectory, judged_variables(asked, robot), engine)


def _drift_summaries(robot: Robot, deflections: IntegratedDeflections) -> list[DriftSummary]:
    pairs = zip(robot.joints, deflections.stops, strict=True)
    return [
        DriftSummary(joint, index, stop)
        for index, (joint, stop) in enumerate(pairs)
        if joint.actuator.integrable and joint.damper_at("transmission") is None
    ]


def _joined(blocks: list[Block]) -> dict[str, AnyArray]:
    """Blocks one after the other, samples contiguous."""
    rows = [{name: np.moveaxis(array, 0, -1) for name, array in block.arrays().items()} for block in blocks]
    return {
        name: np.moveaxis(np.concatenate([row[name] for row in rows], axis=-1), -1, 0) for name in rows[0]
    }
