"""The shortest longer transitions between levels of stiffness with which every step is accepted."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import FloatArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, smallest_confirmed
from vsacli.studies.remedies.changed_stiffness import with_stiffness
from vsacli.studies.remedies.formulas import changes_of_steps
from vsacli.studies.remedies.motions import Passage
from vsacli.studies.remedies.slow_down import WATCHED_STEPS
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.curves.piecewise import Chain, stepwise
from vsacli.trajectory.trajectory import Trajectory

DIGITS = 3
"""Decimal places of a transition behind its leading digit, so that the printed one is the confirmed one."""


def has_transitions(trajectory: Trajectory) -> bool:
    """Whether the stiffness is given by levels with transitions between them."""
    return bool(_changes(trajectory))


def _changes(trajectory: Trajectory) -> list[RestToRest]:
    """The changes from level to level, none if the stiffness is something else."""
    stiffness = trajectory.commanded[STIFFNESS.key]
    return (changes_of_steps(stiffness) or []) if isinstance(stiffness, Chain) else []


def smallest_transition(acceptance: Acceptance, trajectory: Trajectory) -> tuple[float, float, Trajectory]:
    """The transition as commanded, the shortest longer one that is accepted, and the trajectory with it.

    Each change of level begins when it did. It is found by a scan in steps of 1 %, then bisection.

    Args:
        acceptance: the rule, and the robot.
        trajectory: one that `has_transitions`.

    Raises:
        ImpossibleError: no transition that ends in time is accepted.
    """
    candidates = _Transitions(acceptance, trajectory)
    number = smallest_confirmed(candidates, candidates.first, candidates.last)
    if number is None:
        raise ImpossibleError(f"none of up to {candidates.longest:.4g} s does; then the next change begins")
    return candidates.shortest, candidates.length(number), candidates.trajectory(number)


class _Transitions:
    """Transitions on a decimal grid, judged at watched instants; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, trajectory: Trajectory) -> None:
        self._acceptance, self._trajectory, self._changes = acceptance, trajectory, _changes(trajectory)
        self._limits = [*(change.span[0] for change in self._changes[1:]), trajectory.duration]
        self.shortest = min(change.span[1] - change.span[0] for change in self._changes)
        self.longest = min(
            limit - change.span[0] for change, limit in zip(self._changes, self._limits, strict=True)
        )
        self._exponent = math.floor(math.log10(self.shortest)) - DIGITS
        self._steps = trajectory.times.block(0, trajectory.samples) - trajectory.start
        watched = self._steps[evenly(len(self._steps), WATCHED_STEPS)]
        self._watched = np.union1d(watched, acceptance.between)

    @property
    def first(self) -> int:
        """The first number that stands for a longer transition."""
        return math.floor(self.shortest / 10.0**self._exponent * (1 + 1e-9)) + 1

    @property
    def last(self) -> int:
        """The number of the longest transition that ends before the next change, or the motion."""
        return math.floor(self.longest / 10.0**self._exponent * (1 + 1e-9))

    def length(self, number: int) -> float:
        """The transition that a number stands for, s."""
        return min(float(f"{number}e{self._exponent}"), self.longest)

    def trajectory(self, number: int) -> Trajectory:
        """The trajectory with transitions of that length."""
        first, length = self._changes[0], self.length(number)
        levels = [first.start, *(change.end for change in self._changes)]
        spans = [
            (change.span[0], min(change.span[0] + length, limit))
            for change, limit in zip(self._changes, self._limits, strict=True)
        ]
        profile = stepwise(STIFFNESS, (0.0, self._trajectory.duration), first.degree, levels, spans)
        return with_stiffness(self._trajectory, profile)

    def stride(self, number: int) -> int:
        """One percent."""
        return math.ceil(number / 100)

    def accepts(self, number: int) -> bool:
        """Whether every watched instant is accepted."""
        return not self._refused(number, self._watched).size

    def confirms(self, number: int) -> bool:
        """Whether every step is accepted; steps that are not are watched from now on."""
        refused = self._refused(number, self._steps)
        self._watched = np.union1d(self._watched, refused[evenly(len(refused), WATCHED_STEPS)])
        return not refused.size

    def _refused(self, number: int, elapsed: FloatArray) -> FloatArray:
        passage = Passage.between(self.trajectory(number), elapsed)
        return elapsed[np.any(self._acceptance.refused(passage), axis=1)]
