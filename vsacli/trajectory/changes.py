"""Changes by path, divided into those of the robot file and those of the trajectory file."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.documents.fields import declared
from vsacli.documents.reading import KEPT, ChangeError, Changes, check_path_of_change, written
from vsacli.robot.file import RobotFile
from vsacli.trajectory.file import OF_ANY_ROBOT


class Divided(NamedTuple):
    """Changes of the robot file and of the trajectory file."""

    robot: Changes
    trajectory: Changes


def divided(changes: Changes) -> Divided:
    """Divide changes by the file that has the first key of their path.

    No key occurs in both files, except the ones in `KEPT`, which cannot be changed.

    Raises:
        ChangeError: neither file has such a key, or the key is in `KEPT`.
    """
    robot, trajectory = declared(RobotFile), declared(OF_ANY_ROBOT)
    found = Divided({}, {})
    for (path, value), change in zip(changes.items(), written(changes), strict=True):
        check_path_of_change(path, change)
        first = path.partition(".")[0]
        if first not in robot and first not in trajectory:
            hint = did_you_mean(first, [key for key in (*robot, *trajectory) if key not in KEPT])
            raise ChangeError.of(change, f"neither robot nor trajectory has a key {first!r}{hint}")
        of = found.robot if first in robot else found.trajectory
        of[path] = value  # type: ignore[index]
    return found
