"""How much a motion tells of the numbers of its robot: the slopes of the equations of identification."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import Block
from vsacli.robot.model import Robot
from vsacli.studies.identification.estimation.independence import Independence, in_words, independence
from vsacli.studies.identification.links.inertial_parameters import names
from vsacli.studies.identification.links.link_equations import LinkUnknowns, link_equations
from vsacli.studies.identification.links.link_system import LINKS
from vsacli.studies.identification.motors.motor_equations import motor_equations
from vsacli.studies.identification.motors.unknowns import GROUPS, unknowns, with_friction
from vsacli.studies.identification.records.signals import Filter, Signals

ALL_PASS = Filter(bandwidth=np.inf, sections=np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]), stride=1, reach=0)
"""For motions without noise."""

TOLERANCE = 1e-6
"""Share of a column that no combination of others explains, from which on its unknown can be told by some
motion: dependent ones leave 1e-12 of rounding."""


CONDITION = 20.0
"""Largest condition that costs nothing. On the paper's arm it cost 0 to 1.5 % of the standard errors to come
below; without, one search in three left 30 and more, which multiplies what the equations lack of truth."""


class Columns(NamedTuple):
    """Slopes of a system of equations by its unknowns.

    Attributes:
        name: whose numbers they are, e.g. `elbow`, or `links`.
        slopes: (rows, unknowns).
    """

    name: str
    slopes: FloatArray


class Information:
    """What motions tell of the numbers of a robot.

    The motors and springs of each joint are a system of equations of their own, the links of all joints
    another. There the torques of each joint count by their size, since those of a wrist are far smaller than
    those of a base.

    Args:
        robot: the robot.
        examples: motions from which it follows what no motion tells apart, and the size of torques.

    Attributes:
        structural: what no motion tells, clauses.
    """

    def __init__(self, robot: Robot, examples: Sequence[Block]) -> None:
        self._robot = robot = with_friction(robot, range(len(robot.joints)))
        self._motors = {
            index: chosen
            for index, joint in enumerate(robot.joints)
            if joint.actuator.sprung and (chosen := unknowns(robot, index, GROUPS))
        }
        self._links = LinkUnknowns.of(robot, GROUPS)
        torques = np.concatenate([block.tau_e for block in examples])
        self._sizes = np.sqrt(np.mean(torques**2, axis=0))
        splits = self._splits(examples)
        self._kept = [each.kept for each in splits]
        self.structural = tuple(self._untold(splits))

    def _splits(self, examples: Sequence[Block]) -> list[Independence]:
        """Of each system, the unknowns that some motion tells apart, and the others."""
        systems = zip(*(self._columns(block) for block in examples), strict=True)
        together = [np.concatenate([each.slopes for each in system]) for system in systems]
        return [independence(slopes, TOLERANCE) for slopes in together]

    def _untold(self, splits: Sequence[Independence]) -> Iterator[str]:
        """What no motion tells, in words."""
        paths = [list(map(str, chosen)) for chosen in self._motors.values()]
        for own, split in zip([*paths, self._links.names], splits, strict=True):
            if split.nothing.size:
                yield ", ".join(own[at] for at in split.nothing)
            for place, kept in enumerate(split.kept):
                others = np.flatnonzero(split.shares[place])
                if others.size:
                    terms = [(int(split.dropped[at]), float(split.shares[place, at])) for at in others]
                    yield f"more than {in_words([(int(kept), 1.0), *terms], own)}"
        of_links = names(self._robot)
        silent = np.flatnonzero(~self._links.base.shares.any(axis=0))
        if silent.size:
            yield ", ".join(of_links[at] for at in silent)

    def _columns(self, block: Block) -> Iterator[Columns]:
        """The systems of equations of a motion."""
        signals = exact_signals(block)
        for index, chosen in self._motors.items():
            values = np.array([each.value for each in chosen])
            equations = motor_equations(self._robot, index, chosen, values, signals)
            yield Columns(self._robot.joint_names[index], equations.slopes)
        slopes = link_equations(self._robot, self._links, signals).slopes
        sizes = np.repeat(self._sizes, len(block.time))  # joint by joint
        yield Columns(LINKS, slopes / np.where(sizes > 0, sizes, 1.0)[:, None])

    def worth(self, block: Block) -> float:
        """What a motion tells, less what is too badly conditioned for equations that hold but roughly.

        What it tells is the logarithm of the determinant of the information matrix, of one row on average,
        over twice the unknowns: D-optimality. It does not depend on the units of the unknowns, and is greater
        by 1 where standard errors are smaller by a factor e, on average.
        """
        separable = [slopes for _, slopes in self._separable(block)]
        excess = sum(max(0.0, math.log(_condition(slopes) / CONDITION)) for slopes in separable)
        return sum(map(_logarithm, separable)) / sum(map(len, self._kept)) - excess

    def conditions(self, block: Block) -> dict[str, float]:
        """Condition of each system, its columns divided by their norms, by name."""
        return {name: _condition(slopes) for name, slopes in self._separable(block)}

    def _separable(self, block: Block) -> Iterator[Columns]:
        """The columns of unknowns that some motion tells apart, of systems that have any."""
        for kept, system in zip(self._kept, self._columns(block), strict=True):
            if kept.size:
                yield system._replace(slopes=system.slopes[:, kept])


def _logarithm(slopes: FloatArray) -> float:
    """Of the root of the determinant of the information matrix of one row."""
    return float(np.linalg.slogdet(slopes.T @ slopes / len(slopes)).logabsdet) / 2


def _condition(slopes: FloatArray) -> float:
    norms = np.linalg.norm(slopes, axis=0)
    if not norms.all():
        return np.inf
    return float(np.linalg.cond(slopes / norms))


def exact_signals(block: Block) -> Signals:
    """A motion without noise as a record."""
    motion = {name: getattr(block, name) for name in ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta")}
    return Signals(**motion, tau_motor=block.tau_motor, rate=np.nan, filter=ALL_PASS)
