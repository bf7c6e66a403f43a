"""A cam whose profile is given by points: MACCEPA 2.0, DLR VS-Joint and QA-Joint."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.actuators.laws.table import SHAPE_TOLERANCE, misfit_warnings, worst_misfit, wrong_rows
from vsacli.actuators.mechanisms.preloaded_cams.lift import Lift
from vsacli.actuators.mechanisms.preloaded_cams.preloaded_cam import PreloadedCam
from vsacli.actuators.mechanisms.preloaded_cams.profile import Profile, fit_profile
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.documents.fields import TableFile, value
from vsacli.documents.source import Source
from vsacli.documents.table import Table

LARGEST_MISFIT = 0.03
"""Share of the range of the lift by which a curve may miss a point; beyond, it is that of another cam."""


@dataclass(frozen=True)
class Cam(PreloadedCam):
    """A spring that the lift of a cam compresses, over its deflection as measured or designed.

    A smooth curve with one minimum, where the lift counts from, is fitted through the points and ends there.
    """

    profile: Table = value(
        TableFile(("deflection", "lift")),
        "CSV file with the header deflection,lift in rad,m (m,m), path relative to the robot file",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        problems = list(_problems(self.profile)) or list(self._misfits())
        if problems:
            raise InputError(problems)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:  # noqa: ARG003
        """The cam of the example that comes along."""
        return {"k": 40000, "r": 0.005, "pretension": [0.001, 0.02], "profile": "cam_profile.csv"}

    @cached_property
    def _fitted(self) -> Profile:
        return fit_profile(*self.profile.values.T)

    def _misfits(self) -> Iterator[Problem]:
        """The point that the fitted curve misses most, if it is that of another cam."""
        row, share = worst_misfit(self.profile, self._fitted.misfit)
        if share > LARGEST_MISFIT:
            missed = f"misses the lift {self.profile.values[row, 1]:.4g} by {100 * share:.2g} % of its range"
            message = (
                f"a smooth profile {missed}, more than {100 * LARGEST_MISFIT:g} %: there is a kink or"
                " an outlier nearby, or rows are too few"
            )
            yield Problem(self.profile.source.path, self.profile.line_of(row), message)

    @property
    def warnings(self) -> tuple[str, ...]:
        """How well the curve fits."""
        return misfit_warnings(self.profile, self._fitted.misfit)

    @property
    def sources(self) -> tuple[Source, ...]:
        """The profile."""
        return (self.profile.source,)

    @property
    def rest(self) -> float:
        """Where the fitted curve has its minimum."""
        return self._fitted.rest

    @property
    def deflection_range(self) -> tuple[float, float]:
        """That of the points."""
        return float(self.profile.values[0, 0]), float(self.profile.values[-1, 0])

    def lift(self, from_rest: FloatArray) -> Lift:
        """The fitted curve."""
        return Lift(*self._fitted.curve(from_rest, 0, 4))


def _problems(table: Table) -> Iterator[Problem]:
    """Why the rows are no profile with one minimum, with the lines."""
    deflection, lift = table.values.T
    if problems := list(wrong_rows(table)):
        yield from problems
        return
    lowest = int(np.argmin(lift))
    if lowest in {0, len(lift) - 1}:
        message = "the lift is lowest at an end; a cam needs points on both sides of its minimum"
        yield Problem(table.source.path, table.line_of(lowest), message)
        return
    tolerance = SHAPE_TOLERANCE * np.ptp(lift)
    outward = lift[lowest:], lift[lowest::-1]
    for side, step in zip(outward, (1, -1), strict=True):
        falls = np.flatnonzero(np.maximum.accumulate(side) - side > tolerance)
        if falls.size:
            row = lowest + step * int(falls[0])
            message = (
                f"the lift {lift[row]:.4g} lies below that of a row nearer to the minimum at "
                f"{deflection[lowest]:.4g}: a cam needs one minimum"
            )
            yield Problem(table.source.path, table.line_of(row), message)
