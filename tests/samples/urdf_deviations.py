"""How far a robot converted from a URDF is from an independent reading of the file."""

from __future__ import annotations

import numpy as np
from oracles.urdf_pinocchio import NOWHERE, Held, UrdfOracle

from vsacli import forward_kinematics, link_torques
from vsacli.robot.urdf import Conversion


def deviations(
    conversion: Conversion, oracle: UrdfOracle, samples: int, held: Held = NOWHERE
) -> tuple[float, float]:
    """The largest deviation of tools, m, and of torques over the largest one, at random states."""
    tree, robot = conversion.tree, conversion.robot
    joints = [joint.urdf.name for joint in tree.joints]
    q, dq, ddq = np.random.default_rng(len(joints)).uniform(-2, 2, (3, samples, len(joints)))
    tips = [[oracle.tip_pose(joints, tree.base, tip.link, row, held) for tip in tree.tips] for row in q]
    shift = np.abs(forward_kinematics(robot, q)[:, len(joints) :] - tips).max()
    expected = np.array([oracle.torques(joints, *row, held) for row in zip(q, dq, ddq, strict=True)])
    damping = dq * [joint.damping for joint in robot.joints]
    torques = link_torques(robot, q, dq, ddq, 0 * q, 0 * q)[0] - damping
    return float(shift), float(np.abs(torques - expected).max() / np.abs(expected).max())
