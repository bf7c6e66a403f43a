"""Motions at some steps of a trajectory, slower or with another stiffness."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.dynamics.inverse import usual_block
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory


def slowed(motion: Motion, factor: float) -> Motion:
    """A motion passed more slowly, at rest if the factor is infinite; their times are kept."""
    return motion.mapped(motion.time, lambda array, order: array / factor**order)


def stiffened(motion: Motion, change: FloatArray) -> Motion:
    """A motion with something added to the stiffness of each joint, (joints,) N m/rad (N/m)."""
    arrays = motion.of_joints
    return Motion.of(motion.time, {**arrays, STIFFNESS.key: arrays[STIFFNESS.key] + change}, motion.wrench)


def evenly_chosen(trajectory: Trajectory, steps: int) -> Motion:
    """At most so many steps of a trajectory, both ends included."""
    chosen = evenly(trajectory.samples, steps)
    samples = usual_block(trajectory.joints)
    return joined(
        select(trajectory.block(start, start + samples), inside - start)
        for start in range(0, trajectory.samples, samples)
        if (inside := chosen[(start <= chosen) & (chosen < start + samples)]).size
    )


def select(motion: Motion, steps: IndexArray) -> Motion:
    """Some steps of a motion, by index."""
    return motion.mapped(motion.time[steps], lambda array, _: array[steps])


def joined(motions: Iterable[Motion]) -> Motion:
    """The steps of several motions, one motion after the other."""
    parts = list(motions)
    variables = [part.variables() for part in parts]
    arrays = {name: np.concatenate([each[name] for each in variables]) for name in variables[0]}
    last = parts[-1].wrench
    wrench = last and Wrench(*(arrays[name] for name in WRENCH_NAMES), frame=last.frame)
    return Motion.of(arrays["time"], arrays, wrench)
