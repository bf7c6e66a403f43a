"""What devices of the joints do while a trajectory does not command them."""

from __future__ import annotations

import math

from vsacli.base.signals import DAMPING
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


def with_uncommanded_devices(trajectory: Trajectory, robot: Robot) -> Trajectory:
    """The trajectory of a robot whose dampers, if none is commanded, stand at their least; a note says so."""
    dampers = [joint.damper for joint in robot.joints]
    if DAMPING.key in trajectory.commanded or not any(dampers):
        return trajectory
    least = tuple(math.nan if damper is None else damper.range[0] for damper in dampers)
    standing = ", ".join(
        f"{joint.name} at {value:g} {DAMPING.quantities[0].unit(joint.type)}"
        for joint, value in zip(robot.joints, least, strict=True)
        if joint.damper is not None
    )
    note = f"no {DAMPING.key} is commanded, so dampers stand at the least of their ranges: {standing}"
    return trajectory.commanding(DAMPING, least, note)
