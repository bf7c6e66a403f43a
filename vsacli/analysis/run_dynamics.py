"""Inverse dynamics along the trajectories of a batch: its kernel, and deflections integrated before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.variables import Block
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.compute.engine import NUMPY, Engine
from vsacli.dynamics.balances import BalancedBlock, BalancedDynamics
from vsacli.dynamics.deflection_rows import IntegratedRows, InternalRows, internal_rows
from vsacli.dynamics.inverse import InverseDynamics, block_of, usual_block
from vsacli.dynamics.variants import Variants
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Motion, Trajectory

if TYPE_CHECKING:
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections
    from vsacli.dynamics.internal_motion import InternalMotions

_Value = TypeVar("_Value")

DEFLECTION_SOLVERS = ("root", "ode")
"""Methods for deflections: the root of (14) at each sample, or integration of (19) from the first root."""


class RunDynamics:
    """Inverse dynamics and its balances at any time of the trajectories of a batch of variants.

    Arguments `variant` are the index of the variant of each sample, (samples,).

    Args:
        variants: Robots; only a single one may have deflections that are integrated.
        trajectories: Commanded motion of each.
        min_margin: Margin below which a sample is near-singular.
        deflections: Deflections to use instead of the root of (14); None for the root.
        internal: Internal motions of damped transmissions; None without one.
        engine: Backend; may be replaced once it is chosen for the kernel.

    Attributes:
        frame: Frame of the wrench; None without a wrench.
        kernel: Kernel of the engine. Runs with equal kernels share compiled code.
    """

    def __init__(
        self,
        variants: Variants,
        trajectories: Sequence[Trajectory],
        *,
        min_margin: float = MIN_MARGIN,
        deflections: IntegratedDeflections | None = None,
        internal: InternalMotions | None = None,
        engine: Engine = NUMPY,
    ) -> None:
        self.variants, self.trajectories, self.engine = variants, tuple(trajectories), engine
        self.deflections, self.internal = deflections, internal
        inputs: list[IntegratedRows | InternalRows] = [] if deflections is None else [IntegratedRows()]
        if internal is not None:
            inputs.append(InternalRows(internal.joints))
        wrench = self.trajectories[0].wrench
        self.frame = None if wrench is None else wrench.frame
        base_dynamics = BalancedDynamics(
            InverseDynamics(variants.base, self.frame, min_margin, tuple(inputs))
        )
        self.kernel = variants.kernel(base_dynamics)

    @property
    def robot(self) -> Robot:
        """The first robot, whose joints, limits and structure are those of all."""
        return self.variants.robots[0]

    def from_zero(self) -> RunDynamics:
        """Return the dynamics with time zero at the first sample, where times are rounded least.

        Deflections are the roots of (14). The kernel equals that of a usual run, so that compiled code is
        shared.
        """
        trajectories = self.by_trajectory(Trajectory.from_zero)
        return RunDynamics(self.variants, trajectories, internal=self.internal, engine=self.engine)

    def by_trajectory(self, function: Callable[[Trajectory], _Value]) -> list[_Value]:
        """Return a function of the trajectory of each variant, called once for each distinct one."""
        values = {id(trajectory): function(trajectory) for trajectory in self._distinct}
        return [values[id(trajectory)] for trajectory in self.trajectories]

    @property
    def _distinct(self) -> list[Trajectory]:
        return list({id(each): each for each in self.trajectories}.values())

    def motion(self, start: int, stop: int) -> Motion:
        """Return the motion at samples start..stop-1 of each variant, one variant after the other."""
        return concatenate_motions(self.by_trajectory(lambda each: each.block(start, stop)))

    def compute(self, motion: Motion) -> Block:
        """Return the variables of a motion of all variants, see `motion`."""
        samples_per_variant = len(motion.time) // len(self.trajectories)
        return self._compute(motion, np.repeat(np.arange(len(self.trajectories)), samples_per_variant))

    def at(self, time: FloatArray, variant: IndexArray | None = None) -> Block:
        """Return the variables at any times, (samples,), of the trajectories; of the first one by default."""
        variant = np.zeros(len(time), dtype=np.intp) if variant is None else variant
        return self._compute(self._motion_at(time, variant), variant)

    def blocks_at(self, time: FloatArray, variant: IndexArray) -> Iterator[tuple[slice, Block]]:
        """Yield the variables at many times in blocks of the usual size, each with its part of the times."""
        block_size = usual_block(len(self.robot.joints))
        for start in range(0, len(time), block_size):
            time_slice = slice(start, start + block_size)
            yield time_slice, self.at(time[time_slice], variant[time_slice])

    def _motion_at(self, time: FloatArray, variant: IndexArray) -> Motion:
        """Return the motion at times; each distinct trajectory is evaluated once."""
        distinct = self._distinct
        if len(distinct) == 1:
            return distinct[0].at(time)
        number_by_id = {id(trajectory): index for index, trajectory in enumerate(distinct)}
        trajectory_indices = np.array([number_by_id[id(trajectory)] for trajectory in self.trajectories])[
            variant
        ]
        order = trajectory_indices.argsort(kind="stable")
        parts = [
            distinct[index].at(time[trajectory_indices == index])
            for index in sorted(set(trajectory_indices.tolist()))
        ]
        inverse_order = order.argsort()
        return concatenate_motions(parts).mapped(time, lambda array, _: array[inverse_order])

    def _compute(self, motion: Motion, variant: IndexArray) -> Block:
        time, rows = motion.time, dict[str, Iterable[FloatArray]](self.variants.inputs(variant))
        if self.deflections is not None:
            rows["phi"] = self.deflections.at(time).reshape(-1, len(time))
        if self.internal is not None:
            rows |= internal_rows(self.internal.at(time - self.trajectories[0].start))
        return block_of(self.kernel, motion, self.engine, rows, BalancedBlock)


def concatenate_motions(motions: Sequence[Motion]) -> Motion:
    """Return motions with the same signals one after the other."""
    if len(motions) == 1:
        return motions[0]
    time = np.concatenate([motion.time for motion in motions])
    names = motions[0].of_joints
    arrays = {name: np.concatenate([motion.of_joints[name] for motion in motions]) for name in names}
    wrench, wrenches = None, [motion.wrench for motion in motions if motion.wrench is not None]
    if wrenches:
        components = (
            np.concatenate([getattr(other_wrench, name) for other_wrench in wrenches])
            for name in WRENCH_NAMES
        )
        wrench = Wrench(*components, frame=wrenches[0].frame)
    return Motion.of(time, arrays, wrench)


def choose_deflections(
    deflection_solver: str | IntegratedDeflections, robot: Robot, trajectory: Trajectory
) -> IntegratedDeflections | None:
    """Return the deflections to use instead of the root of (14) at each sample; None for the root.

    Args:
        deflection_solver: One of `DEFLECTION_SOLVERS`, or deflections that were integrated before.
        robot: Robot.
        trajectory: Commanded motion.
    """
    if not isinstance(deflection_solver, str):
        return deflection_solver
    if deflection_solver not in DEFLECTION_SOLVERS:
        hint = did_you_mean(deflection_solver, DEFLECTION_SOLVERS)
        raise InputError.one(f"unknown deflection solver {deflection_solver!r}{hint}")
    if deflection_solver == "root":
        return None
    from vsacli.dynamics.integrated_deflections import integrate_deflections

    return integrate_deflections(robot, trajectory)


def damped_motions(robot: Robot, trajectory: Trajectory) -> InternalMotions | None:
    """Return the internal motions of damped transmissions; None if there are none."""
    if not any(joint.damper_at("transmission") for joint in robot.joints):
        return None
    from vsacli.dynamics.internal_motion import internal_motions

    motions = internal_motions(robot, trajectory)
    return motions if motions.joints else None
