"""Inverse dynamics along the trajectory of a run: its kernel, and deflections that are integrated before."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.variables import Block
from vsacli.compute.engine import NUMPY, Engine
from vsacli.dynamics.balances import BalancedDynamics
from vsacli.dynamics.deflection_rows import IntegratedRows, InternalRows, internal_rows
from vsacli.dynamics.inverse import InverseDynamics, block_of, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections
    from vsacli.dynamics.internal_motion import InternalMotions

DEFLECTION_SOLVERS = ("root", "ode")
"""Methods for deflections: the root of (14) at each sample, or integration of (19) from the first root."""


class RunDynamics:
    """Inverse dynamics and its balances at any time of a trajectory.

    Args:
        robot: Robot.
        trajectory: Commanded motion.
        min_margin: Margin below which a sample is near-singular.
        deflections: Deflections to use instead of the root of (14); None for the root.
        internal: Internal motions of damped transmissions; None without one.
        engine: Backend; may be replaced once it is chosen for the kernel.

    Attributes:
        kernel: Kernel of the engine. Runs with equal kernels share compiled code.
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        *,
        min_margin: float = MIN_MARGIN,
        deflections: IntegratedDeflections | None = None,
        internal: InternalMotions | None = None,
        engine: Engine = NUMPY,
    ) -> None:
        self.robot, self.trajectory, self.engine = robot, trajectory, engine
        self.deflections, self.internal = deflections, internal
        inputs: list[IntegratedRows | InternalRows] = [] if deflections is None else [IntegratedRows()]
        if internal is not None:
            inputs.append(InternalRows(internal.joints))
        frame = None if trajectory.wrench is None else trajectory.wrench.frame
        self.kernel = BalancedDynamics(InverseDynamics(robot, frame, min_margin, tuple(inputs)))

    def compute(self, motion: Motion) -> Block:
        """Return the variables of a part of the trajectory."""
        time, rows = motion.time, dict[str, FloatArray]()
        if self.deflections is not None:
            rows["phi"] = self.deflections.at(time).reshape(-1, len(time))
        if self.internal is not None:
            rows |= internal_rows(self.internal.at(time - self.trajectory.start))
        return block_of(self.kernel, motion, self.engine, rows)

    def at(self, time: FloatArray) -> Block:
        """Return the variables at any times of the trajectory."""
        return self.compute(self.trajectory.at(time))

    def blocks_at(self, time: FloatArray) -> Iterator[tuple[slice, Block]]:
        """Yield the variables at many times in blocks of the usual size, each with its part of the times."""
        size = usual_block(len(self.robot.joints))
        for start in range(0, len(time), size):
            part = slice(start, start + size)
            yield part, self.at(time[part])


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
