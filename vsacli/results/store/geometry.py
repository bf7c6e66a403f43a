"""The geometry of a robot from the arrays of a stored file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np

from vsacli.base.arrays import AnyArray
from vsacli.results.store.damage import DamageError
from vsacli.robot.joint import FRAME_0, DenavitHartenberg, Pose

DH = ("a", "alpha", "d", "theta")
"""Parameters of a Denavit-Hartenberg row, in the order of its fields."""

PARENT, CARRIER = "joints/parent", "tools/joint"
_POSE_PREFIXES = ("base_", "tool_", "joints/mount_", "tools/")

ARRAYS = (
    *(f"joints/dh_{name}" for name in DH),
    *(f"{prefix}{part}" for prefix in _POSE_PREFIXES for part in ("xyz", "rpy")),
    *(PARENT, CARRIER),
)
"""Datasets of the group `inputs/robot` with the geometry; plain chains have the first ones."""


class StoredRow(NamedTuple):
    """The kinematic part of a joint."""

    dh: DenavitHartenberg
    is_revolute: bool
    mount: Pose | None


class StoredGeometry(NamedTuple):
    """A tree of links with tools, which `vsacli.robot.kinematics` accepts in place of a robot.

    Attributes:
        base: pose of DH frame 0 in the base frame.
        joints: kinematic parts of the joints, each after the one that carries it.
        parents: index of the joint whose link carries each joint; -1 for frame 0.
        end_effectors: pose of each tool in the frame of its link.
        tool_joints: index of the joint whose link carries each tool.
    """

    base: Pose
    joints: tuple[StoredRow, ...]
    parents: tuple[int, ...]
    end_effectors: tuple[Pose, ...]
    tool_joints: tuple[int, ...]

    @classmethod
    def of(
        cls, joint_names: Sequence[str], joint_types: Sequence[str], arrays: Mapping[str, AnyArray]
    ) -> Self:
        """Return the geometry of joints with these names and types.

        Args:
            joint_names: names of the joints, in the order of the robot file.
            joint_types: "revolute" or "prismatic".
            arrays: the stored ones of `ARRAYS`.

        Raises:
            DamageError, LookupError: the arrays are those of no robot.
        """
        dh_rows = np.stack([arrays[f"joints/dh_{name}"] for name in DH], axis=-1)
        mounts = _poses(arrays, "joints/mount_") if "joints/mount_xyz" in arrays else [None] * len(dh_rows)
        joints = tuple(
            StoredRow(
                DenavitHartenberg(**dict(zip(DH, dh_row, strict=True))), joint_type == "revolute", mount
            )
            for dh_row, joint_type, mount in zip(dh_rows.tolist(), joint_types, mounts, strict=True)
        )
        joint_indices = {FRAME_0: -1, **{name: index for index, name in enumerate(joint_names)}}
        parents = tuple(joint_indices[name] for name in arrays.get(PARENT, [FRAME_0, *joint_names[:-1]]))
        if any(parent >= index for index, parent in enumerate(parents)):
            raise DamageError("a joint comes before the one that carries it")
        [base], [tool_pose] = _poses(arrays, "base_"), _poses(arrays, "tool_")
        tool_joints, tool_poses = [index for index in range(len(joints)) if index not in parents], [tool_pose]
        if CARRIER in arrays:
            tool_joints, tool_poses = (
                [joint_indices[name] for name in arrays[CARRIER]],
                _poses(arrays, "tools/"),
            )
        elif len(tool_joints) > 1:
            tool_joints, tool_poses = [], []
        if base is None or (end_effectors := [pose for pose in tool_poses if pose is not None]) != tool_poses:
            raise DamageError("a frame has no pose")
        return cls(base, joints, parents, tuple(end_effectors), tuple(tool_joints))


def _poses(arrays: Mapping[str, AnyArray], prefix: str) -> list[Pose | None]:
    """Return the poses of one or several frames; None for a frame with NaN."""
    values = np.stack([arrays[f"{prefix}{part}"] for part in ("xyz", "rpy")], axis=-2)
    return [
        None if np.isnan(pose).any() else Pose(xyz=tuple(pose[0]), rpy=tuple(pose[1]))
        for pose in values.reshape(-1, 2, 3).tolist()
    ]
