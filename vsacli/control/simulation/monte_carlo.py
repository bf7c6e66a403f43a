"""The same run with many errors of the controller's model."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

from vsacli.base.errors import InputError
from vsacli.base.interrupts import leave_interrupts_to_others
from vsacli.control.simulation.perturbation import perturbed
from vsacli.control.simulation.simulate import simulate
from vsacli.control.simulation.simulation_report import SimulationReport
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


def simulate_perturbed(
    robot: Robot,
    trajectory: Trajectory,
    relative: float,
    seeds: Sequence[int],
    *,
    processes: int = 1,
    **conditions: Any,
) -> Iterator[SimulationReport]:
    """Reports on the run of a robot whose controller has a wrong model, for one error after the other.

    The models differ in numbers alone, so that what is compiled for the first run serves all.

    Args:
        robot: the robot as it is.
        trajectory: what it is to do.
        relative: largest relative error of a parameter of the model; see `perturbed`.
        seeds: of the errors, one a run.
        processes: how many compute; a second for each to start is repaid by some ten runs. A script that asks
            for more than one calls this below `if __name__ == "__main__":`.
        conditions: further arguments of `simulate`, but for `model`.

    Raises:
        InputError: as of `simulate` and `perturbed`, or there are less than one process.
    """
    if processes < 1:
        raise InputError.one(f"there must be at least 1 process, not {processes}")
    report = partial(_report, robot, trajectory, relative, {"runs": len(seeds), **conditions})
    yield from map(report, seeds[:1])  # alone, as it may have to compile
    if processes == 1:
        yield from map(report, seeds[1:])
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, context, leave_interrupts_to_others)
    try:
        yield from pool.map(report, seeds[1:])
    finally:
        pool.shutdown(cancel_futures=True)


def _report(
    robot: Robot, trajectory: Trajectory, relative: float, conditions: dict[str, Any], seed: int
) -> SimulationReport:
    return simulate(robot, trajectory, model=perturbed(robot, relative, seed), **conditions).report
