"""Slips of units in files that come along: robot, trajectory, a text of one of them and what it becomes."""

from __future__ import annotations

from typing import NamedTuple


class Slip(NamedTuple):
    """A slip.

    Attributes:
        what: in a few words.
        robot: name of the robot's file.
        trajectory: name of the trajectory's file.
        wrong: what is replaced by what, wherever it stands in either file.
        rule: name of the rule that finds it.
        field: the end of the path that the warning names.
        looks: what the warning takes it for; empty if it makes no guess.
    """

    what: str
    robot: str
    trajectory: str
    wrong: dict[str, str]
    rule: str
    field: str
    looks: str
