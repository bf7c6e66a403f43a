"""Changes by path, divided into those of the robot file and those of the trajectory file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vsacli.base.did_you_mean import MOST_NEAR, did_you_mean, nearest
from vsacli.base.texts import listed
from vsacli.documents.fields import declared_fields
from vsacli.documents.paths import declared_paths
from vsacli.documents.reading import KEPT, ChangeError, Changes, check_path_of_change, format_changes
from vsacli.robot.file import RobotFile
from vsacli.trajectory.file import OF_ANY_ROBOT


class ChangesByFile(NamedTuple):
    """Changes of the robot file and of the trajectory file."""

    robot: Changes
    trajectory: Changes


def divide_changes_by_file(changes: Changes) -> ChangesByFile:
    """Divide changes by the file that has the first key of their path.

    No key occurs in both files, except the ones in `KEPT`, which cannot be changed.

    Raises:
        ChangeError: neither file has such a key, or the key is in `KEPT`.
    """
    robot, trajectory = declared_fields(RobotFile), declared_fields(OF_ANY_ROBOT)
    by_file = ChangesByFile({}, {})
    for (path, value), change in zip(changes.items(), format_changes(changes), strict=True):
        check_path_of_change(path, change)
        first_key = path.partition(".")[0]
        if first_key not in robot and first_key not in trajectory:
            hint = _path_suggestion(path, [key for key in (*robot, *trajectory) if key not in KEPT])
            raise ChangeError.of(
                change, f"neither robot nor trajectory has {first_key!r} at the top level{hint}"
            )
        file_changes = by_file.robot if first_key in robot else by_file.trajectory
        file_changes[path] = value  # type: ignore[index]
    return by_file


def _path_suggestion(path: str, keys: Sequence[str]) -> str:
    """Return a clause with the paths that end with this one, or else the nearest of the keys at the top."""
    last_key = path.rpartition(".")[2]
    valid_paths = dict.fromkeys((*declared_paths(RobotFile), *declared_paths(OF_ANY_ROBOT)))
    for ending in (path, last_key if nearest(path.partition(".")[0], keys) is None else path):
        if longer := [each for each in valid_paths if each.endswith(f".{ending}")]:
            return f"; did you mean {listed(longer, MOST_NEAR)}?"
    return did_you_mean(path.partition(".")[0], keys)
