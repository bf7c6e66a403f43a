"""All variables of a block of steps: recursion, then actuation joint by joint."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsacli.actuation import Command, Drive, drive
from vsacli.arrays import over_time
from vsacli.motion import Motion
from vsacli.newton_euler import link_torques
from vsacli.robot import Robot
from vsacli.variables import Block


def compute_block(robot: Robot, motion: Motion) -> Block:
    """Inverse dynamics (36)-(74) of a block of steps.

    Args:
        robot: the robot.
        motion: commanded motion and stiffness, (samples, joints).
    """
    tau_e, dtau_e, ddtau_e = link_torques(robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q)
    torques = {"tau_e": tau_e, "dtau_e": dtau_e, "ddtau_e": ddtau_e}
    commanded = {**vars(motion), **torques}
    drives = [
        drive(joint, Command(*(commanded[name][:, index] for name in Command._fields)))
        for index, joint in enumerate(robot.joints)
    ]
    driven: dict[str, Any] = {
        name: over_time(np.stack([getattr(of_joint, name) for of_joint in drives])) for name in Drive._fields
    }
    return Block(**commanded, **driven)
