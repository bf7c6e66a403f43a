"""Motions as messages `trajectory_msgs/msg/JointTrajectory` of ROS 2.

The text is JSON, and written such that readers of YAML find the same in it: a point behind each mantissa,
and no letter beyond ASCII.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import TextIO

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.simulation_variables import actual
from vsacli.base.units import time_text
from vsacli.results.exports.result_format import ResultFormat
from vsacli.results.exports.selection import Samples, Selection

FIELDS = {"positions": "q", "velocities": "dq", "accelerations": "ddq", "effort": "tau_e"}
"""The variable in each field of a point. The effort is what the joint exerts on the link: there is one of it,
while motors may be two, whose torques depend on springs that the message does not know."""

NANOSECONDS = 10**9
"""In a second: times of messages are whole seconds and nanoseconds."""


def check_fields(selection: Selection) -> None:
    """Refuse what no field of a message holds, and a selection without positions."""
    names, fields = {each.name for each in selection.chosen}, _fields(selection)
    strange = sorted(names - set(fields.values()))
    if strange:
        places = ", ".join(f"{variable} ({field})" for field, variable in fields.items())
        raise InputError.one(f"a JointTrajectory has no place for {', '.join(strange)}, only for {places}")
    if fields["positions"] not in names:
        raise InputError.one(f"a JointTrajectory needs positions: add {fields['positions']} to --variables")


def write_joint_trajectory(selection: Selection, stream: TextIO, done: Callable[[int], object]) -> None:
    """Write the message, a line for each point; `time_from_start` counts from the first sample."""
    names = json.dumps(list(selection.result.joint_names))
    stream.write('{"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},\n')
    stream.write(f'"joint_names": {names},\n"points": [')
    separator = "\n"
    for block in selection.blocks():
        _check_finite(selection, block)
        for line in _points(selection, block):
            stream.write(f"{separator}{line}")
            separator = ",\n"
        done(len(block.time) * len(selection.chosen))
    stream.write("\n]}\n")


def _fields(selection: Selection) -> dict[str, str]:
    """The variable that each field takes from a file of this kind."""
    simulated = selection.result.kind == "simulation"
    return {field: actual(name) if simulated else name for field, name in FIELDS.items()}


def _points(selection: Selection, block: Samples) -> Iterator[str]:
    fields, values = _fields(selection), block.values
    present = {field: values[name] for field, name in fields.items() if name in values}
    since = np.rint((block.time - selection.time[0]) * NANOSECONDS).astype(np.int64).tolist()
    rows = zip(*(values.tolist() for values in present.values()), strict=True)
    for time, point in zip(since, rows, strict=True):
        arrays = (f'"{field}": {_numbers(row)}' for field, row in zip(present, point, strict=True))
        seconds, nanoseconds = divmod(time, NANOSECONDS)
        stamp = f'"time_from_start": {{"sec": {seconds}, "nanosec": {nanoseconds}}}'
        yield f"{{{', '.join([*arrays, stamp])}}}"


def _numbers(row: Iterable[float]) -> str:
    return f"[{', '.join(map(_number, row))}]"


def _number(value: float) -> str:
    """As `repr`, but 1.0e-05 for 1e-05, in which YAML sees no number."""
    mantissa, exponent, power = repr(value).partition("e")
    return f"{mantissa}.0e{power}" if exponent and "." not in mantissa else repr(value)


def _check_finite(selection: Selection, block: Samples) -> None:
    """Refuse infinity, for which JSON has no number."""
    for name, values in block.values.items():
        lost = np.argwhere(~np.isfinite(values))
        if len(lost):
            sample, joint = lost[0]
            where = f"{selection.result.joint_names[joint]}.{name}"
            reason = (
                f"{where} is infinite at t = {time_text(float(block.time[sample]))}, which JSON cannot hold"
            )
            raise InputError.one(reason, selection.result.path)


JOINT_TRAJECTORY = ResultFormat(
    write_joint_trajectory,
    variables={"result": tuple(FIELDS.values()), "simulation": tuple(map(actual, FIELDS.values()))},
    check=check_fields,
)
