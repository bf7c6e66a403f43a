"""Description of a file of any kind as JSON values.

The module of a kind is imported for a file of this kind: a robot is described without the modules of studies,
results and recordings, whose import takes as long as the description.
"""

from __future__ import annotations

from typing import Any

from vsacli.base.errors import InputError
from vsacli.base.json_records import json_value
from vsacli.base.progress import Progress, unseen
from vsacli.documents.paths import find
from vsacli.documents.source import refuse_other_formats
from vsacli.files.file_kinds import FileKind, recognize
from vsacli.robot.file import load_robot


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
            from vsacli.files.info.robot_info import describe_robot

            return describe_robot(load_robot(path))
        case FileKind.TRAJECTORY:
            from vsacli.files.info.trajectory_info import describe_trajectory_file

            return describe_trajectory_file(path, robot_path)
        case FileKind.TABLE:
            from vsacli.files.info.trajectory_info import describe_table

            return describe_table(path, robot_path, progress, rate)
        case FileKind.RESULT | FileKind.SIMULATION:
            from vsacli.files.info.result_info import describe_result
            from vsacli.results.store.reader import open_stored

            with open_stored(path) as result:
                return describe_result(result)
        case FileKind.STUDY_TABLE:
            from vsacli.files.info.study_info import describe_study

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
