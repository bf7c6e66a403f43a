"""The stiffness that joints require at a few samples of a task, at any factor of its slow-down.

Many factors are evaluated in one call, which costs hardly more than a single one.
"""

from __future__ import annotations

import math
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.robot.joint import Joint
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, Range, admissible_stiffness
from vsacli.studies.search.cutting_planes import smallest_offset
from vsacli.studies.search.fix_report import branch_path
from vsacli.studies.search.loads import Instants, Load, TaskSamples, concatenate_task_samples
from vsacli.studies.search.path_commands import PathCommands, Speeds

FEW = 100
"""Number of samples with which a search begins, and the most that a check at all samples adds."""

SAME_RANGE = 1e-6
"""Relative difference up to which the ends of attainable ranges are equal but for rounding."""


class Required(NamedTuple):
    """The stiffness that a joint requires at samples, slowed down by several factors.

    Attributes:
        joint: joint, perhaps on the other branch.
        load: load at all samples with the first factor, then with the next.
        asked: commanded stiffness, (factors, samples).
        refused: whether any sample is refused with this stiffness, (factors,).
        admissible: admissible stiffness, (factors, samples); none where the path is too fast.
    """

    joint: Joint
    load: Load
    asked: FloatArray
    refused: BoolArray
    admissible: Range


class FewSamples:
    """A few samples of a task, with the stiffness that they require at any factor of the slow-down.

    Args:
        acceptance: acceptance rule.
        samples: unchanged samples.
        impossible: joints by index, branch and factor that no constant fixes; also valid with further samples
            or a stricter rule. More are added. They save half of the time where motors have limits.
    """

    def __init__(
        self, acceptance: Acceptance, samples: TaskSamples, impossible: set[tuple[int, str, float]]
    ) -> None:
        self._acceptance, self.samples, self._impossible = acceptance, samples, impossible
        self._path = PathCommands(acceptance.robot, samples.motion)
        self._loads, self.required = cache(self._compute_loads), cache(self._compute_required)
        self._constants: dict[tuple[int, str, float], float] = {}

    def with_further(self, samples: TaskSamples) -> FewSamples:
        """Return these samples with further ones."""
        together = concatenate_task_samples([self.samples, samples])
        return FewSamples(self._acceptance, together, self._impossible)

    @cached_property
    def branches(self) -> list[dict[str, Joint]]:
        """The joints by branch, "" for the unchanged one; the other branch only where it differs."""
        robot = self._acceptance.robot
        choices = [{"": joint} for joint in robot.joints]
        for index, (joint, load) in enumerate(zip(robot.joints, self._loads((1.0,)), strict=True)):
            branch = joint.actuator.opposite_branch
            if branch is not None:
                exchanged = robot.replace(branch_path(robot, index), branch).joints[index]
                if not _mirror_images(joint.actuator, exchanged.actuator, load.command):
                    choices[index][branch] = exchanged
        return choices

    def _compute_loads(self, factors: tuple[float, ...]) -> list[Load]:
        """Return the load of each joint at all samples with the first factor, then with the next."""
        time, count = self.samples.motion.time, len(self.samples.motion.time)
        factor = np.repeat(factors, count)
        instants = Instants(np.tile(time, len(factors)), factor)
        commands = self._path.at(Speeds.even(factor), np.tile(np.arange(count), len(factors)))
        return [Load(instants.time, command, instants) for command in commands]

    def _compute_required(self, index: int, branch: str, factors: tuple[float, ...]) -> Required:
        """Return the stiffness that a joint on a branch requires."""
        joint = self.branches[index][branch] if branch else self._acceptance.robot.joints[index]
        load, shape = self._loads(factors)[index], (len(factors), -1)
        asked = load.command.commanded.get(STIFFNESS.key, np.zeros_like(load.time))
        refused = np.any(self._acceptance.refused_steps(joint, load).reshape(shape), axis=1)
        admissible = Range(*np.full((2, len(asked)), np.nan))
        if refused.any() and STIFFNESS.key in joint.actuator.commanded:
            admissible = admissible_stiffness(joint, load.command, self._acceptance.min_margin)
            admissible.low[self._acceptance.beyond_path(joint, load)] = np.nan
        ranges = Range(*(end.reshape(shape) for end in admissible))
        return Required(joint, load, asked.reshape(shape), refused, ranges)

    def constant(self, index: int, branch: str, factors: tuple[float, ...], place: int) -> float:
        """Return the smallest constant that fixes a joint at one of the factors; infinite if none does."""
        key, count = (index, branch, factors[place]), len(self.samples.factor)
        if key not in self._constants and key not in self._impossible:
            required = self.required(index, branch, factors)
            load = required.load.at(slice(place * count, (place + 1) * count))
            try:
                self._constants[key] = smallest_offset(self._acceptance, required.joint, load)
            except ImpossibleError:
                self._impossible.add(key)
        return self._constants.get(key, math.inf)


def _mirror_images(one: Actuator, other: Actuator, command: Command) -> bool:
    """Return whether the branches of an actuator are mirror images, as those of equal springs are."""
    if len(set(one.motors)) > 1 or len(set(one.max_deflections)) > 1:
        return False
    asked = command.tau_e, command.commanded["stiffness"], command.q
    first, second = one.solve(*asked), other.solve(*asked)
    pairs = (first.lower, second.lower), (first.upper, second.upper)
    return all(np.allclose(here, there, rtol=SAME_RANGE, equal_nan=True) for here, there in pairs)
