"""Plausibility of the numbers of a robot, by rules that are data; see `documents.plausibility`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from vsacli.base.errors import Problem
from vsacli.documents import tree
from vsacli.documents.plausibility import (
    ValuesInFile,
    implausible_measurements,
    implausible_values,
)
from vsacli.documents.record_values import NumberPath, PathIndex
from vsacli.documents.source import Source
from vsacli.robot.plausibility.bodies import BODY_RULES, WHOLE_ROBOT_RULES, impossible_links
from vsacli.robot.plausibility.checked_robot import CheckedRobot
from vsacli.robot.plausibility.drives import DRIVE_RULES, RULES_OF_MOTORS_AND_SPRINGS
from vsacli.robot.plausibility.springs import SPRING_RULES

SUBTREE_RULES = (*BODY_RULES, *DRIVE_RULES, *SPRING_RULES, *RULES_OF_MOTORS_AND_SPRINGS)
ROBOT_RULES = (*WHOLE_ROBOT_RULES, *SUBTREE_RULES)


def robot_findings(
    robot: CheckedRobot, subtrees: Sequence[CheckedRobot], sources: Sequence[Source]
) -> tuple[Problem, ...]:
    """Return impossible links and the findings of the rules, with lines of the robot file.

    The robot file is the first of the sources. Each subtree on the base is judged by itself, as if it stood
    alone: one with a number in another unit neither explains nor hides the findings of the others.
    """
    file_lines = ValuesInFile(sources[0]) if sources else None
    # A single joint may well be vertical, unless its file says nothing about gravity.
    chosen = file_lines is None or file_lines.has(("gravity",))
    findings = [
        *impossible_links(robot.joints, file_lines),
        *implausible_values(
            () if chosen and len(robot.joints) == 1 else WHOLE_ROBOT_RULES, [(robot, file_lines, ())]
        ),
        *implausible_values(
            SUBTREE_RULES,
            [(subtree, _robot_file_lines(robot, subtree, sources), ()) for subtree in subtrees],
        ),
    ]
    return tuple(dict.fromkeys(findings))


def robot_rules_with_findings(
    robot: CheckedRobot, subtree: CheckedRobot, sources: Sequence[Source]
) -> frozenset[str]:
    """Return the names of the rules that have findings in a subtree of a robot."""
    lines = _robot_file_lines(robot, subtree, sources)
    return frozenset(implausible_measurements(SUBTREE_RULES, subtree, lines))


def _robot_file_lines(
    robot: CheckedRobot, subtree: CheckedRobot, sources: Sequence[Source]
) -> ValuesInFile | None:
    return ValuesInFile(sources[0], partial(_path_in_robot_file, robot, subtree)) if sources else None


def _path_in_robot_file(
    robot: CheckedRobot, subtree: CheckedRobot, root: tree.Node, path: NumberPath
) -> NumberPath:
    """Return the path in the robot file for a path of a subtree; modified rows become standard ones.

    The standard row of a joint has a and alpha of the modified row of the next one; those of the first one
    are in the base, and those of a joint with a mount in its mount.
    """
    match path:
        case ("joints", PathIndex(number, name), *inner):
            path = ("joints", PathIndex(subtree.numbers_in_robot[number], name), *inner)
    convention = root.entries.get("convention") if isinstance(root, tree.MapNode) else None
    if not (isinstance(convention, tree.TextNode) and convention.text == "modified"):
        return path
    from vsacli.robot.modified_dh import joints_without_mount

    following = joints_without_mount(robot.joints, robot.parents)
    match path:
        case ("joints", PathIndex(number=number), "dh", "a" | "alpha" as word) if number in following:
            return ("joints", PathIndex(following[number]), "dh", word)
        case ("base", "rpy", PathIndex(number=0)) if -1 in following:
            return ("joints", PathIndex(following[-1]), "dh", "alpha")
    return path
