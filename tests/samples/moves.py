"""Trajectories whose signals go from rest to rest."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli import Trajectory
from vsacli.base.signals import COMMANDED, POSITION, Signal
from vsacli.trajectory.curves import ConstantProfile, RestToRest
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.times import UniformTimes

Ends = tuple[Sequence[float], Sequence[float]]
"""Values of each joint at the start and at the end."""


def move(
    duration: float,
    rate: float,
    position: Ends,
    *,
    degrees: tuple[int, int] = (7, 3),
    wrench: WrenchProfile | None = None,
    name: str = "move",
    **commanded: Ends,
) -> Trajectory:
    """Polynomials with the degree of positions and that of commanded signals; constants if ends are equal."""

    def profile(signal: Signal, ends: Ends, degree: int) -> ConstantProfile | RestToRest:
        start, end = (tuple(map(float, values)) for values in ends)
        if start == end:
            return ConstantProfile(signal=signal, span=(0.0, duration), value=start)
        return RestToRest(signal=signal, span=(0.0, duration), degree=degree, start=start, end=end)

    of_position, of_commanded = degrees
    return Trajectory(
        UniformTimes(duration, rate),
        profile(POSITION, position, of_position),
        {key: profile(COMMANDED[key], ends, of_commanded) for key, ends in commanded.items()},
        wrench=wrench,
        name=name,
    )
