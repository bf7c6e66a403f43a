"""The file of a robot with another preload."""

from __future__ import annotations

from pathlib import Path

from vsacli.base.errors import InputError
from vsacli.documents.edited import edited, moved_files
from vsacli.studies.remedies.combination import preload_path
from vsacli.studies.remedies.suggestions import Remedy


def robot_text(remedy: Remedy, folder: Path) -> str:
    """The text of the robot's file with the preloads of a remedy, as it stands in a folder.

    Everything else, comments too, stays as the user wrote it; paths lead to the same files.

    Raises:
        InputError: the robot was not read from a file, or its text does not admit the change.
    """
    assert remedy.preload is not None
    source = next(iter(remedy.robot.sources), None)
    if source is None or source.text is None:
        raise InputError.one(f"{remedy.robot.name}: was not read from a file that could be changed")
    values = {
        preload_path(remedy.robot, remedy.robot.joint_names.index(joint)): preload
        for joint, preload in remedy.preload.preloads.items()
    }
    try:
        return edited(source.text, values | dict(moved_files(source.text, Path(source.path).parent, folder)))
    except InputError as error:
        raise InputError.one(f"{remedy.preload.sentence} there by hand: {error}", source.path) from None
