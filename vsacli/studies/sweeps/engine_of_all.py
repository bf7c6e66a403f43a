"""What computes all runs of a study, chosen once."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.base.errors import InputError
from vsacli.compute.engine import Settled, settle
from vsacli.documents.changes import Changes
from vsacli.dynamics.inverse import InverseDynamics
from vsacli.robot.model import Robot
from vsacli.studies.sweeps.design import Design
from vsacli.studies.sweeps.dimensions import Dimension
from vsacli.trajectory.changes import divided
from vsacli.trajectory.file import load_trajectory


def settled_engine(
    name: str, robot: Robot, trajectories: Sequence[str], dimensions: Sequence[Dimension], design: Design
) -> Settled:
    """The engine of a study. Code is compiled for each robot, so it pays by the runs that each has.

    Args:
        name: as of `settle`.
        robot: as in its file.
        trajectories: paths of their files.
        dimensions: what varies.
        design: the points of each trajectory.

    Raises:
        InputError: there is no such engine, or no C compiler for it.
    """
    samples = _samples(robot, trajectories, dimensions, design) if name == "auto" else 0
    return settle(name, InverseDynamics(robot), samples)


def _samples(
    robot: Robot, trajectories: Sequence[str], dimensions: Sequence[Dimension], design: Design
) -> int:
    """How many steps the runs of one robot have, if all are as long as the first along each trajectory."""
    changes = divided(design.values(0)).trajectory
    robots = design.different([each for each in dimensions if divided({each.path: None}).robot])
    return sum(_steps(path, robot, changes) for path in trajectories) * design.points // robots


def _steps(path: str, robot: Robot, changes: Changes) -> int:
    """Those of the first run, or if it cannot be computed those of the file."""
    try:
        return load_trajectory(path, robot, changes).samples
    except InputError:
        return load_trajectory(path, robot).samples
