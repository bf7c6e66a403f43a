"""How the time of the recursion grows with joints and samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from subjects import chain, motion, seven_joints
from timing import cpu_seconds, medians

from vsacli.dynamics.elastic_torques import link_torques
from vsacli.robot.model import Robot

JOINTS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
SAMPLES = (1, 10, 100, 1_000, 10_000, 100_000, 1_000_000)
SAMPLES_OF_CHAIN = 512
"""Samples at which the chains are compared: one block of the same size whatever their length."""


class Growth(NamedTuple):
    """Seconds over joints and over samples."""

    by_joints: dict[int, float]
    by_samples: dict[int, float]

    @property
    def spread(self) -> float:
        """Largest over smallest cost of a joint and sample, from 10 joints on, less 1."""
        each = [seconds / joints for joints, seconds in self.by_joints.items() if joints >= 10]
        return max(each) / min(each) - 1


def measure(repeats: int) -> Growth:
    """Time chains of each length at a fixed number of samples, and the 7R arm at each number of samples."""
    arm = seven_joints()
    chains = {joints: _recursion(chain(joints), SAMPLES_OF_CHAIN, max(1, 100 // joints)) for joints in JOINTS}
    arms = {samples: _recursion(arm, samples, max(1, 2_000 // samples)) for samples in SAMPLES}
    turns = 4 * repeats  # short ones, so that every length meets the machine's slow seconds
    return Growth(_by_number(chains, turns), _by_number(arms, repeats))


def _recursion(robot: Robot, samples: int, rounds: int) -> Callable[[], float]:
    moving = motion(len(robot.joints), samples)
    return cpu_seconds(lambda: link_torques(robot, *moving), rounds)


def _by_number(ways: Mapping[int, Callable[[], float]], repeats: int) -> dict[int, float]:
    seconds = medians({str(number): way for number, way in ways.items()}, repeats)
    return {int(number): taken for number, taken in seconds.items()}


def draw(growth: Growth, path: Path) -> None:
    """Both curves, as cost of a joint and sample."""
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    joints, samples = np.array(JOINTS), np.array(SAMPLES)
    cost = np.array(list(growth.by_joints.values())) / joints / SAMPLES_OF_CHAIN
    left.semilogx(joints, cost * 1e6, "o-")
    left.set(xlabel="joints", ylabel="µs per joint and sample", title=f"{SAMPLES_OF_CHAIN} samples")
    left.set_ylim(bottom=0)
    right.loglog(samples, np.array(list(growth.by_samples.values())) / samples * 1e6, "o-")
    right.set(xlabel="samples", ylabel="µs per sample", title="7R arm")
    for axes in (left, right):
        axes.grid(visible=True, which="major", alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
