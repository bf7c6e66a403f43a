"""A commented trajectory file to begin with, which its robot can execute."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection
from typing import Any

import numpy as np

from vsacli.base import file_formats
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.signals import WRENCH
from vsacli.base.storage import reporting_temporary_errors, temporary_folder
from vsacli.documents.commented import WIDTH, commented_document, three_digits
from vsacli.dynamics.forward import mass_matrix
from vsacli.files.info.robot_info import static_load, stiffness_ranges
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.combined import smallest_slow_down
from vsacli.studies.search.loads import TaskSamples
from vsacli.studies.search.task import Task
from vsacli.trajectory import file as trajectory_file
from vsacli.trajectory.file import load_trajectory
from vsacli.trajectory.trajectory import Trajectory


def possible_duration(robot: Robot, text: str, usual_duration: float) -> tuple[float, str]:
    """Return a duration with which the robot can execute a trajectory file, and a remark if it is longer.

    Args:
        robot: robot that executes the trajectory.
        text: text of the file, with the usual duration.
        usual_duration: usual duration, s.

    Raises:
        StorageError: the disk has no room for a temporary file.
    """
    acceptance, trajectory = Acceptance(robot, MIN_MARGIN), _load_text(text, robot)
    reasons = "; ".join(_refusal_reasons(acceptance, trajectory))
    if not reasons:
        return usual_duration, ""
    try:
        duration = usual_duration * smallest_slow_down(Task(acceptance, trajectory)).factor
    except ImpossibleError as error:
        return usual_duration, f"This robot cannot execute it, nor more slowly: {error}."
    rounded_duration = _round_up(duration)
    if not _refusal_reasons(acceptance, trajectory.stretched(rounded_duration / usual_duration)):
        duration = rounded_duration
    return duration, f"It does not take {usual_duration:g} s, since then {reasons}."


def _refusal_reasons(acceptance: Acceptance, trajectory: Trajectory) -> tuple[str, ...]:
    return acceptance.reasons(TaskSamples.of(trajectory, 0, trajectory.samples))


def _load_text(text: str, robot: Robot) -> Trajectory:
    with temporary_folder() as folder:
        path = folder / "starter.yaml"
        with reporting_temporary_errors():
            path.write_text(text, encoding="utf-8")
        return load_trajectory(path, robot)


def _round_up(duration: float) -> float:
    """Return a duration rounded up to two digits."""
    unit = 10.0 ** (math.floor(math.log10(duration)) - 1)
    return float(f"{math.ceil(duration / unit) * unit:.6g}")


Values = dict[str, Any]

DURATION = 4.0
"""Duration of the starter trajectory, s."""

POSITION_DEGREE = 9
STIFFNESS_DEGREE = 5
"""Degree of stiffness profiles: motor accelerations, and thus torque discontinuities, vanish at both ends."""

TRAJECTORY_HEAD = (
    "A trajectory to begin with. Degrees 9 and 5 are the smallest with which motors behind springs start",
    "and end without a step of their torques. What stands commented out is optional.",
)

ANGLE_OF_MOTION = math.radians(30)
STROKE_OF_MOTION = 0.1
"""Stroke of a joint unless limits are tighter, rad and m."""

PEAK_TO_MEAN_VELOCITY = 2.5
"""Peak velocity of the motion, relative to its mean, rounded up."""

PEAK_ACCELERATION = 10.0
"""Peak acceleration of the motion, relative to its length over the square of its duration, rounded up."""

USED_SHARE = 0.5
"""Fraction of a range or limit that the motion uses."""

START_TO_LOWEST, END_TO_LOWEST = 1.15, 1.35
"""Stiffness at both ends relative to the minimum attainable one, if there is no maximum."""


def trajectory_template(robot: Robot | None = None, name: str = "my-trajectory") -> str:
    """Return the text of a trajectory file.

    Args:
        robot: robot whose limits and springs determine the values; by default those of `robot_template` with
            revolute joints. If it cannot execute the motion in the usual time, the motion is slower, and a
            comment gives the reason.
        name: name of the trajectory.
    """
    if robot is None:
        position: Values = {"start": 0, "end": "30 deg"}
        stiffness: Values = {"start": 1500, "end": 2000}
    else:
        position, stiffness = _position(robot), _stiffness(robot)
    values: Values = {
        "name": name,
        "duration": DURATION,
        "rate": trajectory_file.DEFAULT_RATE,
        "position": {"type": "polynomial", "degree": POSITION_DEGREE, **position},
    }
    if stiffness:
        values["stiffness"] = {"type": "polynomial", "degree": STIFFNESS_DEGREE, **stiffness}
    further = (
        []
        if robot is None
        else sorted(CommandedJoints.of(robot).commanding_signals - {"stiffness", "damping"})
    )
    values |= {key: {"type": "constant", "value": 1} for key in further}
    if robot is not None and (damping := _damping(robot)):
        values["damping"] = {"type": "constant", "value": damping}
    if robot is None:
        return _trajectory_document(values)

    unmentioned = (WRENCH.key,) if len(robot.tool_names) > 1 else ()
    draft = _trajectory_document(values, unmentioned=unmentioned)
    duration, remark = possible_duration(robot, draft, DURATION)
    return _trajectory_document({**values, "duration": duration}, remark, unmentioned)


def _trajectory_document(values: Values, remark: str = "", unmentioned: Collection[str] = ()) -> str:
    head = (*TRAJECTORY_HEAD, *textwrap.wrap(remark, WIDTH - 2))
    cls = trajectory_file.OF_ANY_ROBOT
    return commented_document(file_formats.TRAJECTORY, cls, values, head, unmentioned=unmentioned)


def _position(robot: Robot) -> Values:
    ways = {joint.name: _way(joint) for joint in robot.joints}
    return {
        end: {joint.name: _written(joint, ways[joint.name][index]) for joint in robot.joints}
        for index, end in enumerate(("start", "end"))
    }


def _written(joint: Joint, position: float) -> str:
    """Return the position in a few digits, or in all digits if rounding would exceed a limit."""
    low, high = joint.limits.position
    shown, unit = (math.degrees(position), " deg") if joint.is_revolute else (position, "")
    short = f"{shown:.3g}"
    value = math.radians(float(short)) if joint.is_revolute else float(short)
    return f"{short}{unit}" if low <= value <= high else repr(position)


def _way(joint: Joint) -> tuple[float, float]:
    """Return start and end of the motion of a joint: near zero, well within its limits."""
    low, high = joint.limits.position
    slowest = min(abs(bound) for bound in joint.limits.velocity)
    length = min(
        ANGLE_OF_MOTION if joint.is_revolute else STROKE_OF_MOTION,
        USED_SHARE * (high - low),
        USED_SHARE * slowest * DURATION / PEAK_TO_MEAN_VELOCITY,
    )
    start = min(max(0.0, low), high - length)
    return start, start + length


def _stiffness(robot: Robot) -> Values:
    loads, of_motion = static_load(robot), _motion_loads(robot)
    chosen = {
        joint.name: _stiffnesses(joint, float(load), float(configuration[index]), of_motion[index])
        for index, (joint, load, configuration) in enumerate(
            zip(robot.joints, loads.values, loads.configurations, strict=True)
        )
        if "stiffness" in joint.actuator.commanded
    }
    if not chosen:
        return {}
    return {
        "start": {name: three_digits(start) for name, (start, _) in chosen.items()},
        "end": {name: three_digits(end) for name, (_, end) in chosen.items()},
    }


def first_stiffnesses(robot: Robot) -> dict[str, float]:
    """Return an attainable stiffness under load for each joint with commanded stiffness."""
    return dict(_stiffness(robot).get("start", {}))


def _motion_loads(robot: Robot) -> list[float]:
    """Return bounds of the torque that moves each joint without gravity, N m (N)."""
    ways = [_way(joint) for joint in robot.joints]
    lengths = np.array([end - start for start, end in ways])
    inertia = np.abs(mass_matrix(robot, np.array([start for start, _ in ways])))
    damping = np.array([joint.damping for joint in robot.joints])
    velocity, acceleration = PEAK_TO_MEAN_VELOCITY / DURATION, PEAK_ACCELERATION / DURATION**2
    bounds: list[float] = (inertia @ lengths * acceleration + damping * lengths * velocity).tolist()
    return bounds


def _stiffnesses(joint: Joint, load: float, q: float, of_motion: float) -> tuple[float, float]:
    """Return two stiffnesses attainable under the load at q, or without load if none is."""
    ranges = stiffness_ranges(joint, load, q)
    if ranges["unloaded"][0] == 0:  # soft without bound at rest: such springs must at least carry the motion
        ranges = stiffness_ranges(joint, max(abs(load), of_motion), q)
    lower, upper = ranges["loaded"] if ranges["loaded"][0] < ranges["loaded"][1] else ranges["unloaded"]
    lower, upper = max(lower, joint.limits.stiffness[0]), min(upper, joint.limits.stiffness[1])
    soft, stiff = START_TO_LOWEST * lower, END_TO_LOWEST * lower
    if not 0 < stiff <= upper:
        soft, stiff = lower + (upper - lower) / 3, lower + (upper - lower) * 2 / 3
    return soft, stiff


def _damping(robot: Robot) -> Values:
    """Return the middle of the range of each damper."""
    return {joint.name: sum(joint.damper.range) / 2 for joint in robot.joints if joint.damper is not None}
