"""Figures of an optimal motion, for `vsacli optimize`."""

from __future__ import annotations

import math

import numpy as np

from vsacli.analysis.result import Result
from vsacli.analysis.run import inverse_dynamics
from vsacli.base.arrays import FloatArray
from vsacli.results.charts.chart import Sheet
from vsacli.results.charts.optimum import JointMotion, OptimizedJoint, change_sheet, pace_sheet
from vsacli.robot.joint import Joint
from vsacli.studies.search import Optimum
from vsacli.studies.search.paced_motion import path_at
from vsacli.trajectory.trajectory import Trajectory

CHANGE, PACE = "optimum", "pace"
"""Names of the figures."""


def optimum_sheets(optimum: Optimum, best_trajectory: Trajectory, commanded: Trajectory) -> dict[str, Sheet]:
    """Return the figures of the changes at each joint, and of the timing if it was varied."""
    before, after = (
        inverse_dynamics(optimum.robot, trajectory) for trajectory in (commanded, best_trajectory)
    )
    path_position = after.time - best_trajectory.start
    if optimum.pace is not None:
        path_position = path_at(path_position, optimum.pace, commanded.duration)
    joints = [
        OptimizedJoint(
            name=joint.name,
            joint_type=joint.type,
            before=_joint_motion(before, before.time - commanded.start, index),
            after=_joint_motion(after, path_position, index),
            limits=_torque_limits(joint),
        )
        for index, joint in enumerate(optimum.robot.joints)
    ]
    title = f"optimum of {optimum.robot_name}, {optimum.asked}: {optimum.words}"
    change = f"{title}, before and after"
    sheets = {CHANGE: change_sheet(joints, change, along_path=optimum.pace is not None)}
    if optimum.pace is not None:
        uniform = math.nan if optimum.timing is None else commanded.duration / optimum.timing.uniform
        sheets[PACE] = pace_sheet(
            path_position, 1 / optimum.pace(path_position), uniform, f"timing of the {title}"
        )
    return sheets


def _joint_motion(result: Result, path_position: FloatArray, index: int) -> JointMotion:
    """Return stiffness, its attainable range, and motor torques of a joint over places along the motion."""
    stiffness, lower, upper = (
        values[:, index] for values in (result.stiffness, result.stiffness_min, result.stiffness_max)
    )
    return JointMotion(path_position, stiffness, lower, upper, result.tau_motor[:, index].T)


def _torque_limits(joint: Joint) -> FloatArray:
    """Return the interval of torque that each motor of a joint allows, (motors, 2)."""
    largest = np.array([motor.max_torque for motor in joint.actuator.motors])
    return np.stack([-largest, largest], axis=-1)
