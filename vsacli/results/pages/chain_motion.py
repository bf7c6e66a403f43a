"""The robot as a chain that moves: where its frames are at each of some instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import evenly
from vsacli.base.json_records import Published
from vsacli.base.simulation_variables import actual
from vsacli.results.pages.packing import Packed
from vsacli.results.store.reader import StoredResult
from vsacli.robot.kinematics import frames_in_base

MOST_FRAMES = 1000
"""Instants that a page holds; a screen shows 60 a second, and between them positions are interpolated."""


@dataclass(frozen=True)
class ChainMotion(Published):
    """Points in the base frame, m, by the numbers of packed arrays.

    Attributes:
        time: (instants,), s after the start of the page.
        origins: of DH frames 0 to N and of the end effector, (instants, joints + 2, 3).
        elbows: where the common normal of two axes meets the first, (instants, joints, 3): from the frame
            before, along its z axis, to there reaches the offset d, and from there to the next frame a.
        axes: unit vectors along the axes of the joints, (instants, joints, 3).
    """

    time: int
    origins: int
    elbows: int
    axes: int


def chain_motion(result: StoredResult, start: float, packed: Packed) -> ChainMotion | None:
    """How the chain of a file moves, as far as its positions are known; None if they are not.

    Args:
        result: the file.
        start: time from which the page counts, s.
        packed: what holds the arrays.
    """
    name = next((each for each in (actual("q"), "q") if each in result.variables), None)
    if name is None:
        return None
    steps = evenly(result.samples, MOST_FRAMES)
    geometry = result.geometry()
    positions = np.asarray(result.read(name), dtype=np.float64)[steps]
    with np.errstate(over="ignore", invalid="ignore"):  # of a simulation that diverged
        frames = list(frames_in_base(geometry, positions))
    origins = np.stack([frame.origin for frame in frames], axis=1)
    lengths = np.array([joint.dh.a for joint in geometry.joints])
    normals = np.stack([frame.axes[..., 0] for frame in frames[1:-1]], axis=1)
    axes = np.stack([frame.axes[..., 2] for frame in frames[:-2]], axis=1)
    return ChainMotion(
        time=packed.add(result.time[steps] - start),
        origins=packed.add(origins),
        elbows=packed.add(origins[:, 1:-1] - lengths[:, None] * normals),
        axes=packed.add(axes),
    )
