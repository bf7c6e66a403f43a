"""Descriptions of files as JSON values: ranges of a trajectory, reports of results, a study, the cache."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, StorageError
from vsacli.base.json_records import json_value
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import COMMANDED, orders_of_derivation
from vsacli.base.storage import unfinished
from vsacli.base.texts import for_yaml
from vsacli.base.units import Quantity
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES
from vsacli.compute.engine.cache import MOST_BYTES, Cache, CacheError, open_cache
from vsacli.documents.columns_file import FORMAT as COLUMNS
from vsacli.documents.paths import find
from vsacli.documents.source import refuse_other_formats
from vsacli.files.file_kinds import FileKind, recognize
from vsacli.files.info.robot_info import describe_robot
from vsacli.files.placeholder_robot import placeholder_robot
from vsacli.results.store.reader import StoredResult, open_stored
from vsacli.results.store.study_table import StoredStudy
from vsacli.robot.file import load_robot
from vsacli.studies.sweeps import StudySummary
from vsacli.trajectory.file import FORMAT, load_trajectory
from vsacli.trajectory.trajectory import Trajectory


def describe_cache(folder: str) -> dict[str, Any]:
    """Describe the cache of compiled code, and unfinished files in a folder and in that for temporary files.

    Raises:
        StorageError: the cache cannot be used.
    """
    with _opened() as cache:
        sizes = [entry.size for entry in cache.entries()]
        found = [each for place in _places(Path(folder), cache.folder) for each in unfinished(place)]
    return {
        "kind": "cache",
        "folder": str(cache.folder),
        "entries": len(sizes),
        "size": sum(sizes),
        "limit": MOST_BYTES,
        "unfinished": [
            {"path": str(each.path), "size": each.size, "owner": each.owner.value} for each in found
        ],
    }


def clear_cache() -> None:
    """Remove all compiled code.

    Raises:
        StorageError: the cache cannot be used.
    """
    with _opened() as cache:
        cache.clear()


@contextmanager
def _opened() -> Iterator[Cache]:
    try:
        yield open_cache()
    except CacheError as error:
        raise StorageError("compiled code", str(error)) from error


def _places(*folders: Path) -> list[Path]:
    """Return these folders and the folder for temporary files, if there is one, each once."""
    places = dict.fromkeys(folders)
    with suppress(OSError):
        places[Path(tempfile.gettempdir())] = None
    return list(places)


KIND = "table of a study"


def describe_study(path: str) -> dict[str, Any]:
    """Describe a study table as JSON values: findings, varying parameters, provenance, inputs with SHA-256.

    Raises:
        InputError: the file is damaged.
    """
    with StoredStudy(path) as table:
        provenance = table.provenance()
        inputs = [{"path": each.path, "sha256": each.sha256} for each in table.inputs()]
        return {
            "kind": KIND,
            **StudySummary.of(table).as_json(),
            "parameters": [_parameter(table, path) for path in table.parameters],
            "columns": list(table.columns),
            "provenance": {"created": str(table.attributes["created"]), **provenance, "inputs": inputs},
        }


def _parameter(table: StoredStudy, path: str) -> dict[str, Any]:
    """Describe the values of a parameter: all texts, or range and count of distinct numbers."""
    if table.parameter_is_text(path):
        return {"path": path, "values": sorted(set(table.texts(path)))}
    values = table.read(path)
    low, high = (float(values.min()), float(values.max())) if len(values) else (None, None)
    different = len(np.unique(values))
    return {"path": path, "units": table.unit(path), "min": low, "max": high, "different": different}


def study_lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the description of a study table as lines of text."""
    yield str(StudySummary.from_json(table))
    provenance = table["provenance"]
    yield f"created {provenance['created']} with NumPy {provenance['numpy']}, engine {provenance['engine']}"
    yield f"method {provenance['method']}, seed {provenance['seed']}"
    yield f"command line: {provenance['command_line']}"
    yield from (f"input {each['path']}, SHA-256 {each['sha256']}" for each in provenance["inputs"])
    for each in table["parameters"]:
        if "values" in each:
            yield f"{each['path']}: {', '.join(each['values'])}"
        elif each["different"] == 1:
            yield f"{each['path']}: {each['min']:.6g} {each['units']}"
        else:
            span = f"{each['min']:.6g} to {each['max']:.6g} {each['units']}"
            yield f"{each['path']}: {span}, {each['different']} values"
    yield f"columns: {', '.join(table['columns'])}"


BLOCK_SAMPLES = 8192


def describe_file(
    path: str, robot_path: str | None = None, progress: Progress = unseen, rate: float | None = None
) -> dict[str, Any]:
    """Describe a robot, trajectory, recording, result or simulation file as JSON values in SI units.

    Args:
        path: path of the file.
        robot_path: robot of a trajectory or a recording, for the names of its joints.
        progress: opens a progress bar over the bytes of a recording.
        rate: rows per second of a recording without times.

    Raises:
        InputError: the file is of another kind, or cannot be used; or a rate is given for a file that is not
            a recording without times.
    """
    kind = recognize(path)
    if rate is not None and kind is not FileKind.TABLE:
        raise InputError.one(f"is a {kind}; --rate is only for recordings without a column of times", path)
    match kind:
        case FileKind.ROBOT:
            return describe_robot(load_robot(path))
        case FileKind.TRAJECTORY:
            return _described_trajectory(path, robot_path)
        case FileKind.TABLE:
            return _described_table(path, robot_path, progress, rate)
        case FileKind.RESULT | FileKind.SIMULATION:
            with open_stored(path) as result:
                return describe_result(result)
        case FileKind.STUDY_TABLE:
            return describe_study(path)
        case FileKind.CATALOG:
            advice = f"vsacli size ROBOT TRAJECTORY --catalog {path} chooses from it"
            raise InputError.one(f"is a motor catalog; {advice}", path)
        case kind:
            refuse_other_formats(path)
            expected = "a robot, a trajectory, a result, a simulation or the table of a study"
            raise InputError.one(f"is a file of the kind {kind.value}; expected {expected}", path)


def described_value(description: dict[str, Any], field: str) -> Any:
    """Return the value at a path into a description, as plain JSON values.

    Raises:
        InputError: the path does not exist; with the valid keys, and the nearest one.
    """
    return find(json_value(description), field)


def _described_table(
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
        described = _described_trajectory(path, robot_path)
    except InputError:  # the recording's faults are described
        return describe_recording(path, robot, progress, rate)
    file = for_yaml(Path(path).name)
    signals = ["position", *(key for key in COMMANDED if key in described["joints"][0])]
    sources = [f"{key}: {{type: csv, file: {file}}}" for key in signals]
    described["trajectory"] = "\n".join([f"format: {FORMAT}", "name: recorded", *sources])
    described["mapping"] = f"format: {COLUMNS}\ncolumns: {{time: time}}"
    return described


def _described_trajectory(path: str, robot_path: str | None) -> dict[str, Any]:
    if robot_path is not None:
        robot = load_robot(robot_path)
    else:
        robot, ordered = placeholder_robot(path)
        if not ordered:
            unknown = "does not say which joints there are, or which is which in its lists"
            raise InputError.one(f"{unknown}; name the robot with --robot ROBOT", path)
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
        axes = {axis: _axis(ranges, index) for index, axis in enumerate(WRENCH_AXES)}
        description["wrench"] = {"frame": trajectory.wrench.frame, **axes}
    return description


def _axis(ranges: _Ranges, index: int) -> dict[str, Any]:
    return {name: ranges.of(name, index) for name in WRENCH_NAMES}


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


def describe_result(result: StoredResult) -> dict[str, Any]:
    """Describe a result or simulation as JSON values: provenance, inputs with SHA-256, variables, report.

    Raises:
        InputError: the file is damaged.
    """
    return {
        "kind": result.kind,
        "robot": result.robot_name,
        "trajectory": result.trajectory_name,
        "verdict": result.verdict,
        "complete": result.complete,
        "samples": result.time.size,
        "joints": [
            {"name": name, "type": joint_type, "actuator": actuator}
            for name, joint_type, actuator in zip(
                result.joint_names, result.joint_types, result.actuators, strict=True
            )
        ],
        "provenance": result.provenance(),
        "variables": [
            {
                "name": name,
                "dims": ["time", *result.declared[name].dims],
                "units": _units(result.declared[name].quantity, result.joint_types),
                "meaning": result.declared[name].long_name,
            }
            for name in result.variables
        ],
        "report": result.report_json,
    }


def _units(quantity: Quantity, joint_types: tuple[str, ...]) -> str:
    found = {quantity.unit(joint_type) for joint_type in joint_types}
    return found.pop() if len(found) == 1 else str(quantity)
