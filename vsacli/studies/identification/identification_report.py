"""What an identification says, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named
from vsacli.base.tables import ReportText, aligned
from vsacli.documents.source import Source
from vsacli.robot.model import Robot

OK, UNTOLD, MISFIT, DOUBTFUL = "ok", "untold", "misfit", "doubtful"
"""Verdicts, the worst last: all numbers are told; some are not; the equations leave more than noise; a record
looks wrong."""

CHANGED = 3.0
"""Standard errors by which a number differs from that of the file. Of a hundred numbers that do not, five are
beyond two, and less than one beyond three."""


TENS = 10
"""Standard errors of a difference below which it has a decimal."""

LARGEST_SAID = 1e3
"""Standard errors of a difference up to which their number is said; beyond, none is meant."""


@dataclass(frozen=True)
class Number(Published):
    """A number of a robot as found.

    Attributes:
        path: to it, from the robot; of a base parameter, its name.
        unit: of all values.
        before: by the robot file.
        value: what is found, or kept.
        standard_error: of that; NaN if it was not told.
        note: why it was not told, or is at a bound; empty otherwise.
        sum: of a base parameter, which the file does not have, what of link numbers it is; else empty.
    """

    path: str
    unit: str
    before: float
    value: float
    standard_error: float
    note: str = ""
    sum: str = ""

    shape: ClassVar = {
        **named("path", "unit", "before", "value", "standard_error", "off", "changed"),
        "note?": "note",
        "sum?": "sum",
    }

    @property
    def told(self) -> bool:
        """Whether it was found."""
        return math.isfinite(self.standard_error)

    @property
    def off(self) -> float:
        """Standard errors by which it differs from that of the file; NaN if it was not told."""
        difference = self.value - self.before
        return difference / self.standard_error if difference and self.told else 0.0 * self.standard_error

    @property
    def changed(self) -> bool:
        """Whether it differs from that of the file by more than it may be off."""
        return self.told and abs(self.value - self.before) > CHANGED * self.standard_error


@dataclass(frozen=True)
class Residual(Published):
    """What the equations of a motor, or a link, leave; root mean squares, after the filter.

    Attributes:
        group: which it is.
        unit: of all values.
        torque: what was measured.
        residual: that less what is predicted.
        noise: of the measured torque, from where no motion is; NaN if it is not known.
        held_out: the residual where the fit did not see it; NaN if nothing was held out.
    """

    group: str
    unit: str
    torque: float
    residual: float
    noise: float
    held_out: float


@dataclass(frozen=True)
class SystemReport(Published):
    """What was found of the numbers of a joint's motors and springs, or of the links.

    Attributes:
        title: whose they are.
        numbers: all that were looked for.
        condition: of the columns of the equations.
        combinations: what can be told of numbers that cannot be told apart, sentences.
        residuals: of each motor, or link.
        converged: whether the search came to an end.
    """

    title: str
    numbers: tuple[Number, ...]
    condition: float
    combinations: tuple[str, ...]
    residuals: tuple[Residual, ...]
    converged: bool = True


@dataclass(frozen=True)
class RecordReport(Published):
    """How a record was used.

    Attributes:
        path: of it.
        duration: of what was used, s.
        rate: samples a second.
        bandwidth: of the filter, Hz.
        delay: by which torques were later than positions, s; NaN if it could not be told.
        delay_error: its standard error.
        corrected: whether it was taken out.
        doubts: what looks wrong, sentences.
        unused: columns that were not needed.
    """

    path: str
    duration: float
    rate: float
    bandwidth: float
    delay: float
    delay_error: float
    corrected: bool
    doubts: tuple[str, ...]
    unused: tuple[str, ...]


@dataclass(frozen=True)
class Torques:
    """Measured and predicted torques of a record for a figure, (rows,).

    Attributes:
        record: path of it.
        group: motor or link.
        unit: of the torques.
        time, measured, predicted: rows of the equations.
    """

    record: str
    group: str
    unit: str
    time: FloatArray = field(repr=False)
    measured: FloatArray = field(repr=False)
    predicted: FloatArray = field(repr=False)

    @property
    def residual(self) -> float:
        """Root mean square of their difference."""
        return float(np.sqrt(np.mean((self.measured - self.predicted) ** 2)))


@dataclass(frozen=True)
class Identification(Published):
    """Numbers of a robot from records of its motion.

    Attributes:
        robot: its name.
        verdict: `ok`, or the worst of `untold`, `misfit` and `doubtful`.
        records: how each was used.
        systems: what was found, joint by joint.
        notes: what else is to be known, sentences.
        fitted: the robot with the numbers found.
        torques: measured and predicted, for figures; not in JSON.
        sources: the files of the robot and the records, as they were read; not in JSON.
    """

    robot: str
    verdict: str
    records: tuple[RecordReport, ...]
    systems: tuple[SystemReport, ...]
    notes: tuple[str, ...]
    fitted: Robot = field(repr=False)
    torques: tuple[Torques, ...] = field(repr=False, default=())
    sources: tuple[Source, ...] = field(repr=False, default=())

    format: ClassVar[str] = "vsacli-identification/1"
    shape: ClassVar = {"format": "format", **named("robot", "verdict", "records", "systems", "notes")}

    @property
    def numbers(self) -> tuple[Number, ...]:
        """Of all systems."""
        return tuple(number for system in self.systems for number in system.numbers)

    def __str__(self) -> str:
        return "\n".join(
            [
                self._headline(),
                self._summary(),
                *map(_used, self.records),
                *(line.rstrip() for line in aligned(self._numbers())),
                *aligned(self.residual_rows()),
                *self._sentences(),
            ]
        )

    def as_text(self) -> ReportText:
        """The report in its parts, of its tables the numbers; the other is `residual_rows`."""
        lines = [self._summary(), *map(_used, self.records), *self._sentences()]
        return ReportText(self._headline(), self._numbers(), lines)

    def _headline(self) -> str:
        count = f"{len(self.records)} record" + ("s" if len(self.records) > 1 else "")
        return f"{self.robot} from {count}: {self.verdict.upper()}"

    def _summary(self) -> str:
        """How many numbers agree with the file, how many do not, and how many say nothing of it."""
        told, changed = sum(each.told for each in self.numbers), sum(each.changed for each in self.numbers)
        counts = {
            f"{'agrees' if told - changed == 1 else 'agree'} with the file": told - changed,
            f"{'differs' if changed == 1 else 'differ'} by more than {CHANGED:g} standard errors": changed,
            "cannot be told": len(self.numbers) - told,
        }
        listed = ", ".join(f"{count} {words}" for words, count in counts.items() if count)
        return f"{len(self.numbers)} number{'s' if len(self.numbers) != 1 else ''}: {listed}"

    def _numbers(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("number", "file", "found", "+-", "unit", "")]
        for each in self.numbers:
            said = each.note or (_off(each.off) if each.changed else "as in the file")
            found = significant(each.value, each.standard_error)
            error = f"{each.standard_error:.2g}" if each.told else "-"
            rows.append((each.path, f"{each.before:.6g}", found, error, each.unit, said))
        return rows

    def residual_rows(self) -> list[tuple[str, ...]]:
        """A table of what the equations of each motor, or link, leave; its header first."""
        rows: list[tuple[str, ...]] = [
            ("rms, filtered", "torque", "residual", "noise", "held out", "condition")
        ]
        for system in self.systems:
            for each in system.residuals:
                torque, residual, noise, held_out = (
                    f"{value:.3g} {each.unit}" if math.isfinite(value) else "-"
                    for value in (each.torque, each.residual, each.noise, each.held_out)
                )
                rows.append((each.group, torque, residual, noise, held_out, f"{system.condition:.3g}"))
        return rows

    def _sentences(self) -> Iterator[str]:
        for system in self.systems:
            yield from (f"{system.title}: {sentence}" for sentence in system.combinations)
            yield from (
                f"{each.path} is {each.sum}" for each in system.numbers if each.sum not in ("", each.path)
            )
        for record in self.records:
            yield from (f"{record.path}: {doubt}" for doubt in record.doubts)
        yield from self.notes


def _off(errors: float) -> str:
    size = abs(errors)
    return f"changed, {size:.{int(size < TENS)}f} errors" if size < LARGEST_SAID else "changed"


def _used(record: RecordReport) -> str:
    used = f"{record.duration:.4g} s at {record.rate:.4g} Hz, filtered to {record.bandwidth:.3g} Hz"
    line = f"{record.path}: {used}"
    if not math.isfinite(record.delay):
        return f"{line}; whether torques lag behind positions cannot be told"
    late = f"{1e3 * record.delay:+.2g} +- {1e3 * record.delay_error:.1g} ms behind positions"
    return f"{line}; torques are {late}{', which is taken out' if record.corrected else ''}"


def significant(value: float, error: float) -> str:
    """A value with as many digits as its standard error leaves meaning, two of that."""
    if not (math.isfinite(error) and error > 0):
        return f"{value:.6g}"
    decimals = 1 - math.floor(math.log10(error))
    rounded = round(value, decimals)
    return f"{rounded:.{max(decimals, 0)}f}"
