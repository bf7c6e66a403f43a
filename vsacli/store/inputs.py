"""The group `/inputs`: the files that were read, and the robot as it was understood."""

from __future__ import annotations

import h5py
import numpy as np

from vsacli.robot import Robot
from vsacli.spec.source import Source
from vsacli.store.resolved import LABELS, ResolvedField, resolve
from vsacli.store.schema import TEXT, storable, unit_attributes


def write_sources(inputs: h5py.Group, sources: tuple[Source, ...]) -> None:
    """A subgroup `file_1`, `file_2`, ... for each file that was read, once even if it served twice."""
    for number, source in enumerate(dict.fromkeys(sources), start=1):
        group = inputs.create_group(f"file_{number}", track_order=True)
        group.attrs["path"] = storable(source.path)
        group.attrs["sha256"] = source.sha256
        if source.text is not None:
            group.create_dataset("text", data=storable(source.text), dtype=TEXT)


def write_robot(inputs: h5py.Group, robot: Robot) -> None:
    """The subgroup `robot`: each declared field as an array, e.g. `gravity`, `joints/link_mass`."""
    group = inputs.create_group("robot", track_order=True)
    scales = {name: inputs.file[name] for name in ("joint", "motor")}
    for name, labels in LABELS.items():
        scales[name] = group.create_dataset(name, data=labels, dtype=TEXT)
        scales[name].make_scale(name)
    for field in resolve(robot):
        dataset = _write_field(group, field, robot.joint_types)
        for axis, dim in enumerate(field.dims):
            dataset.dims[axis].attach_scale(scales[dim])


def _write_field(group: h5py.Group, field: ResolvedField, joint_types: tuple[str, ...]) -> h5py.Dataset:
    path = _dataset_path(field.path)
    if field.quantity is None:
        labels = np.vectorize(storable, otypes=[object])(field.values)
        dataset = group.create_dataset(path, data=labels, dtype=TEXT, track_order=True)
    else:
        dataset = group.create_dataset(path, data=field.values, track_order=True)
        dataset.attrs.update(unit_attributes(field.quantity, joint_types))
    dataset.attrs["long_name"] = field.doc
    return dataset


def _dataset_path(keys: tuple[str, ...]) -> str:
    """One group for the joints, and no deeper: a group `motor` would collide with the coordinate `motor`."""
    return "joints/" + "_".join(keys[1:]) if keys[0] == "joints" else "_".join(keys)
