"""Which numbers of a robot are found from records: springs, motors, friction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters

SPRINGS, MOTORS, FRICTION = "springs", "motors", "friction"
GROUPS = (SPRINGS, MOTORS, FRICTION)
"""What users may ask for by a word."""

FIXED = ("gear_ratio", "torque_constant", "resistance")
"""Numbers of motors that are counted or printed on them, and of which no torque on the joint's side tells."""

WIDTH = "width"

OF_MOTORS = ("motor", "coupled_inertia")
"""Words of paths to numbers of motors."""


def unknowns(robot: Robot, index: int, fit: Sequence[str]) -> tuple[Parameter, ...]:
    """The numbers of one joint's motors and springs that are to be found.

    Terms of a spring that are zero, and the width of friction that is sharp, stay so unless a pattern names
    them: what is not there is not looked for.

    Args:
        robot: the robot.
        index: of the joint.
        fit: words of `GROUPS`, and patterns of paths such as `joints.elbow.actuator.spring.*`.
    """
    return tuple(
        each
        for each in parameters(robot)
        if each.joint == index and (group := group_of(each)) and _asked_for(each, group, fit)
    )


def with_friction(robot: Robot, joints: Sequence[int]) -> Robot:
    """A robot whose motors behind springs have friction of zero where they had none, so that it can be found.

    Args:
        robot: the robot.
        joints: indices of those that it is about.
    """
    paths = [str(each) for each in parameters(robot) if each.joint in joints and group_of(each)]
    sprung = [joint.name for joint in robot.joints if joint.actuator.sprung]
    inertias = [path for path in paths if path.endswith(".inertia") and path.split(".")[1] in sprung]
    frictions = [path.replace(".inertia", f".{FRICTION}") for path in inertias]
    lacking = [each for each in frictions if not any(path.startswith(f"{each}.") for path in paths)]
    return robot.replace({each: {"coulomb": 0.0} for each in lacking})


def admissible(robot: Robot, path: str, value: float) -> float | None:
    """A value that the robot file may hold at a path: this one, or else zero; None if it may hold neither."""
    for each in (value, 0.0):
        try:
            robot.replace(path, each)
        except InputError:
            continue
        return each
    return None


def group_of(parameter: Parameter) -> str | None:
    """What a number of a joint belongs to, a word of `GROUPS`; None if it is not to be found."""
    place = parameter.path[2:]
    if place[0] != "actuator" or place[-1] in FIXED:
        return None
    if FRICTION in place:
        return FRICTION
    return MOTORS if place[1] in OF_MOTORS else SPRINGS


def _asked_for(parameter: Parameter, group: str, fit: Sequence[str]) -> bool:
    if any(fnmatchcase(str(parameter), pattern) for pattern in fit):
        return True
    absent = parameter.value == 0 and (group == SPRINGS or parameter.path[-1] == WIDTH)
    return group in fit and not absent


def check_fit(robot: Robot, fit: Sequence[str], words: Sequence[str]) -> None:
    """Refuse what is neither a word nor fits a number that can be found.

    Raises:
        InputError: saying what was probably meant.
    """
    paths = [str(each) for each in parameters(robot) if each.joint is not None and group_of(each)]
    problems = list(_strange(fit, words, paths))
    if problems:
        raise InputError.one("; ".join(problems))


def _strange(fit: Sequence[str], words: Sequence[str], paths: Sequence[str]) -> Iterator[str]:
    for word in fit:
        if word not in words and not any(fnmatchcase(path, word) for path in paths):
            listed = f"{', '.join(words[:-1])} or {words[-1]}"
            hint = did_you_mean(word, [*words, *paths])
            yield f"--fit {word}: expected {listed}, or the path of a number of motors or springs{hint}"
