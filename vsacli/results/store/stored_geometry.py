"""Where the frames of the robot of a result file lie, as its arrays say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import DenavitHartenberg, Pose

DH = ("a", "alpha", "d", "theta")
"""The numbers of a Denavit-Hartenberg row, in the order of its fields."""


class StoredRow(NamedTuple):
    """What a joint has to do with where frames lie."""

    dh: DenavitHartenberg
    is_revolute: bool


class StoredGeometry(NamedTuple):
    """A chain, which `vsacli.robot.kinematics` takes in place of a robot."""

    base: Pose
    tool: Pose
    joints: tuple[StoredRow, ...]

    @classmethod
    def of(cls, joint_types: Sequence[str], rows: FloatArray, base: FloatArray, tool: FloatArray) -> Self:
        """Of numbers as they are stored.

        Args:
            joint_types: "revolute" or "prismatic", base to tip.
            rows: Denavit-Hartenberg rows, (joints, 4), in the order of `DH`.
            base: `xyz` and `rpy` of the pose, (2, 3).
            tool: the same.
        """
        joints = (
            StoredRow(DenavitHartenberg(**dict(zip(DH, row, strict=True))), joint_type == "revolute")
            for row, joint_type in zip(rows.tolist(), joint_types, strict=True)
        )
        return cls(_pose(base), _pose(tool), tuple(joints))


def _pose(numbers: FloatArray) -> Pose:
    xyz, rpy = map(tuple, numbers.tolist())
    return Pose(xyz=xyz, rpy=rpy)
