"""Samples from a CSV table."""

from __future__ import annotations

from dataclasses import dataclass

from vsacli.documents.fields import check_fields, choice, text
from vsacli.trajectory.declared.framed import Framed
from vsacli.trajectory.fits import METHODS


@dataclass(frozen=True)
class Recorded:
    """Samples from a CSV table, whose times are those of the trajectory."""

    file: str = text("path of the CSV file, relative to the trajectory file")
    fit: str | None = choice(
        METHODS,
        "spline for derivatives that are not given: through the samples, or near noisy ones by least squares;"
        " by default what their noise asks for",
        default=None,
    )

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class RecordedWrench(Recorded, Framed):
    """Samples from a CSV table with the columns fx, fy, fz, mx, my, mz."""
