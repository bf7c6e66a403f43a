"""The empty result file: attributes, coordinates, variables without samples, inputs."""

from __future__ import annotations

import json
import math
import platform
from datetime import UTC, datetime

import h5py
import numpy as np

from vsacli import __version__
from vsacli.base.variables import MOTORS, VARIABLES, Variable
from vsacli.base.wrench import WRENCH_AXES
from vsacli.results.store.inputs import write_robot, write_sources
from vsacli.results.store.quickly import add_array, add_empty, attach_scales, set_attributes
from vsacli.results.store.schema import (
    TEXT,
    chunk_rows,
    row_shape,
    storable,
    storage_type,
    variable_attributes,
)
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


def row_bytes(variable: Variable, joints: int) -> int:
    """Size of one sample."""
    return math.prod(row_shape(variable, joints)) * storage_type(variable).itemsize


def create_layout(
    file: h5py.File,
    format_name: str,
    robot: Robot,
    trajectory: Trajectory,
    variables: tuple[Variable, ...],
    command_line: str,
) -> dict[str, h5py.Dataset]:
    """Write everything that is known before the first sample; the time axis has its planned length.

    Returns:
        The datasets that take samples, by the names of their variables, `time` first.
    """
    set_attributes(file, {"format": format_name, **_root_attributes(robot, trajectory, command_line)})
    scales = _create_coordinates(file, robot, trajectory.samples)
    if trajectory.wrench is not None and any("wrench_axis" in variable.dims for variable in variables):
        scales["wrench_axis"] = _create_wrench_axis(file, trajectory.wrench.frame)
    stored = {"time": scales["time"]}
    for variable in variables:
        dataset = stored[variable.name] = _create_variable(file, variable, robot, trajectory.samples)
        attach_scales(dataset, [scales[dim] for dim in ("time", *variable.dims)])
    inputs = file.create_group("inputs", track_order=True)
    write_sources(inputs, robot.sources + trajectory.sources)
    write_robot(inputs, robot, scales)
    return stored


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


def _create_coordinates(file: h5py.File, robot: Robot, samples: int) -> dict[str, h5py.Dataset]:
    """The dimension scales by name."""
    time = _create_variable(file, VARIABLES["time"], robot, samples)
    joint = _create_labels(file, "joint", robot.joint_names, "joint name")
    joint_type = _create_labels(file, "joint_type", robot.joint_types, "revolute or prismatic")
    motor = add_array(file, "motor", np.array(MOTORS, dtype="<i8"))
    set_attributes(motor, {"long_name": "motor of a joint"})
    scales = {"time": time, "joint": joint, "motor": motor}
    for name, scale in scales.items():
        scale.make_scale(name)
    attach_scales(joint_type, [joint])
    return scales


def _create_wrench_axis(file: h5py.File, frame: str) -> h5py.Dataset:
    axis = _create_labels(file, "wrench_axis", WRENCH_AXES, "force and moment along the axes of a frame")
    set_attributes(axis, {"frame": frame})
    axis.make_scale("wrench_axis")
    return axis


def _create_labels(file: h5py.File, name: str, labels: tuple[str, ...], long_name: str) -> h5py.Dataset:
    dataset = add_array(file, name, np.array(labels, dtype=TEXT))
    set_attributes(dataset, {"long_name": long_name})
    return dataset


def _create_variable(file: h5py.File, variable: Variable, robot: Robot, samples: int) -> h5py.Dataset:
    joints = len(robot.joints)
    dataset = add_empty(
        file,
        variable.name,
        (samples, *row_shape(variable, joints)),
        storage_type(variable),
        chunk_rows(samples, row_bytes(variable, joints)),
        compressed=variable.name == "flags",
    )
    set_attributes(dataset, variable_attributes(variable, robot.joint_types))
    return dataset
