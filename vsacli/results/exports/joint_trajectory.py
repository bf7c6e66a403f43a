"""Motions as messages `trajectory_msgs/msg/JointTrajectory` of ROS 2.

The text is JSON, and written such that readers of YAML find the same in it: a point behind each mantissa,
and no letter beyond ASCII.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from typing import Any, TextIO

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.simulation_variables import actual
from vsacli.results.exports.result_format import ResultFormat
from vsacli.results.exports.selection import Samples, Selection

FIELDS = {"positions": "q", "velocities": "dq", "accelerations": "ddq", "effort": "tau_e"}
"""The variable in each field of a point. The effort is what the joint exerts on the link: there is one of it,
while motors may be two, whose torques depend on springs that the message does not know."""

WITHOUT_POINT = re.compile(r"(?<![\d.])(\d+)e")
"""In 1e-05, which JSON takes for a number, and YAML for a text."""

NANOSECONDS = 10**9
"""In a second: times of messages are whole seconds and nanoseconds."""

LONGEST = 2**31 - 1
"""Seconds of a message: builtin_interfaces/msg/Duration has 32 bits for them, with a sign."""


def check_fields(selection: Selection) -> None:
    """Refuse what no field of a message holds, a selection without positions, and times that are too long."""
    names, fields = {each.name for each in selection.chosen}, _fields(selection)
    strange = sorted(names - set(fields.values()))
    if strange:
        places = ", ".join(f"{variable} ({field})" for field, variable in fields.items())
        raise InputError.one(f"a JointTrajectory has no place for {', '.join(strange)}, only for {places}")
    if fields["positions"] not in names:
        raise InputError.one(f"a JointTrajectory needs positions: add {fields['positions']} to --variables")
    if selection.time.size and selection.time[-1] - selection.time[0] > LONGEST:
        lasts = f"lasts {selection.time[-1] - selection.time[0]:.4g} s"
        raise InputError.one(
            f"{lasts}, and a JointTrajectory counts seconds up to {LONGEST}", selection.result.path
        )


def write_joint_trajectory(selection: Selection, stream: TextIO, done: Callable[[int], object]) -> None:
    """Write the message, a line for each point; `time_from_start` counts from the first sample."""
    names = json.dumps(list(selection.result.joint_names))
    stream.write('{"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},\n')
    stream.write(f'"joint_names": {names},\n"points": [')
    separator = "\n"
    for block in selection.blocks():
        points = ",\n".join(map(json.dumps, _points(selection, block)))
        stream.write(separator + WITHOUT_POINT.sub(r"\1.0e", points))
        separator = ",\n"
        done(len(block.time) * len(selection.chosen))
    stream.write("\n]}\n")


def _fields(selection: Selection) -> dict[str, str]:
    """The variable that each field takes from a file of this kind."""
    simulated = selection.result.kind == "simulation"
    return {field: actual(name) if simulated else name for field, name in FIELDS.items()}


def _points(selection: Selection, block: Samples) -> Iterator[dict[str, Any]]:
    fields, values = _fields(selection), block.values
    present = {field: values[name].tolist() for field, name in fields.items() if name in values}
    since = np.rint((block.time - selection.time[0]) * NANOSECONDS).astype(np.int64).tolist()
    for time, *point in zip(since, *present.values(), strict=True):
        seconds, nanoseconds = divmod(time, NANOSECONDS)
        stamp = {"sec": seconds, "nanosec": nanoseconds}
        yield {**dict(zip(present, point, strict=True)), "time_from_start": stamp}


JOINT_TRAJECTORY = ResultFormat(
    write_joint_trajectory,
    variables={"result": tuple(FIELDS.values()), "simulation": tuple(map(actual, FIELDS.values()))},
    check=check_fields,
)
