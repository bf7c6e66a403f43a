"""A trajectory at any instant, fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.control.simulation.tabulated import tabulate
from vsacli.trajectory.curves import POSITION, STIFFNESS
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

COMMANDS = (*POSITION.names, *STIFFNESS.names)


class Reference:
    """What a trajectory commands, and the wrench that acts meanwhile, as functions of time.

    A time gives arrays (joints,), times (samples,) give arrays (samples, joints).

    Attributes:
        frame: of the wrench, None if there is none.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self.frame = None if trajectory.wrench is None else trajectory.wrench.frame
        self._commands = _tabulated(trajectory, lambda motion: motion, COMMANDS)
        self._wrench = (
            _tabulated(trajectory, lambda motion: motion.wrench, WRENCH_NAMES) if self.frame else None
        )

    def __call__(self, time: float | FloatArray) -> Motion:
        """Motion, stiffness and wrench."""
        return Motion(np.asarray(time), *self._commands(time), wrench=self.wrench(time))

    def wrench(self, time: float | FloatArray) -> Wrench | None:
        """The wrench alone."""
        return None if self._wrench is None else Wrench(*self._wrench(time), frame=self.frame or "")


def _tabulated(
    trajectory: Trajectory, part: Callable[[Motion], Any], names: Sequence[str]
) -> Callable[[float | FloatArray], Sequence[FloatArray]]:
    """Arrays of these names of a part of the motion, as functions of time."""

    def columns(time: FloatArray) -> FloatArray:
        source = part(trajectory.at(time))
        return np.concatenate([getattr(source, name) for name in names], axis=1)

    table = tabulate(columns, trajectory.breakpoints)
    width = table.c.shape[-1] // len(names)
    parts = [slice(start, start + width) for start in range(0, table.c.shape[-1], width)]

    def arrays(time: float | FloatArray) -> Sequence[FloatArray]:
        values = table(time)
        return [values[..., part] for part in parts]

    return arrays
