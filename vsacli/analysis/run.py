"""Inverse dynamics along a trajectory, computed block by block.

`Run` yields blocks of samples: each is computed by the kernel `BalancedDynamics`, searched for minima between
samples, merged into the summaries of the report, and released. `inverse_dynamics` joins them in memory.
"""

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
from vsacli.base.flags import MIN_MARGIN, Flag, check_min_margin, has_flag
from vsacli.base.progress import Tell, unheard
from vsacli.base.signals import POSITION
from vsacli.base.units import time_text
from vsacli.base.variables import Block
from vsacli.compute.engine import Engine, choose
from vsacli.dynamics.balances import BALANCES, BalancedDynamics
from vsacli.dynamics.energy import JointEnergy, RunEnergy
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

DEFLECTION_SOLVERS = ("root", "ode")
"""Methods for deflections: the root of (14) at each sample, or integration of (19) from the first root."""


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
            unreliable.
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
        trajectory = fitted(robot, trajectory)
        self.robot = robot
        self.trajectory = trajectory
        self._stop_on_infeasible = stop_on_infeasible
        self._min_margin = min_margin
        self._block_samples = usual_block(len(robot.joints)) if block_samples is None else block_samples
        self._deflections = _integrated(deflection_solver, robot, trajectory)
        frame = None if trajectory.wrench is None else trajectory.wrench.frame
        self._internal = _internal_motions(robot, trajectory)
        inside = () if self._internal is None else self._internal.joints
        integrated = self._deflections is not None
        self._kernel = BalancedDynamics(
            robot, frame, min_margin=min_margin, integrated=integrated, internal=inside
        )
        self._ahead = trajectory.samples > self._block_samples and not _is_long(robot)
        busy = int(self._ahead)  # one thread updates the summaries while the others compute
        self.choice = choose(engine, self._kernel, trajectory.samples, threads, tell, busy=busy)
        self._summaries = [JointSummary(joint, index) for index, joint in enumerate(robot.joints)]
        self._drifts = [] if self._deflections is None else _drift_summaries(robot, self._deflections)
        self._energy = RunEnergy(robot, self.choice.engine)
        self._passages = FrictionPassages(robot)
        self._uncertainty = _uncertainty(robot, trajectory, asked, self.choice.engine)
        self._between = Between(robot, trajectory, min_margin, self._compute, self._judged)
        self._balances = BalanceCheck(robot, trajectory.samples)
        self._samples = 0
        self._stopped = False

    def __iter__(self) -> Iterator[Block]:
        """Yield the blocks in time order; each is released before the next is computed."""
        waiting: deque[Block] = deque()
        # Blocks wait until the samples after them are known: a minimum between two blocks may set a flag.
        for block in self._computed():
            self._between.look(block)
            waiting.append(block)
            del block  # else this name would keep the block alive while the next is computed
            while waiting and self._between.knows(len(waiting[0].time)) and not self._stopped:
                yield self._merged(waiting.popleft())
            if self._stopped:
                return

    def _computed(self) -> Iterator[Block]:
        """Return an iterator of computed blocks; with several threads, blocks are computed ahead."""
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
        """Return the block with flags only of limits exceeded beyond the uncertainty of recorded signals."""
        return block if self._uncertainty is None else self._uncertainty.judged(block)

    def _merged(self, block: Block) -> Block:
        """Merge the next block into the summaries, up to the first infeasible sample if the run stops there.

        Returns:
            The block with flags of minima between its samples, standard deviations and motor energy.
        """
        between = self._between.nearest(block)
        for minima in between:
            minima.mark(block.flags)
        if self._stop_on_infeasible:
            infeasible = has_flag(block.flags, Flag.INFEASIBLE).any(axis=1)
            self._stopped = bool(infeasible.any())
        if self._stopped:
            last = int(infeasible.argmax())
            block, between = block.taken(slice(last + 1)), [each.where(each.step <= last) for each in between]
        if self._uncertainty is not None:
            block = self._uncertainty.add(block)
            for minima in between:  # again, since the samples themselves may keep limits within it
                minima.mark(block.flags)
        self._samples += len(block.time)
        for minima in between:
            self._between.add(minima)
            for index in set(minima.joint.tolist()):
                self._summaries[index].add_bounded(minima.of_joint(index), between=True)
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
        """Engine and options, for repeating the run."""
        options = {
            "stop_on_infeasible": self._stop_on_infeasible,
            "min_margin": self._min_margin,
            "deflection_solver": "root" if self._deflections is None else "ode",
        }
        return {**self.choice.provenance, "options": json.dumps(options)}

    def report(self) -> Report:
        """Return the report on the blocks so far, with the self-check of the whole run."""
        complete = self._samples == self.trajectory.samples
        uncertainties = self._uncertainties()
        found = zip(self._energy.report(), self._between.reports(), uncertainties, strict=True)
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
        for index, stop in self._internal.stops.items() if self._internal is not None else ():
            joint = self.robot.joint_names[index]
            when = f"cannot go on beyond t = {time_text(stop.time)}"
            yield f"{joint}: what moves inside its damped transmission {when}: {stop.reason}"

    def _self_check(self) -> SelfCheck:
        """Return the self-check; its bound is larger for integrated deflections, which drift off (14)."""
        bound = SPRING_BOUND if self._deflections is None else DRIFT_BOUND
        error, error_bound = ladder(self.robot, self.trajectory, self.choice.engine, self._internal)
        of_springs, of_shafts = self._balances.residuals()
        return SelfCheck(of_springs, error, bound, error_bound, of_shafts)


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

    Returns:
        Every variable of `Block` over (samples, joints[, 2]); `report` holds the verdict.

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
    )
    return Result(**_joined(list(run)), report=run.report(), robot=robot, trajectory=trajectory)


def _integrated(
    deflection_solver: str | IntegratedDeflections, robot: Robot, trajectory: Trajectory
) -> IntegratedDeflections | None:
    """Return the deflections to use instead of the root of (14) at each sample; None for the root."""
    if not isinstance(deflection_solver, str):
        return deflection_solver
    if deflection_solver not in DEFLECTION_SOLVERS:
        hint = did_you_mean(deflection_solver, DEFLECTION_SOLVERS)
        raise InputError.one(f"unknown deflection solver {deflection_solver!r}{hint}")
    if deflection_solver == "root":
        return None
    from vsacli.dynamics.integrated_deflections import integrate_deflections

    return integrate_deflections(robot, trajectory)


def _internal_motions(robot: Robot, trajectory: Trajectory) -> InternalMotions | None:
    """Return the internal motions of damped transmissions; None without a damped transmission."""
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
        if "stiffness" in joint.actuator.commanded and joint.damper_at("transmission") is None
    ]


def _joined(blocks: list[Block]) -> dict[str, AnyArray]:
    """Return the variables of consecutive blocks, concatenated, with the samples contiguous in memory."""
    rows = [{name: np.moveaxis(array, 0, -1) for name, array in block.arrays().items()} for block in blocks]
    return {
        name: np.moveaxis(np.concatenate([row[name] for row in rows], axis=-1), -1, 0) for name in rows[0]
    }
