"""Robot files: `vsacli-robot/1`."""

from __future__ import annotations

import dataclasses
import os

from vsacli.robot import Robot
from vsacli.spec.reading import read_document

FORMAT = "vsacli-robot/1"


def load_robot(path: str | os.PathLike[str]) -> Robot:
    """Read a robot from a YAML file.

    Raises:
        InputError: with every problem of the file, each with its line.
    """
    robot, source = read_document(path, Robot, FORMAT)
    return dataclasses.replace(robot, sources=(source, *robot.spring_sources))
