"""The system of equations of all links, with what its numbers may be."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters
from vsacli.studies.identification.estimation.equations import Equations, with_noise
from vsacli.studies.identification.estimation.solution import Solution
from vsacli.studies.identification.links.base_parameters import BaseParameters
from vsacli.studies.identification.links.inertial_parameters import SYMBOLS, UNITS, names
from vsacli.studies.identification.links.link_equations import Given, LinkUnknowns, link_equations
from vsacli.studies.identification.motors.unknowns import SPRINGS, admissible, group_of
from vsacli.studies.identification.records.signals import Signals

LINKS = "links"
"""Title of the system of all of them, and the word by which users ask for it."""

NONE = np.zeros((0, 0))


class LinkSystem:
    """Equations of all links; see `SystemOfEquations`.

    Args:
        robot: the robot, as its file has it.
        sought: what is to be found.
        given: numbers of springs that were found before.
    """

    def __init__(self, robot: Robot, sought: LinkUnknowns, given: Given) -> None:
        self._robot, self._sought, self._given = robot, sought, given
        self.title, self.names, self.before = LINKS, sought.names, sought.present
        of_base = [UNITS[at % len(SYMBOLS)] for at in self.base.kept]
        self.units = (*of_base, *(each.unit for each in sought.numbers))
        words = (self.base.words(place, names(robot)) for place in range(len(of_base)))
        self.sums = (*words, *[""] * len(sought.numbers))

    @property
    def base(self) -> BaseParameters:
        """What the first numbers are."""
        return self._sought.base

    def equations(self, values: FloatArray, signals: Signals) -> Equations:
        """Those of a record at some values of the numbers, (numbers,)."""
        numbers = tuple(
            each._replace(value=float(value))
            for each, value in zip(self._sought.numbers, values[len(self.base.kept) :], strict=True)
        )
        present = self._sought._replace(numbers=numbers, present=values)
        return with_noise(partial(link_equations, self._robot, present, given=self._given), signals)

    def admissible(self, number: int, value: float) -> float | None:
        """The value itself unless it is of the robot file, and that may hold no more than zero."""
        if number < len(self.base.kept):
            return value
        return admissible(self._robot, self.names[number], value)

    def without(self, fixed: dict[int, float]) -> LinkSystem:
        """The same with some numbers of the file at given values, which are no longer looked for."""
        robot = self._robot.replace({self.names[number]: value for number, value in fixed.items()})
        left = [number for number in range(len(self.names)) if number not in fixed]
        first = len(self.base.kept)
        sought = self._sought._replace(
            numbers=tuple(each for at, each in enumerate(self._sought.numbers, first) if at not in fixed),
            names=tuple(self.names[number] for number in left),
            present=self.before[left],
        )
        return LinkSystem(robot, sought, self._given)


def link_system(robot: Robot, fit: Sequence[str], motors: Sequence[Solution]) -> LinkSystem:
    """That of a robot.

    Args:
        robot: as its file has it.
        fit: words and patterns, of which those of motors count where joints are rigid.
        motors: what was found of motors and springs, which says what springs carry, and how exactly.
    """
    return LinkSystem(robot, LinkUnknowns.of(robot, fit), _springs(robot, motors))


def _springs(robot: Robot, motors: Sequence[Solution]) -> Given:
    """Numbers of springs that were found, and their errors as sums of independent ones."""
    from scipy.linalg import block_diag

    known = {str(each): each for each in parameters(robot)}
    found = [_found([known[name] for name in each.system.names], each) for each in motors]
    roots = [root for _, root in found]
    return Given(tuple(number for some, _ in found for number in some), block_diag(*roots) if roots else NONE)


def _found(numbers: Sequence[Parameter], motors: Solution) -> tuple[list[Parameter], FloatArray]:
    """Of one joint the numbers of springs as they predict best, and a root of their covariance."""
    springs = [place for place, each in enumerate(numbers) if group_of(each) == SPRINGS]
    covariance = np.zeros((len(numbers),) * 2)
    covariance[np.ix_(motors.free, motors.free)] = motors.fit.covariance
    powers, axes = np.linalg.eigh(covariance[np.ix_(springs, springs)])
    values = motors.predicting[springs]
    present = (numbers[at]._replace(value=float(value)) for at, value in zip(springs, values, strict=True))
    return list(present), axes * np.sqrt(np.maximum(powers, 0.0))


def without_links(robot: Robot, joints: Sequence[int], fit: Sequence[str], records: Sequence[Signals]) -> str:
    """Why nothing is found of the links, a sentence; empty if there is no reason.

    Args:
        robot: the robot.
        joints: indices of those that were recorded.
        fit: as of `link_system`.
        records: of its motion.
    """
    positions = np.concatenate([each.q for each in records])
    unknown = [name for name, q in zip(robot.joint_names, positions.T, strict=True) if np.isnan(q).any()]
    if unknown:
        return f"links move each other, and the positions of {', '.join(unknown)} were not recorded"
    if any(joint.damper for joint in robot.joints):
        return "nothing is found of links while there are dampers, whose damping was not recorded"
    rows = len(joints) * sum(len(each.time) // each.filter.stride for each in records)
    count = len(link_system(robot, fit, ()).names)
    if rows <= count:
        return f"{rows} equations are too few for the {count} numbers of the links; record for longer"
    return ""
