"""Description of a trajectory: ranges and peaks over its samples; and of a CSV file that is one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.progress import Progress
from vsacli.base.signals import COMMANDED, WRENCH, WRENCHES, Signal, orders_of_derivation
from vsacli.base.tables import aligned
from vsacli.base.texts import counted, for_yaml, warnings_and_notes
from vsacli.base.units import POSITION
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES
from vsacli.files.info.text import range_text, short
from vsacli.files.placeholder_robot import placeholder_robot
from vsacli.robot.file import load_robot
from vsacli.trajectory.file import load_trajectory
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.trajectory import Trajectory

BLOCK_SAMPLES = 8192

DERIVATIVES = ("dq", "ddq", "d3q", "d4q")


def describe_table(
    path: str, robot_path: str | None, progress: Progress, rate: float | None
) -> dict[str, Any]:
    """Describe a CSV file: as a trajectory if it has the columns of one, else as a recording."""
    from vsacli.files.recordings import describe_recording, is_trajectory

    robot = None if robot_path is None else load_robot(robot_path)
    if not is_trajectory(path, robot or placeholder_robot(path).robot):
        return describe_recording(path, robot, progress, rate)
    if rate is not None:
        raise InputError.one("has times in column 'time'; leave --rate out", path)
    try:
        description = describe_trajectory_file(path, robot_path)
    except InputError:  # the recording's faults are described
        return describe_recording(path, robot, progress, rate)
    file = for_yaml(Path(path).name)
    signals = ["position", *(key for key in COMMANDED if key in description["joints"][0])]
    sources = [f"{key}: {{type: csv, file: {file}}}" for key in signals]
    if tools := placeholder_robot(path).robot.tools:
        sources.append("# wrenches:  # the file has these columns, not the frames: base or end_effector")
        sources += [f"#   {tool.name}: {{type: csv, frame: ..., file: {file}}}" for tool in tools]
    description["trajectory"] = "\n".join([f"format: {file_formats.TRAJECTORY}", "name: recorded", *sources])
    description["mapping"] = f"format: {file_formats.COLUMNS}\ncolumns: {{time: time}}"
    return description


def describe_trajectory_file(path: str, robot_path: str | None) -> dict[str, Any]:
    """Describe a trajectory file; without a robot, joints are those that it names."""
    if robot_path is not None:
        robot = load_robot(robot_path)
    else:
        robot, ordered = placeholder_robot(path)
        if not ordered:
            reason = "does not say which joints there are, or which is which in its lists"
            raise InputError.one(f"{reason}; name the robot with --robot ROBOT", path)
    return describe_trajectory(load_trajectory(path, robot), robot.joint_names)


def describe_trajectory(trajectory: Trajectory, joint_names: Sequence[str]) -> dict[str, Any]:
    """Describe a trajectory as JSON values: times, and range and peak of each quantity at each joint.

    `min`, `max` and `peak`, the largest absolute value, are taken over the samples. Values that a joint does
    not have, such as the stiffness of a rigid one, are NaN.
    """
    ranges = _Ranges()
    for start in range(0, trajectory.samples, BLOCK_SAMPLES):
        motion = trajectory.block(start, start + BLOCK_SAMPLES)
        ranges.take(motion.variables())
    description: dict[str, Any] = {
        "kind": "trajectory",
        "name": trajectory.name,
        "duration": trajectory.duration,
        "samples": trajectory.samples,
        "start": trajectory.times.span[0],
        "joints": [
            {"name": joint, **{name: ranges.of(name, index) for name in ranges.of_joints}}
            for index, joint in enumerate(joint_names)
        ],
        "warnings": list(trajectory.warnings),
        "notes": list(trajectory.notes),
    }
    if trajectory.wrench is not None:
        wrench_descriptions = {
            signal: _describe_wrench(trajectory.wrench, signal, ranges)
            for signal in trajectory.wrench.profiles
        }
        wrench_by_tool = {
            signal.tool: wrench for signal, wrench in wrench_descriptions.items() if signal.tool
        }
        description |= (
            {WRENCHES: wrench_by_tool} if wrench_by_tool else {WRENCH.key: wrench_descriptions[WRENCH]}
        )
    return description


def _describe_wrench(wrench: WrenchProfile, signal: Signal, ranges: _Ranges) -> dict[str, Any]:
    axes = {
        axis: {name: ranges.of(name, signal.first + index) for name in WRENCH_NAMES}
        for index, axis in enumerate(WRENCH_AXES)
    }
    return {"frame": wrench.frame_of(signal), **axes}


class _Ranges:
    """Smallest and largest value of quantities, (columns,), over the blocks so far."""

    def __init__(self) -> None:
        self._low: dict[str, FloatArray] = {}
        self._high: dict[str, FloatArray] = {}

    @property
    def of_joints(self) -> list[str]:
        return [name for name in orders_of_derivation() if name in self._low]

    def take(self, block: dict[str, FloatArray]) -> None:
        for name, values in block.items():
            low, high = values.min(axis=0), values.max(axis=0)
            self._low[name] = np.minimum(low, self._low.get(name, low))
            self._high[name] = np.maximum(high, self._high.get(name, high))

    def of(self, name: str, column: int) -> dict[str, float]:
        low, high = float(self._low[name][column]), float(self._high[name][column])
        return {"min": low, "max": high, "peak": max(abs(low), abs(high))}


def trajectory_lines(trajectory: Mapping[str, Any]) -> Iterator[str]:
    """Yield the description of a trajectory as lines of text."""
    samples = counted(trajectory["samples"], "sample")
    yield (
        f"trajectory {trajectory['name']}: {samples}, {short(trajectory['duration'])} s from t = "
        f"{short(trajectory['start'])} s"
    )
    commanded = [key for key in COMMANDED if key in trajectory["joints"][0]]
    rows = [("joint", "q", *(f"peak {name}" for name in DERIVATIVES), *commanded)]
    rows += [
        (
            joint["name"],
            range_text(joint["q"]),
            *(short(joint[name]["peak"]) for name in DERIVATIVES),
            *(range_text(joint[key]) for key in commanded),
        )
        for joint in trajectory["joints"]
    ]
    yield from aligned(rows)
    units = (f"; {key} {COMMANDED[key].quantities[0]}" for key in commanded)
    yield f"units: q {POSITION}, its k-th derivative per s^k{''.join(units)}"
    if WRENCH.key in trajectory:
        yield _wrench_line("wrench", trajectory[WRENCH.key])
    for tool, wrench in trajectory.get(WRENCHES, {}).items():
        yield _wrench_line(f"wrench on {tool}", wrench)
    yield from warnings_and_notes(trajectory["warnings"], trajectory["notes"])


def _wrench_line(title: str, wrench: Mapping[str, Any]) -> str:
    axes = [axis for axis in wrench if axis != "frame"]
    ranges = ", ".join(f"{axis} {range_text(wrench[axis]['wrench'])}" for axis in axes)
    return f"{title} along the axes of {wrench['frame']}, N and N m: {ranges}"
