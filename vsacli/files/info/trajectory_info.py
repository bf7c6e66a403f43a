"""A trajectory: how long, how many samples, and between which values each joint moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES
from vsacli.trajectory.curves import POSITION, STIFFNESS
from vsacli.trajectory.trajectory import Trajectory

BLOCK = 8192
SIGNALS = (*POSITION.names, *STIFFNESS.names)


def describe_trajectory(trajectory: Trajectory, joint_names: Sequence[str]) -> dict[str, Any]:
    """A trajectory as JSON values: times, and of each joint the range and the peak of each quantity.

    `min`, `max` and `peak`, the largest absolute value, are those at the steps. What a joint does not have,
    such as the stiffness of a rigid one, is NaN.
    """
    ranges = _Ranges()
    for start in range(0, trajectory.samples, BLOCK):
        motion = trajectory.block(start, start + BLOCK)
        ranges.take(motion.variables())
    description: dict[str, Any] = {
        "kind": "trajectory",
        "name": trajectory.name,
        "duration": trajectory.duration,
        "samples": trajectory.samples,
        "start": trajectory.times.span[0],
        "joints": [
            {"name": joint, **{name: ranges.of(name, index) for name in SIGNALS}}
            for index, joint in enumerate(joint_names)
        ],
        "warnings": list(trajectory.warnings),
        "notes": list(trajectory.notes),
    }
    if trajectory.wrench is not None:
        axes = {axis: _axis(ranges, index) for index, axis in enumerate(WRENCH_AXES)}
        description["wrench"] = {"frame": trajectory.wrench.frame, **axes}
    return description


def _axis(ranges: _Ranges, index: int) -> dict[str, Any]:
    return {name: ranges.of(name, index) for name in WRENCH_NAMES}


class _Ranges:
    """Smallest and largest value of quantities, (columns,), over the blocks taken so far."""

    def __init__(self) -> None:
        self._low: dict[str, FloatArray] = {}
        self._high: dict[str, FloatArray] = {}

    def take(self, block: dict[str, FloatArray]) -> None:
        for name, values in block.items():
            low, high = values.min(axis=0), values.max(axis=0)
            self._low[name] = np.minimum(low, self._low.get(name, low))
            self._high[name] = np.maximum(high, self._high.get(name, high))

    def of(self, name: str, column: int) -> dict[str, float]:
        low, high = float(self._low[name][column]), float(self._high[name][column])
        return {"min": low, "max": high, "peak": max(abs(low), abs(high))}
