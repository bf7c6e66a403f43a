"""A scale that was measured, or computed elsewhere: a spline through the rows of a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsacli.actuators.mechanisms.ratios.scales import Scale, ScaleLaw
from vsacli.base.arrays import FloatArray
from vsacli.compute.control_flow import look_up
from vsacli.documents.fields import TableFile, value
from vsacli.documents.source import Source
from vsacli.documents.table import Table

MIN_ROWS = 4
"""A cubic needs four."""


@dataclass(frozen=True)
class MeasuredScale(ScaleLaw):
    """The cubic spline through settings and scales; it must rise or fall throughout, noise must not show."""

    file: Table = value(
        TableFile(("setting", "scale")),
        "CSV file with the header setting,scale, theta_2 in rad (m), path relative to the robot file",
    )

    @property
    def sources(self) -> tuple[Source, ...]:
        """The table."""
        return (self.file.source,)

    @cached_property
    def _pieces(self) -> tuple[FloatArray, ...]:
        """Where each cubic begins, and its coefficients from the constant on, arrays (pieces,)."""
        from scipy.interpolate import CubicSpline

        settings, scales = self.file.values.T
        return (settings[:-1], *CubicSpline(settings, scales).c[::-1])

    def at(self, s: FloatArray) -> Scale:
        """The spline with its derivatives."""
        piece = np.searchsorted(self._pieces[0][1:], s, side="right")
        start, a, b, c, d = look_up(self._pieces, piece)
        x = s - start
        return Scale(a + x * (b + x * (c + x * d)), b + x * (2 * c + x * (3 * d)), 2 * c + 6 * d * x)

    def problems(self, settings: tuple[float, float]) -> Iterator[str]:
        """A table that is too short or does not reach so far, too."""
        rows = self.file.values[:, 0]
        if len(rows) < MIN_ROWS or not (np.diff(rows) > 0).all():
            yield f"the table needs {MIN_ROWS} rows or more, whose settings increase"
        elif settings[0] < rows[0] or rows[-1] < settings[1]:
            yield f"the table goes from {rows[0]:g} to {rows[-1]:g}, `setting` farther"
        else:
            yield from super().problems(settings)
