"""The empty result file: attributes, coordinates, variables without samples, inputs."""

from __future__ import annotations

import json
import platform
from datetime import UTC, datetime

import h5py
import numpy as np

from vsacli import __version__
from vsacli.robot import Robot
from vsacli.store.inputs import write_robot, write_sources
from vsacli.store.schema import TEXT, chunk_rows, row_shape, storable, storage_type, variable_attributes
from vsacli.trajectory import Trajectory
from vsacli.variables import MOTORS, VARIABLES, Variable
from vsacli.wrench import WRENCH_AXES


def row_bytes(variable: Variable, joints: int) -> int:
    """Size of one sample."""
    return int(np.prod(row_shape(variable, joints), dtype=int)) * storage_type(variable).itemsize


def create_layout(
    file: h5py.File,
    format_name: str,
    robot: Robot,
    trajectory: Trajectory,
    variables: tuple[Variable, ...],
    command_line: str,
) -> None:
    """Write everything that is known before the first sample; the time axis has its planned length."""
    file.attrs["format"] = format_name
    file.attrs.update(_root_attributes(robot, trajectory, command_line))
    _create_coordinates(file, robot, trajectory.samples)
    if trajectory.wrench is not None and any("wrench_axis" in variable.dims for variable in variables):
        _create_wrench_axis(file, trajectory.wrench.frame)
    for variable in variables:
        dataset = _create_variable(file, variable, robot, trajectory.samples)
        for axis, dim in enumerate(("time", *variable.dims)):
            dataset.dims[axis].attach_scale(file[dim])
    inputs = file.create_group("inputs", track_order=True)
    write_sources(inputs, robot.sources + trajectory.sources)
    write_robot(inputs, robot)


def _root_attributes(robot: Robot, trajectory: Trajectory, command_line: str) -> dict[str, str]:
    versions = {
        "vsacli": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "h5py": h5py.__version__,
    }
    return {
        "generated_by": f"vsacli {__version__}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command_line": storable(command_line),
        "versions": json.dumps(versions),
        "robot_name": storable(robot.name),
        "trajectory_name": storable(trajectory.name),
        "Conventions": "CF-1.11",
    }


def _create_coordinates(file: h5py.File, robot: Robot, samples: int) -> None:
    _create_variable(file, VARIABLES["time"], robot, samples).make_scale("time")
    joint = _create_labels(file, "joint", robot.joint_names, "joint name")
    joint.make_scale("joint")
    _create_labels(file, "joint_type", robot.joint_types, "revolute or prismatic").dims[0].attach_scale(joint)
    motor = file.create_dataset("motor", data=np.array(MOTORS, dtype="<i8"), track_order=True)
    motor.attrs["long_name"] = "motor of a joint"
    motor.make_scale("motor")


def _create_wrench_axis(file: h5py.File, frame: str) -> None:
    axis = _create_labels(file, "wrench_axis", WRENCH_AXES, "force and moment along the axes of a frame")
    axis.attrs["frame"] = frame
    axis.make_scale("wrench_axis")


def _create_labels(file: h5py.File, name: str, labels: tuple[str, ...], long_name: str) -> h5py.Dataset:
    dataset = file.create_dataset(name, data=labels, dtype=TEXT, track_order=True)
    dataset.attrs["long_name"] = long_name
    return dataset


def _create_variable(file: h5py.File, variable: Variable, robot: Robot, samples: int) -> h5py.Dataset:
    joints = len(robot.joints)
    shape = (samples, *row_shape(variable, joints))
    dataset = file.create_dataset(
        variable.name,
        shape=shape,
        maxshape=shape,
        dtype=storage_type(variable),
        chunks=(chunk_rows(samples, row_bytes(variable, joints)), *shape[1:]),
        compression="gzip" if variable.name == "flags" else None,
        track_order=True,
    )
    dataset.attrs.update(variable_attributes(variable, robot.joint_types))
    return dataset
