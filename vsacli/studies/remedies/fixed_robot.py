"""The file of a robot with another preload."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from vsacli.base.errors import InputError
from vsacli.documents.edited import edited, texts_at
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
        return edited(source.text, values | dict(_moved_files(source.text, Path(source.path).parent, folder)))
    except InputError as error:
        raise InputError.one(f"{remedy.preload.sentence} there by hand: {error}", source.path) from None


def _moved_files(text: str, origin: Path, folder: Path) -> Iterator[tuple[str, str]]:
    """The files that the text names, as seen from a folder that is another one."""
    if os.path.samefile(origin, folder):
        return
    for path, file in texts_at(text, "file"):
        yield path, os.path.relpath(origin / file, folder)
