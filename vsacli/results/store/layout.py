"""The empty result file: attributes, coordinates, variables without samples, and the group `/inputs`."""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Set
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from vsacli.base.arrays import AnyArray
from vsacli.base.flags import FLAG_BITS
from vsacli.base.variables import (
    MOTORS,
    OF_ANY_ROBOT,
    VARIABLES,
    Labels,
    Variable,
    row_shape,
)
from vsacli.base.version import __version__
from vsacli.base.wrench import frames_by_tool
from vsacli.documents.fields import declared_fields
from vsacli.documents.record_values import ResolvedField, resolve_values
from vsacli.results.store.inputs import write_sources
from vsacli.results.store.new_file import chunk_rows
from vsacli.results.store.schema import (
    DOUBLE,
    EXISTING,
    TEXT,
    storable,
    storage_type,
    unit_attributes,
    variable_attributes,
)
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

LABELS = {"axis": ("x", "y", "z"), "bound": ("lower", "upper"), "direction": ("negative", "positive")}
"""Labels of dimensions that only the robot's arrays have; each is written if an array has it."""

PARENTS_PATH = ("joints", "parent")
"""Path of the field with the parents of the joints."""

GZIP_LEVEL = 4


AXIS_DESCRIPTIONS = {
    "tool": "tool name",
    "displacement_axis": "translation along and rotation about the axes of the base frame",
    "wrench_axis": "force and moment along the axes of a frame",
}
"""Dimensions that a file has where a variable or an input has them, each with its description."""

WRENCH_FRAME = "wrench_frame"
"""Attribute of `tool`: the frame of the wrench on each tool, empty where nothing acts."""


def row_bytes(variable: Variable, labels: Labels, precision: str) -> int:
    """Return the size of one sample in bytes."""
    return math.prod(row_shape(variable, labels)) * storage_type(variable, precision).itemsize


def create_layout(
    file: h5py.File,
    format_name: str,
    robot: Robot,
    trajectory: Trajectory,
    variables: tuple[Variable, ...],
    provenance: Mapping[str, str],
    precision: str,
) -> dict[str, h5py.Dataset]:
    """Write everything that is known before the first sample; the time axis has its planned length.

    Args:
        file: empty file.
        format_name: value of the attribute `format`.
        robot: robot of the run.
        trajectory: trajectory of the run.
        variables: variables to store.
        provenance: further root attributes on the computation.
        precision: precision of the values, one of `FLOATS`.

    Returns:
        The datasets for samples by the names of their variables, `time` first.
    """
    file.attrs.update({"format": format_name, **_root_attributes(robot, trajectory, provenance)})
    scales = _create_coordinates(file, robot, trajectory.samples)
    variable_dims = {dim for variable in variables for dim in variable.dims}
    tree_dims = set() if robot.is_plain_chain or not robot.end_effectors else {"tool"}
    scales |= _create_axes(file, variable_dims | tree_dims, robot, trajectory)
    datasets = {"time": scales["time"]}
    for variable in variables:
        dataset = _create_variable(file, variable, robot, trajectory.samples, precision)
        datasets[variable.name] = dataset
        attach_scales(dataset, [scales[dim] for dim in ("time", *variable.dims)])
    inputs = file.create_group("inputs", track_order=True)
    write_sources(inputs, {"robot": robot.sources, "trajectory": trajectory.sources})
    _write_robot(inputs, robot, scales)
    return datasets


def _root_attributes(robot: Robot, trajectory: Trajectory, provenance: Mapping[str, str]) -> dict[str, str]:
    versions = {
        "vsacli": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": _scipy_version(),
        "h5py": h5py.__version__,
    }
    return {
        "generated_by": f"vsacli {__version__}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **{name: storable(text) for name, text in provenance.items()},
        "versions": json.dumps(versions),
        "robot_name": storable(robot.name),
        "trajectory_name": storable(trajectory.name),
        "Conventions": "CF-1.11",
    }


def _scipy_version() -> str:
    """Return the version from SciPy's files; importing it or importlib.metadata outlasts a short run."""
    spec = find_spec("scipy")
    version_source = (
        Path(spec.origin or "").with_name("version.py").read_text(encoding="utf-8") if spec else ""
    )
    match = re.search(r'^version\s*=\s*"([^"]+)"', version_source, re.MULTILINE)
    return match[1] if match else "unknown"


def _create_coordinates(file: h5py.File, robot: Robot, samples: int) -> dict[str, h5py.Dataset]:
    """Write the dimension scales; return them by name."""
    time = _create_variable(file, VARIABLES["time"], robot, samples, DOUBLE)
    joint = create_labels(file, "joint", robot.joint_names, "joint name")
    joint_type = create_labels(file, "joint_type", robot.joint_types, "revolute or prismatic")
    motor = _create_array(file, "motor", np.array(MOTORS, dtype="<i8"))
    motor.attrs["long_name"] = "motor of a joint"
    scales = {"time": time, "joint": joint, "motor": motor}
    for name, scale in scales.items():
        scale.make_scale(name)
    attach_scales(joint_type, [joint])
    return scales


def _create_axes(
    file: h5py.File, dims: Set[str], robot: Robot, trajectory: Trajectory
) -> dict[str, h5py.Dataset]:
    """Write the dimension scales of `AXIS_DESCRIPTIONS` among some dimensions; return them by name."""
    axes = {
        dim: create_labels(file, dim, robot.labels[dim], long_name)
        for dim, long_name in AXIS_DESCRIPTIONS.items()
        if dim in dims
    }
    if trajectory.wrench is not None:
        frames = frames_by_tool(trajectory.wrench.frame)
        if len(frames) > 1:
            axes["tool"].attrs[WRENCH_FRAME] = np.array([frame or "" for frame in frames], dtype=TEXT)
        elif "wrench_axis" in axes:
            axes["wrench_axis"].attrs["frame"] = frames[0]
    for dim, axis in axes.items():
        axis.make_scale(dim)
    return axes


def create_labels(
    file: h5py.File, name: str, labels: Iterable[str], long_name: str, *, track_order: bool = True
) -> h5py.Dataset:
    """Write a dataset of texts, such as the names along a dimension."""
    texts = np.array([storable(label) for label in labels], dtype=TEXT)
    dataset = file.create_dataset(name, data=texts, dtype=TEXT, track_order=track_order)
    dataset.attrs["long_name"] = long_name
    return dataset


def _create_variable(
    file: h5py.File, variable: Variable, robot: Robot, samples: int, precision: str
) -> h5py.Dataset:
    sample_shape = row_shape(variable, robot.labels)
    dataset = file.create_dataset(
        variable.name,
        shape=(samples, *sample_shape),
        maxshape=(samples, *sample_shape),
        dtype=storage_type(variable, precision),
        chunks=(chunk_rows(samples, row_bytes(variable, robot.labels, precision)), *sample_shape),
        compression=GZIP_LEVEL if variable.name in FLAG_BITS else None,
        track_order=True,
    )
    dataset.attrs.update(variable_attributes(variable, robot.joint_types))
    if "joint" in variable.dims and variable.requires not in OF_ANY_ROBOT:
        existing = [joint.has_columns(variable) for joint in robot.joints]
        dataset.attrs[EXISTING] = np.array(existing, dtype=np.uint8)
    return dataset


def _write_robot(inputs: h5py.Group, robot: Robot, coordinates: Mapping[str, h5py.Dataset]) -> None:
    """Write the subgroup `robot`: each declared field as an array, e.g. `gravity`, `joints/link_mass`.

    The joints have one flat group, since a group `motor` would collide with the coordinate `motor`; so have
    the tools.
    """
    group = inputs.create_group("robot", track_order=True)
    scales, fields = dict(coordinates), resolve(robot)
    for name in [name for name in LABELS if any(name in field.dims for field in fields)]:
        scales[name] = _create_array(group, name, np.array(LABELS[name], dtype=TEXT))
        scales[name].make_scale(name)
    member_groups = {"joints": group.create_group("joints")}
    if robot.tools:
        member_groups["tools"] = group.create_group("tools")
    for field in fields:
        owner_group, path = member_groups.get(field.path[0], group), field.path
        name = "_".join(path if owner_group is group else path[1:])
        dataset = _write_field(owner_group, name, field, robot.joint_types)
        attach_scales(dataset, [scales[dim] for dim in field.dims])


def resolve(robot: Robot) -> list[ResolvedField]:
    """Return every declared field of a robot with defaults, in SI units, motor values on the joint side.

    If the robot has the field `parent`, it has the parent of each joint.
    """
    return [
        field._replace(values=np.array(robot.parent_names, dtype=object))
        if field.path == PARENTS_PATH
        else field
        for field in _resolved_fields(robot)
    ]


def _resolved_fields(record: Any) -> Iterator[ResolvedField]:
    record = getattr(record, "at_joint", record)  # motor values on the joint side
    for name, (field, _) in declared_fields(type(record)).items():
        value = getattr(record, name)
        if value is not None:
            for subfield in resolve_values(field.kind, value, _resolved_fields):
                yield subfield._replace(path=(name, *subfield.path), doc=subfield.doc or field.doc)


def _write_field(
    group: h5py.Group, name: str, field: ResolvedField, joint_types: tuple[str, ...]
) -> h5py.Dataset:
    if field.quantity is None:
        units = {}
        values = np.array([storable(text) for text in field.values.flat], dtype=TEXT)
    else:
        units = unit_attributes(field.quantity, joint_types)
        values = field.values
    dataset = _create_array(group, name, values.reshape(field.values.shape))
    dataset.attrs.update({**units, "long_name": field.doc})
    return dataset


def _create_array(group: h5py.Group, name: str, values: AnyArray) -> h5py.Dataset:
    """Write a dataset of numbers, or of texts in an array of type `TEXT`; attributes keep their order."""
    return group.create_dataset(name, data=values, dtype=values.dtype, track_order=True)


def attach_scales(dataset: h5py.Dataset, scales: Iterable[h5py.Dataset]) -> None:
    """Attach its scale to each axis."""
    for axis, scale in enumerate(scales):
        dataset.dims[axis].attach_scale(scale)
