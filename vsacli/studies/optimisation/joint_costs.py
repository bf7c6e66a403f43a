"""Costs of joints: what a run reports of a trajectory, and sizes by which a search scales them."""

from __future__ import annotations

from collections.abc import Mapping

from vsacli.analysis.run import inverse_dynamics
from vsacli.dynamics.drive import drive
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.criteria import Criterion
from vsacli.studies.remedies.motions import Load
from vsacli.trajectory.trajectory import Trajectory


def run_costs(robot: Robot, trajectory: Trajectory, criteria: Mapping[int, Criterion]) -> dict[int, float]:
    """Return the costs of joints, by index, over the steps of a run; NaN where any is out of reach."""
    result = inverse_dynamics(robot, trajectory)
    return {index: criterion.of_run(result, index) for index, criterion in criteria.items()}


def asked_size(joint: Joint, load: Load, criterion: Criterion) -> float:
    """Return the scale of the cost of a load as commanded; NaN if it is out of reach."""
    steps = load.at(load.steps)
    return criterion.size(joint, drive(joint, steps.command), steps.time)
