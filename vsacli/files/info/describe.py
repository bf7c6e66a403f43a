"""The description of a file of any kind."""

from __future__ import annotations

from typing import Any

from vsacli.base.errors import InputError
from vsacli.files.file_kinds import FileKind, recognise
from vsacli.files.info.robot_info import describe_robot
from vsacli.files.info.stored import describe_result
from vsacli.files.info.trajectory_info import describe_trajectory
from vsacli.files.placeholder_robot import placeholder_robot
from vsacli.results.store.simulation import open_stored
from vsacli.robot.file import load_robot
from vsacli.trajectory.file import load_trajectory


def describe_file(path: str, robot_path: str | None = None) -> dict[str, Any]:
    """What a robot, trajectory, result or simulation file holds, as JSON values in SI units.

    Args:
        path: the file.
        robot_path: the robot that a trajectory is for, if its joints shall have their names.

    Raises:
        InputError: the file is of another kind, or cannot be used.
    """
    match recognise(path):
        case FileKind.ROBOT:
            return describe_robot(load_robot(path))
        case FileKind.TRAJECTORY | FileKind.TABLE:
            return _described_trajectory(path, robot_path)
        case FileKind.RESULT | FileKind.SIMULATION:
            with open_stored(path) as result:
                return describe_result(result)
        case kind:
            expected = "a robot, a trajectory, a result or a simulation"
            raise InputError.one(f"is a file of the kind {kind.value}; expected {expected}", path)


def _described_trajectory(path: str, robot_path: str | None) -> dict[str, Any]:
    if robot_path is not None:
        robot = load_robot(robot_path)
    else:
        robot, ordered = placeholder_robot(path)
        if not ordered:
            hint = "name the robot with --robot ROBOT"
            raise InputError.one(f"does not say which joint is which in its lists; {hint}", path)
    return describe_trajectory(load_trajectory(path, robot), robot.joint_names)
