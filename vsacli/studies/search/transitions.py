"""The shortest accepted transitions between the levels of a stiffness, by scan and bisection; see `scans`."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import FloatArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.changed_motion import with_stiffness
from vsacli.studies.search.fixed_text import changes_of_steps
from vsacli.studies.search.loads import TaskSamples
from vsacli.studies.search.scans import WATCHED_STEPS, smallest_confirmed
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.curves.steps import PiecewiseProfile, profile_of_levels
from vsacli.trajectory.trajectory import Trajectory

DIGITS = 3
"""Decimal places of a transition after its leading digit: the grid of printed values."""


def has_transitions(trajectory: Trajectory) -> bool:
    """Return whether the stiffness is given as levels with transitions between them."""
    return bool(_transitions_between_levels(trajectory))


def _transitions_between_levels(trajectory: Trajectory) -> list[RestToRest]:
    """Return the transitions between levels; none if the stiffness is another curve."""
    stiffness = trajectory.commanded[STIFFNESS.key]
    return (changes_of_steps(stiffness) or []) if isinstance(stiffness, PiecewiseProfile) else []


def smallest_transition(acceptance: Acceptance, trajectory: Trajectory) -> tuple[float, float, Trajectory]:
    """Return the commanded transition time, the shortest accepted longer one, s, and the trajectory with it.

    Each transition begins as commanded. A scan in strides of 1 % is followed by bisection.

    Args:
        acceptance: acceptance rule, which includes the robot.
        trajectory: trajectory that `has_transitions`.

    Raises:
        ImpossibleError: no transition that ends before the next one begins is accepted.
    """
    candidates = _Transitions(acceptance, trajectory)
    number = smallest_confirmed(candidates, candidates.first, candidates.last)
    if number is None:
        raise ImpossibleError(f"none of up to {candidates.longest:.4g} s does; then the next change begins")
    return candidates.shortest, candidates.length(number), candidates.trajectory(number)


class _Transitions:
    """Transition times on a decimal grid, checked at watched instants; see `Candidates`."""

    def __init__(self, acceptance: Acceptance, trajectory: Trajectory) -> None:
        self._acceptance, self._trajectory, self._changes = (
            acceptance,
            trajectory,
            _transitions_between_levels(trajectory),
        )
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
        """Smallest number that stands for a longer transition."""
        return math.floor(self.shortest / 10.0**self._exponent * (1 + 1e-9)) + 1

    @property
    def last(self) -> int:
        """Number of the longest transition that ends before the next one begins, or the motion ends."""
        return math.floor(self.longest / 10.0**self._exponent * (1 + 1e-9))

    def length(self, number: int) -> float:
        """Return the transition time that a number stands for, s."""
        return min(float(f"{number}e{self._exponent}"), self.longest)

    def trajectory(self, number: int) -> Trajectory:
        """Return the trajectory with the transition time that a number stands for."""
        first, length = self._changes[0], self.length(number)
        levels = [first.start, *(change.end for change in self._changes)]
        spans = [
            (change.span[0], min(change.span[0] + length, limit))
            for change, limit in zip(self._changes, self._limits, strict=True)
        ]
        profile = profile_of_levels(STIFFNESS, (0.0, self._trajectory.duration), first.degree, levels, spans)
        return with_stiffness(self._trajectory, profile)

    def stride(self, number: int) -> int:
        """Return 1 % of the number."""
        return math.ceil(number / 100)

    def accepts(self, number: int) -> bool:
        """See `Candidates.accepts`."""
        return not self._refused(number, self._watched).size

    def confirms(self, number: int) -> bool:
        """See `Candidates.confirms`."""
        refused = self._refused(number, self._steps)
        self._watched = np.union1d(self._watched, refused[evenly(len(refused), WATCHED_STEPS)])
        return not refused.size

    def _refused(self, number: int, elapsed: FloatArray) -> FloatArray:
        part = TaskSamples.between(self.trajectory(number), elapsed)
        return elapsed[np.any(self._acceptance.refused(part), axis=1)]
