"""Commanded motion of a block of steps: what every trajectory yields and the pipeline consumes."""

from __future__ import annotations

from dataclasses import dataclass, field

from vsacli.base.arrays import FloatArray
from vsacli.base.wrench import WRENCH_NAMES, Wrench


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion and stiffness over a block of times.

    Attributes:
        time: (samples,) in s.
        q, dq, ddq, d3q, d4q: position and its four derivatives, (samples, joints), rad (m) per s^k.
        stiffness, dstiffness, ddstiffness: joint stiffness and two derivatives, (samples, joints),
            N m/rad (N/m) per s^k; NaN for a joint for which none is chosen.
        wrench: what the environment exerts on the end effector meanwhile, if anything.
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    d3q: FloatArray
    d4q: FloatArray
    stiffness: FloatArray
    dstiffness: FloatArray
    ddstiffness: FloatArray
    wrench: Wrench | None = field(default=None, kw_only=True)

    def variables(self) -> dict[str, FloatArray]:
        """All arrays by the names of result variables."""
        arrays = {name: array for name, array in vars(self).items() if name != "wrench"}
        if self.wrench is not None:
            arrays |= {name: getattr(self.wrench, name) for name in WRENCH_NAMES}
        return arrays
