"""The group `/inputs`: the files that were read, and the robot as it was understood."""

from __future__ import annotations

from collections.abc import Mapping

import h5py
import numpy as np

from vsacli.documents.source import Source
from vsacli.results.store.quickly import add_array, attach_scales, set_attributes
from vsacli.results.store.resolved import LABELS, ResolvedField, resolve
from vsacli.results.store.schema import TEXT, storable, unit_attributes
from vsacli.robot.model import Robot


def write_sources(inputs: h5py.Group, sources: tuple[Source, ...]) -> None:
    """A subgroup `file_1`, `file_2`, ... for each file that was read, once even if it served twice."""
    for number, source in enumerate(dict.fromkeys(sources), start=1):
        group = inputs.create_group(f"file_{number}", track_order=True)
        set_attributes(group, {"path": storable(source.path), "sha256": source.sha256})
        if source.text is not None:
            group.create_dataset("text", data=storable(source.text), dtype=TEXT)


def write_robot(inputs: h5py.Group, robot: Robot, coordinates: Mapping[str, h5py.Dataset]) -> None:
    """The subgroup `robot`: each declared field as an array, e.g. `gravity`, `joints/link_mass`.

    One group for the joints, and no deeper: a group `motor` would collide with the coordinate `motor`.
    """
    group = inputs.create_group("robot", track_order=True)
    scales = dict(coordinates)
    for name, labels in LABELS.items():
        scales[name] = add_array(group, name, np.array(labels, dtype=TEXT))
        scales[name].make_scale(name)
    joints = group.create_group("joints")
    for field in resolve(robot):
        of_joints = field.path[0] == "joints"
        name = "_".join(field.path[1:] if of_joints else field.path)
        dataset = _write_field(joints if of_joints else group, name, field, robot.joint_types)
        attach_scales(dataset, [scales[dim] for dim in field.dims])


def _write_field(
    group: h5py.Group, name: str, field: ResolvedField, joint_types: tuple[str, ...]
) -> h5py.Dataset:
    if field.quantity is None:
        units = {}
        values = np.array([storable(text) for text in field.values.flat], dtype=TEXT)
    else:
        units = unit_attributes(field.quantity, joint_types)
        values = field.values
    dataset = add_array(group, name, values.reshape(field.values.shape))
    set_attributes(dataset, {**units, "long_name": field.doc})
    return dataset
