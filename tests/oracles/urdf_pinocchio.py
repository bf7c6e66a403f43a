"""A URDF in the Pinocchio library, which reads the file by itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from vsacli.base.arrays import FloatArray


class UrdfOracle:
    """A robot of which some joints, named from the base, move; all others stand still at zero."""

    def __init__(self, path: Path) -> None:
        self._model = pin.buildModelFromUrdf(str(path))
        self._data = self._model.createData()

    def tip_pose(self, joints: Sequence[str], base: str, tip: str, q: FloatArray) -> FloatArray:
        """The pose of one link in another, (4, 4), at the positions of the joints."""
        pin.framesForwardKinematics(self._model, self._data, self._configuration(joints, q))
        base_pose, tip_pose = (self._data.oMf[self._model.getFrameId(link, pin.BODY)] for link in (base, tip))
        return np.array((base_pose.inverse() * tip_pose).homogeneous)

    def torques(self, joints: Sequence[str], q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Torques of the joints without damping, (joints,), gravity along -z of the root link."""
        columns = [self._joint(name).idx_v for name in joints]
        rates = np.zeros((2, self._model.nv))
        rates[:, columns] = dq, ddq
        torques = pin.rnea(self._model, self._data, self._configuration(joints, q), *rates)
        return np.array(torques[columns])

    def _configuration(self, joints: Sequence[str], q: FloatArray) -> FloatArray:
        """An unbounded revolute joint has the cosine and sine of its angle as configuration."""
        configuration = pin.neutral(self._model)
        for name, position in zip(joints, q, strict=True):
            joint = self._joint(name)
            values = [position] if joint.nq == 1 else [np.cos(position), np.sin(position)]
            configuration[joint.idx_q : joint.idx_q + joint.nq] = values
        return np.array(configuration)

    def _joint(self, name: str) -> pin.JointModel:
        return self._model.joints[self._model.getJointId(name)]
