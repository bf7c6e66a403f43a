"""The description of a recording as text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from vsacli.base.tables import aligned
from vsacli.trajectory.recorded.stamps import step_text

KIND = "recording"


def recording_lines(recording: Mapping[str, Any]) -> Iterator[str]:
    """Rows and rate, the columns, what is wrong with them, and what to paste."""
    time = recording["time"]
    yield f"recording {recording['name']}: {recording['rows']} rows{_timing(time)}"
    yield from aligned([("column", "number", "holds", "smallest", "largest"), *_columns(recording)])
    yield from (f"warning: {warning}" for warning in recording["warnings"])
    yield ""
    yield "as a trajectory file; check what it says of the columns, and what it guesses:"
    yield ""
    yield from recording["trajectory"].splitlines()


def _timing(time: Mapping[str, Any] | None) -> str:
    if time is None:
        return ", no column of which holds times; give their rate with --rate HZ"
    step = time["step"]
    steps = f"steps of {step_text(step['min'])} to {step_text(step['max'])}"
    rate = "" if math.isnan(time["rate"]) else f", {time['rate']:.4g} Hz ({steps})"
    return f", {time['duration']:.6g} s{rate}"


def _columns(recording: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    rows, time = recording["rows"], recording["time"]
    for column in recording["columns"]:
        holds = column["holds"]
        if holds == "numbers" and column["rows"] < rows:
            holds = f"numbers in {column['rows']} rows"
        elif holds == "text":
            holds = f"text: {column['first'][:20]}"
        elif holds == "time":
            holds = "time" if time is None else f"time, {time['unit']}"
        yield (
            column["name"] or "-",
            str(column["number"]),
            holds,
            *("-" if math.isnan(column[end]) else f"{column[end]:.5g}" for end in ("min", "max")),
        )
