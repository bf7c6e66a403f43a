"""A URDF in the Pinocchio library, which reads the file by itself."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pinocchio as pin

from vsacli.base.arrays import FloatArray

Held: TypeAlias = Mapping[str, float]
NOWHERE: Held = {}


class UrdfOracle:
    """A robot of which some joints, named from the base, move; all others stand still.

    They stand where they are `held`; else where they follow another one to, by the file's own `<mimic>`,
    which Pinocchio does not act on here; else at zero, as does what a joint follows that is not there.
    """

    def __init__(self, path: Path) -> None:
        self._model = pin.buildModelFromUrdf(str(path))
        self._data = self._model.createData()
        joints = ElementTree.parse(path).getroot().iter("joint")
        self._mimics = {
            joint.get("name", ""): mimic.attrib for joint in joints for mimic in joint.findall("mimic")
        }

    def tip_pose(
        self, joints: Sequence[str], base: str, tip: str, q: FloatArray, held: Held = NOWHERE
    ) -> FloatArray:
        """The pose of one link in another, (4, 4), at the positions of the joints."""
        pin.framesForwardKinematics(self._model, self._data, self._configuration(joints, q, held))
        base_pose, tip_pose = (self._data.oMf[self._model.getFrameId(link, pin.BODY)] for link in (base, tip))
        return np.array((base_pose.inverse() * tip_pose).homogeneous)

    def torques(
        self,
        joints: Sequence[str],
        q: FloatArray,
        dq: FloatArray,
        ddq: FloatArray,
        held: Held = NOWHERE,
    ) -> FloatArray:
        """Torques of the joints without damping, (joints,), gravity along -z of the root link."""
        columns = [self._joint(name).idx_v for name in joints]
        rates = np.zeros((2, self._model.nv))
        rates[:, columns] = dq, ddq
        torques = pin.rnea(self._model, self._data, self._configuration(joints, q, held), *rates)
        return np.array(torques[columns])

    def _configuration(self, joints: Sequence[str], q: FloatArray, held: Held) -> FloatArray:
        """An unbounded revolute joint has the cosine and sine of its angle as configuration."""
        configuration = pin.neutral(self._model)
        known = {**held, **dict(zip(joints, q, strict=True))}
        for name in self._model.names[1:]:
            position = self._position(name, known)
            joint = self._joint(name)
            if position != 0:  # such as joints with six degrees of freedom always are
                values = [position] if joint.nq == 1 else [np.cos(position), np.sin(position)]
                configuration[joint.idx_q : joint.idx_q + joint.nq] = values
        return np.array(configuration)

    def _position(self, name: str, known: Mapping[str, float]) -> float:
        if name in known or name not in self._mimics:
            return known.get(name, 0.0)
        mimic = self._mimics[name]
        leader = self._position(mimic["joint"], known)
        return float(mimic.get("multiplier", 1)) * leader + float(mimic.get("offset", 0))

    def _joint(self, name: str) -> pin.JointModel:
        return self._model.joints[self._model.getJointId(name)]
