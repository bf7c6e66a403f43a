"""The largest size of a function of the configuration, over all configurations.

Reach and gravity torques have, in each single joint variable with the others held, a form whose extremes are
known: a + b cos q + c sin q of an angle, and of a length linear or convex, so largest at an end. Maximising
joint after joint therefore never falls and needs no step size; it starts from several random configurations,
because it may end at a maximum that is only local.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

MOST_STARTS = 16
"""Random configurations to start from, for each goal; fewer in long chains."""

MOST_SWEEPS = 50
SETTLED_GAIN = 1e-11
"""Relative gain of a sweep over all joints below which the search ends."""

MOST_EVALUATIONS = 1e7
"""Samples times joints that a search may evaluate; beyond, the random configurations have to do."""

SAMPLES_AT_NO_COST = 300
"""Fewer samples at once cost as much as so many."""

SEED = 0
TURN = 2 * math.pi
_ANGLES = np.array([0, TURN / 3, 2 * TURN / 3])

Objective = Callable[[FloatArray], FloatArray]
"""Configurations (samples, joints) to values of the goals (samples, goals)."""


class Extremes(NamedTuple):
    """Largest size of each goal, (goals,), and a configuration that has it, (goals, joints)."""

    values: FloatArray
    configurations: FloatArray


def free_range(joint: Joint) -> tuple[float, float]:
    """Positions to look at: those within the limits; without any a whole turn, of a prismatic joint zero."""
    low, high = joint.limits.position
    if math.isfinite(low) and math.isfinite(high):
        return low, high
    if not joint.is_revolute:
        return (0.0, 0.0)
    if math.isfinite(low):
        return low, low + TURN
    return (high - TURN, high) if math.isfinite(high) else (-math.pi, math.pi)


def unlimited(joint: Joint) -> bool:
    """Whether the joint is prismatic and may move without end, so that it is held at zero."""
    return not joint.is_revolute and not all(map(math.isfinite, joint.limits.position))


def largest_sizes(objective: Objective, goals: int, robot: Robot) -> Extremes:
    """Maximise the size of each of several goals by itself; NaN if its numbers overflow."""
    with np.errstate(all="ignore"):
        q = _searched(objective, _random(goals, robot), robot)
        sizes = np.abs(_own_values(objective, q))
    best, rows = sizes.argmax(axis=1), np.arange(goals)
    return Extremes(sizes[rows, best], q[rows, best])


def _random(goals: int, robot: Robot) -> FloatArray:
    """Configurations to start from, (goals, starts, joints)."""
    count = len(robot.joints)
    starts = min(MOST_STARTS, max(2, 200 // count))
    low, high = np.array([free_range(joint) for joint in robot.joints]).T
    return np.random.default_rng(SEED).uniform(low, high, (goals, starts, count))


def _searched(objective: Objective, q: FloatArray, robot: Robot) -> FloatArray:
    """The configurations after sweeps over all joints, until nothing is gained."""
    count = len(robot.joints)
    work = max(q[..., 0].size * len(_ANGLES), SAMPLES_AT_NO_COST) * count * count
    before = np.zeros(len(q))
    for _ in range(min(MOST_SWEEPS, int(MOST_EVALUATIONS / work))):
        for index, joint in enumerate(robot.joints):
            best = _best_angle if joint.is_revolute else _best_end
            q[..., index] = best(objective, q, index, np.array(free_range(joint)))
        sizes = np.abs(_own_values(objective, q)).max(axis=1)
        if np.all(sizes - before <= SETTLED_GAIN * sizes):
            break
        before = sizes
    return q


def _own_values(objective: Objective, q: FloatArray) -> FloatArray:
    """Of each goal the values at its own configurations, (..., goals, starts, joints)."""
    everything = objective(q.reshape(-1, q.shape[-1])).reshape(*q.shape[:-1], q.shape[-3])
    own: FloatArray = np.einsum("...gsg->...gs", everything)
    return own


def _at(objective: Objective, q: FloatArray, index: int, positions: FloatArray) -> FloatArray:
    """Values with one joint moved to each of a few positions, (positions, goals, starts)."""
    moved = np.repeat(q[None], len(positions), axis=0)
    moved[..., index] = positions[:, None, None]
    return _own_values(objective, moved)


def _best_end(objective: Objective, q: FloatArray, index: int, ends: FloatArray) -> FloatArray:
    low, high = np.abs(_at(objective, q, index, ends))
    best: FloatArray = np.where(high > low, ends[1], ends[0])
    return best


def _best_angle(objective: Objective, q: FloatArray, index: int, ends: FloatArray) -> FloatArray:
    """Where |a + b cos q + c sin q| is largest between the ends; three values say what it is."""
    thirds = _at(objective, q, index, _ANGLES)
    a = thirds.mean(axis=0)
    b, c = (np.tensordot(wave(_ANGLES), thirds, 1) * 2 / len(_ANGLES) for wave in (np.cos, np.sin))
    peak = np.arctan2(c, b)
    inside = [ends[0] + np.mod(angle - ends[0], TURN) for angle in (peak, peak + math.pi)]
    candidates = np.stack(
        [np.minimum(angle, ends[1]) for angle in inside] + [np.full_like(peak, end) for end in ends]
    )
    sizes = np.abs(a + b * np.cos(candidates) + c * np.sin(candidates))
    best: FloatArray = np.take_along_axis(candidates, sizes.argmax(axis=0)[None], axis=0)[0]
    return best
