"""What a comparison says, as text and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from vsacli.base.json_records import Published
from vsacli.base.tables import ReportText
from vsacli.documents.source import Source
from vsacli.studies.measured.agreement import Agreement

SHOWN_LAG = 5e-4
"""Lag, s, from which on it may be one of clocks."""


@dataclass(frozen=True)
class Comparison(Published):
    """What was measured against what was computed.

    Attributes:
        result, recording: paths of the files.
        begins_at: time of the recording at which the result begins, s from its first sample.
        begins_at_error: standard error of that, s; NaN if it was given.
        found: whether that was found from the signals.
        duration: of the result, s.
        compared: how much of it the recording covers, s.
        signals: a record of each column that was compared.
        notes: what looks like a slip, and what was not compared.
        sources: the recording as it was read; not in JSON.
    """

    result: str
    recording: str
    begins_at: float
    begins_at_error: float
    found: bool
    duration: float
    compared: float
    signals: tuple[Agreement, ...]
    notes: tuple[str, ...] = ()
    sources: tuple[Source, ...] = field(repr=False, default=())

    format: ClassVar[str] = "vsacli-comparison/1"
    shape: ClassVar = {
        "format": "format",
        **{name: name for name in ("result", "recording", "begins_at", "begins_at_error")},
        **{name: name for name in ("found", "duration", "compared")},
        **{name: name for name in ("signals", "notes")},
    }

    def __str__(self) -> str:
        return str(self.as_text())

    def as_text(self) -> ReportText:
        """The report in its parts."""
        return ReportText(self._headline(), self._rows(), [f"note: {note}" for note in self.notes])

    def _headline(self) -> str:
        when = _with_error(abs(self.begins_at), self.begins_at_error, "s", ".4f")
        where = f"{when} {'into' if self.begins_at >= 0 else 'before'} the recording"
        how = "found from the signals" if self.found else "as given"
        covered = f"{self.compared:.4g} s of {self.duration:.4g} s compared"
        return f"{self.result}, {self.recording}: {covered}; the result begins {where} ({how})"

    def _rows(self) -> list[tuple[str, ...]]:
        header = (
            "measured",
            "compared with",
            "rms error",
            "of rms",
            "largest",
            "at",
            "offset",
            "gain",
            "lag",
        )
        return [header, *map(_row, self.signals)]


def _row(signal: Agreement) -> tuple[str, ...]:
    def figure(value: float, form: str, unit: str = "") -> str:
        return f"{value:{form}}{unit}" if math.isfinite(value) else "-"

    unit = f" {signal.unit}"
    return (
        signal.column,
        signal.variable,
        figure(signal.rms, ".3g", unit),
        figure(100 * signal.share, ".3g", " %"),
        figure(signal.worst, "+.3g", unit),
        figure(signal.worst_time, ".3f", " s"),
        _with_error(signal.offset, signal.offset_error, signal.unit, "+.2g"),
        _with_error(signal.gain, signal.gain_error, "", ".4g"),
        _with_error(1e3 * signal.lag, 1e3 * signal.lag_error, "ms", "+.1f"),
    )


def _with_error(value: float, error: float, unit: str, form: str) -> str:
    if not math.isfinite(value):
        return "-"
    known = f" +- {error:.1g}" if math.isfinite(error) else ""
    return f"{value:{form}}{known} {unit}".rstrip()
