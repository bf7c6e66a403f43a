"""A trajectory at any instant, fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import COMMANDED, DAMPING, POSITION
from vsacli.base.wrench import WRENCH_NAMES, Wrench
from vsacli.control.simulation.table import Table
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory


class Reference:
    """What a trajectory commands, and the wrench that acts meanwhile, as functions of time.

    A time gives arrays (joints,), times (samples,) give arrays (samples, joints).

    Attributes:
        frame: of the wrench, None if there is none.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self.frame = None if trajectory.wrench is None else trajectory.wrench.frame
        signals = (POSITION, *(COMMANDED[key] for key in trajectory.commanded))
        self._commands = _tabulated(trajectory, [name for signal in signals for name in signal.names])
        self._wrench = _tabulated(trajectory, WRENCH_NAMES) if self.frame else None
        damped = DAMPING.key in trajectory.commanded
        self._damping = _tabulated(trajectory, DAMPING.names) if damped else None

    def __call__(self, time: float | FloatArray) -> Motion:
        """Motion, stiffness and wrench."""
        return Motion.of(np.asarray(time), self._commands(time), self.wrench(time))

    def damping(self, time: float | FloatArray) -> dict[str, FloatArray]:
        """The damping with its derivatives, by name; nothing if none is commanded."""
        return {} if self._damping is None else self._damping(time)

    def wrench(self, time: float | FloatArray) -> Wrench | None:
        """The wrench alone."""
        return None if self._wrench is None else Wrench(**self._wrench(time), frame=self.frame or "")


def _tabulated(
    trajectory: Trajectory, names: Sequence[str]
) -> Callable[[float | FloatArray], dict[str, FloatArray]]:
    """Variables of the motion by name, as functions of time."""

    def columns(time: FloatArray) -> FloatArray:
        variables = trajectory.at(time).variables()
        return np.concatenate([variables[name] for name in names], axis=1)

    table = Table.of(columns, trajectory.breakpoints)
    width = table.columns // len(names)
    parts = [slice(start, start + width) for start in range(0, table.columns, width)]

    def arrays(time: float | FloatArray) -> dict[str, FloatArray]:
        values = table(time)
        return {name: values[..., part] for name, part in zip(names, parts, strict=True)}

    return arrays
