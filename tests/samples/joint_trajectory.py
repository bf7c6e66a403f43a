"""The fields of `trajectory_msgs/msg/JointTrajectory`, as the message definitions of ROS 2 have them."""

from __future__ import annotations

import itertools
from typing import Any

POINT_ARRAYS = ("positions", "velocities", "accelerations", "effort")


def check_message(message: Any) -> None:
    """Refuse what a ROS 2 node would not take, or would take for something else."""
    assert list(message) == ["header", "joint_names", "points"]
    assert set(message["header"]) == {"stamp", "frame_id"}
    check_time(message["header"]["stamp"])
    assert isinstance(message["header"]["frame_id"], str)
    names = message["joint_names"]
    assert all(isinstance(name, str) for name in names)
    assert len(set(names)) == len(names) > 0
    for point in message["points"]:
        check_point(point, len(names))
    times = [nanoseconds(point["time_from_start"]) for point in message["points"]]
    assert all(later > earlier for earlier, later in itertools.pairwise(times))


def check_point(point: Any, joints: int) -> None:
    """Arrays are empty or have a float64 for each joint."""
    assert set(point) <= {*POINT_ARRAYS, "time_from_start"}
    check_time(point["time_from_start"])
    for field in POINT_ARRAYS:
        values = point.get(field, [])
        assert len(values) in {0, joints}, field
        assert all(isinstance(value, float) for value in values), field


def check_time(time: Any) -> None:
    """`builtin_interfaces`: int32 sec and uint32 nanosec below a second."""
    assert set(time) == {"sec", "nanosec"}
    assert type(time["sec"]) is type(time["nanosec"]) is int
    assert 0 <= time["nanosec"] < 10**9
    assert -(2**31) <= time["sec"] < 2**31


def nanoseconds(time: Any) -> int:
    return int(time["sec"] * 10**9 + time["nanosec"])
