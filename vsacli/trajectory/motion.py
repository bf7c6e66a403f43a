"""Commanded motion over a block of samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import POSITION, commanded_names, orders_of_derivation
from vsacli.base.wrench import WRENCH_NAMES, Wrench


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion and commanded signals over a block of times.

    Attributes:
        time: (samples,) in s.
        q, dq, ddq, d3q, d4q: position and its four derivatives, (samples, joints), rad (m) per s^k.
        commanded: signals of `COMMANDED` and their derivatives by name, e.g. `dstiffness`, (samples, joints);
            NaN for a joint without this command.
        wrench: wrench of the environment on the tools; None without one.
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    d3q: FloatArray
    d4q: FloatArray
    commanded: Mapping[str, FloatArray]
    wrench: Wrench | None = field(default=None, kw_only=True)

    @classmethod
    def of(cls, time: FloatArray, arrays: Mapping[str, FloatArray], wrench: Wrench | None = None) -> Motion:
        """Return the motion from arrays by the names of result variables; other arrays are ignored."""
        q, dq, ddq, d3q, d4q = (arrays[name] for name in POSITION.names)
        commanded = {name: arrays[name] for name in commanded_names() if name in arrays}
        return cls(time, q, dq, ddq, d3q, d4q, commanded, wrench=wrench)

    @property
    def of_joints(self) -> dict[str, FloatArray]:
        """Arrays of the joints by the names of result variables."""
        return {**{name: getattr(self, name) for name in POSITION.names}, **self.commanded}

    def variables(self) -> dict[str, FloatArray]:
        """Return all arrays by the names of result variables."""
        arrays = {"time": self.time, **self.of_joints}
        if self.wrench is not None:
            arrays |= {name: getattr(self.wrench, name) for name in WRENCH_NAMES}
        return arrays

    def mapped(self, time: FloatArray, function: Callable[[FloatArray, int], FloatArray]) -> Motion:
        """Return the motion at other times, with each array replaced by `function(array, order)`."""
        orders = orders_of_derivation()
        arrays = {name: function(array, orders[name]) for name, array in self.of_joints.items()}
        return Motion.of(time, arrays, self.wrench and self.wrench.mapped(function))
