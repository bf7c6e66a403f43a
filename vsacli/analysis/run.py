"""The run of one robot along one trajectory, block by block, or with its result in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.analysis.batch import Batch
from vsacli.analysis.joint_report import JUDGED
from vsacli.analysis.report import Report
from vsacli.base.arrays import AnyArray
from vsacli.base.signals import POSITION
from vsacli.base.units import time_text
from vsacli.base.variables import TIP_COMPLIANCE, Block
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.variants import Variants
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.analysis.result import Result
    from vsacli.dynamics.integrated_deflections import IntegratedDeflections


class Run(Batch):
    """One pass over a trajectory: iterate it to obtain the blocks, then call `report`.

    It is the batch of one variant.

    Args:
        robot: Robot.
        trajectory: Commanded motion.
        **options: Those of `Batch`.

    Raises:
        InputError: As for `Batch`.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory, **options: Any) -> None:
        check_robot(robot)
        super().__init__(Variants.of_one(robot), [trajectory], **options)
        self.robot, (self.trajectory,) = robot, self.trajectories

    def report(self) -> Report:
        """Return the report on the blocks so far, with the self-check of the whole run."""
        report = self.findings()
        undetermined = any(
            joint.uncertainty is not None and joint.uncertainty.undetermined for joint in report.joints
        )
        return replace(
            report,
            warnings=(*self.robot.warnings, *self._trajectory_warnings(undetermined=undetermined)),
            notes=(
                *self.trajectory.notes,
                *self._minima_search.notes,
                *self._internal_stops(),
                *self._friction_passages[0].notes(self._dynamics),
            ),
        )

    def energies(self) -> Sequence[JointEnergy]:
        """Return the energy of each joint over the blocks so far, as `report` does, without a self-check."""
        return self._energy.report()

    def _trajectory_warnings(self, *, undetermined: bool) -> tuple[str, ...]:
        """Return the trajectory's warnings. Rigid robots use no derivative beyond the second.

        With them, warnings on the highest derivative become advice if a variable is undetermined.
        """
        warnings, estimate = self.trajectory.warnings, self.trajectory.estimates.get(POSITION)
        if estimate is None or any(joint.actuator.sprung for joint in self.robot.joints):
            return warnings
        advice = estimate.advice_without_derivative()
        return tuple(
            advice.get(warning, warning) for warning in warnings if undetermined or warning not in advice
        )

    def _internal_stops(self) -> Iterator[str]:
        """Yield a note for each internal motion that ends before the trajectory does."""
        internal = self._dynamics.internal
        for index, stop in internal.stops.items() if internal is not None else ():
            joint = self.robot.joint_names[index]
            stop_text = f"cannot go on beyond t = {time_text(stop.time)}"
            yield f"{joint}: what moves inside its damped transmission {stop_text}: {stop.reason}"


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


def _concatenate_blocks(blocks: list[Block]) -> dict[str, AnyArray]:
    """Return the variables of consecutive blocks, concatenated, with the samples contiguous in memory."""
    arrays_by_block = [
        {name: np.moveaxis(array, 0, -1) for name, array in block.arrays().items()} for block in blocks
    ]
    return {
        name: np.moveaxis(np.concatenate([arrays[name] for arrays in arrays_by_block], axis=-1), -1, 0)
        for name in arrays_by_block[0]
    }
