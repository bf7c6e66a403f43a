"""A profile that does not change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.curves.closed_form import ClosedForm


@dataclass(frozen=True, kw_only=True)
class Constant(ClosedForm):
    """The same `value`, one number a component, all the time."""

    value: tuple[float, ...]

    @property
    def components(self) -> int:
        """Number of components: one a joint, or six of a wrench."""
        return len(self.value)

    def at(self, time: FloatArray) -> FloatArray:
        """Value and derivatives at any times of the span, shape (orders, components, samples)."""
        rows = np.zeros((self.signal.orders, self.components, len(time)))
        rows[0] = np.array(self.value)[:, None]
        return rows
