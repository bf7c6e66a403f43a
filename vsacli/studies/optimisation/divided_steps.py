"""A trajectory whose samples, read back from a file, are the same function of time between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.trajectory.curves import ClosedForm
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.recorded.even_stamps import elapsed_times
from vsacli.trajectory.recorded.hermite import HermiteSpline, belong_together
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

PARTS = (1, 2, 4, 8, 16)
"""Parts into which steps are divided, one after the other. A reader takes samples with all derivatives for
one function if the highest one is nearly a line between samples; pieces of one step take eight parts."""


def as_one_function(trajectory: Trajectory) -> Trajectory:
    """Return a trajectory with its steps divided, if they have to be so that a file describes it.

    Where a signal comes from a fit, or is not known between its samples, steps stay as they are.
    """
    if trajectory.estimates or not trajectory.known_between:
        return trajectory
    divided = (trajectory if parts == 1 else _divided(trajectory, parts) for parts in PARTS)
    return next((each for each in divided if reads_back(each)), trajectory)


def reads_back(trajectory: Trajectory) -> bool:
    """Return whether all signals that are recorded at the steps are taken for one function by a reader."""
    return all(
        belong_together(profile.time, profile.rows)
        for _, profile in _profiles(trajectory)
        if isinstance(profile, HermiteSpline)
    )


def _profiles(trajectory: Trajectory) -> Iterator[tuple[Signal, Profile]]:
    yield POSITION, trajectory.position
    yield from ((COMMANDED[key], profile) for key, profile in trajectory.commanded.items())
    if trajectory.wrench is not None:
        yield WRENCH, trajectory.wrench.profile


def _divided(trajectory: Trajectory, parts: int) -> Trajectory:
    """The same functions at more steps; formulas stay formulas."""
    steps = trajectory.times.block(0, trajectory.samples)
    shares = np.arange(parts) / parts
    time = np.append((steps[:-1, None] + np.diff(steps)[:, None] * shares).ravel(), steps[-1])
    elapsed = elapsed_times(time)

    def recorded(signal: Signal, profile: Profile) -> Profile:
        if isinstance(profile, ClosedForm):
            return profile
        return HermiteSpline(signal=signal, time=elapsed, rows=profile.at(elapsed))

    wrench = trajectory.wrench
    return Trajectory(
        RecordedTimes(time),
        recorded(POSITION, trajectory.position),
        {key: recorded(COMMANDED[key], profile) for key, profile in trajectory.commanded.items()},
        wrench=wrench and replace(wrench, profile=recorded(WRENCH, wrench.profile)),
        name=trajectory.name,
    )
