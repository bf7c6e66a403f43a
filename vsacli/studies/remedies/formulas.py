"""How profiles in closed form are declared in a trajectory file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from vsacli.base.signals import POSITION
from vsacli.trajectory.curves import ClosedForm, Constant, RestToRest
from vsacli.trajectory.curves.piecewise import Chain
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.curves.via_points import ViaPoints
from vsacli.trajectory.profile import Profile

SAME_TRANSITION = 1e-9
"""Largest relative difference of transitions that are rounded differently."""


def formula(profile: Profile) -> dict[str, Any] | None:
    """The keys and values that declare a profile over its span; None if there is no formula of it."""
    match profile:
        case RestToRest(degree=degree, start=start, end=end):
            return {"type": "polynomial", "degree": degree, "start": _values(start), "end": _values(end)}
        case Constant(value=value):
            return {"type": "constant", "value": _values(value)}
        case ViaPoints(degree=degree, points=points, breakpoints=passed):
            times = (passed - passed[0]).tolist()
            return {"type": "via", "degree": degree, "points": list(map(_values, points)), "times": times}
        case Sinusoids():
            return _sinusoids(profile)
        case Chain():
            return _sequence(profile) if profile.signal is POSITION else _steps(profile)
    return None


def _sinusoids(profile: Sinusoids) -> dict[str, Any]:
    amplitudes = {"sine": list(map(_values, profile.sine)), "cosine": list(map(_values, profile.cosine))}
    return {
        "type": "sinusoids",
        "frequency": profile.cycles / _duration(profile),
        "offset": _values(profile.offset),
        **{name: harmonics for name, harmonics in amplitudes.items() if harmonics},
        "ramp": profile.ramp * _duration(profile),
    }


def _sequence(chain: Chain) -> dict[str, Any] | None:
    """A motion in parts, each with its duration; where it stands still it dwells."""
    parts = []
    for part in chain.parts:
        declared = formula(part)
        if declared is None:
            return None
        if isinstance(part, Constant):
            declared = {"type": "dwell"}
        parts.append(declared if "times" in declared else {**declared, "duration": _duration(part)})
    return {"type": "sequence", "parts": parts}


def changes_of_steps(chain: Chain) -> list[RestToRest] | None:
    """The changes between levels that last equally long; None if the parts are something else."""
    changes = [part for part in chain.parts if isinstance(part, RestToRest)]
    held = [part for part in chain.parts if isinstance(part, Constant)]
    durations = list(map(_duration, changes))
    if len(changes) + len(held) < len(chain.parts) or not changes:
        return None
    if len({change.degree for change in changes}) > 1 or not math.isclose(
        min(durations), max(durations), rel_tol=SAME_TRANSITION
    ):
        return None
    return changes


def _steps(chain: Chain) -> dict[str, Any] | None:
    """Levels with changes between them."""
    changes = changes_of_steps(chain)
    if changes is None:
        return None
    return {
        "type": "steps",
        "degree": changes[0].degree,
        "levels": [_values(changes[0].start), *(_values(change.end) for change in changes)],
        "times": [change.span[0] - chain.span[0] for change in changes],
        "transition": min(map(_duration, changes)),
    }


def _duration(profile: ClosedForm) -> float:
    first, last = profile.span
    return last - first


def _values(values: Sequence[float]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values]
