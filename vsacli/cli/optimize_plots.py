"""Figures of an optimal motion, for `vsacli optimize`."""

from __future__ import annotations

import math

import numpy as np

from vsacli.analysis.result import Result
from vsacli.analysis.run import inverse_dynamics
from vsacli.base.arrays import FloatArray
from vsacli.results.charts.chart import Sheet
from vsacli.results.charts.optimum import Moved, OptimizedJoint, change_sheet, pace_sheet
from vsacli.robot.joint import Joint
from vsacli.studies.search import Optimum
from vsacli.studies.search.paced_motion import path_at
from vsacli.trajectory.trajectory import Trajectory

CHANGE, PACE = "optimum", "pace"
"""Names of the figures."""


def optimum_sheets(found: Optimum, best: Trajectory, asked: Trajectory) -> dict[str, Sheet]:
    """Return the figures of the changes at each joint, and of the timing if it was varied."""
    before, after = (inverse_dynamics(found.robot, each) for each in (asked, best))
    place = after.time - best.start
    if found.pace is not None:
        place = path_at(place, found.pace, asked.duration)
    joints = [
        OptimizedJoint(
            name=joint.name,
            joint_type=joint.type,
            before=_moved(before, before.time - asked.start, index),
            after=_moved(after, place, index),
            limits=_torque_limits(joint),
        )
        for index, joint in enumerate(found.robot.joints)
    ]
    title = f"optimum of {found.robot_name}, {found.asked}: {found.words}"
    change = f"{title}, before and after"
    sheets = {CHANGE: change_sheet(joints, change, along_path=found.pace is not None)}
    if found.pace is not None:
        uniform = math.nan if found.timing is None else asked.duration / found.timing.uniform
        sheets[PACE] = pace_sheet(place, 1 / found.pace(place), uniform, f"timing of the {title}")
    return sheets


def _moved(result: Result, place: FloatArray, index: int) -> Moved:
    """Return stiffness, its attainable range, and motor torques of a joint over places along the motion."""
    stiffness, lower, upper = (
        row[:, index] for row in (result.stiffness, result.stiffness_min, result.stiffness_max)
    )
    return Moved(place, stiffness, lower, upper, result.tau_motor[:, index].T)


def _torque_limits(joint: Joint) -> FloatArray:
    """Return the interval of torque that each motor of a joint allows, (motors, 2)."""
    largest = np.array([motor.max_torque for motor in joint.actuator.motors])
    return np.stack([-largest, largest], axis=-1)
