"""Which column of a recording holds its stamps, and what these count."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.documents.column_mapping import MappedColumn
from vsacli.documents.table_header import split_heading
from vsacli.files.recordings.first_rows import FirstRows
from vsacli.trajectory.recorded.stamps import UNITS
from vsacli.trajectory.recorded.thresholds import USUAL_STEPS

NAMES = (
    *("time", "__time", "field.header.stamp", "header.stamp", "%time", "rosbagtimestamp"),
    *("timestamp", "stamp", "t", "seconds", "zeit"),
)
"""What stamps are called, the best first: those of sensors before those of loggers."""

SINCE_1970 = {1e8: "s", 1e11: "ms", 1e14: "us", 1e17: "ns"}
"""From which number on a stamp counts so from 1970: since 1973, for the least."""

NANOSECONDS = 10**9
"""Stamps of two columns have fewer than these in the second."""


class TimeColumn(NamedTuple):
    """The stamps of a recording.

    Attributes:
        place: of the column, from 0.
        source: what a mapping says of it.
        reason: why it is taken for that, a clause.
        nanoseconds: place of the column of nanoseconds beside it, if there is one.
    """

    place: int
    source: MappedColumn
    reason: str
    nanoseconds: int | None = None


def time_column(rows: FirstRows) -> TimeColumn | None:
    """The column that holds the stamps, if one does."""
    pair = _seconds_and_nanoseconds(rows)
    if pair is not None:
        seconds, rest = map(rows.called, pair)
        source = MappedColumn(column=seconds, nanoseconds=rest)
        return TimeColumn(pair[0], source, "seconds and nanoseconds since 1970", pair[1])
    words = {place: split_heading(rows.columns[place])[0].lower() for place in rows.of_numbers}
    rising = [place for place in rows.of_numbers if rows.rises(place)]
    exactly = (place for place in rising if words[place] in NAMES)
    called = sorted(exactly, key=lambda place: NAMES.index(words[place]))
    called += [place for place in rising if place not in called and words[place].endswith(NAMES)]
    place = next(iter(called or rising), None)
    if place is None:
        return None
    own = split_heading(rows.columns[place])[1]
    unit, reason = _unit(rows, place) if own is None else (own, "")
    return TimeColumn(place, MappedColumn(column=rows.called(place), unit=unit), reason)


def _seconds_and_nanoseconds(rows: FirstRows) -> tuple[int, int] | None:
    """Two columns beside each other: whole seconds since 1970, and nanoseconds that start again."""
    for place in rows.of_numbers[:-1]:
        seconds, rest = rows.numbers(place), rows.numbers(place + 1)
        if (
            len(seconds) == len(rest) > 0
            and all(second == int(second) and 1e8 < second < 1e11 for second in seconds)
            and all(part == int(part) and 0 <= part < NANOSECONDS for part in rest)
            and max(rest) > 1
        ):
            return place, place + 1
    return None


def _unit(rows: FirstRows, place: int) -> tuple[str | None, str]:
    """The unit of stamps that have none in the header, None for seconds; and why, a clause."""
    values = np.array(rows.numbers(place))
    since = [unit for least, unit in SINCE_1970.items() if values[0] >= least]
    if since:
        return (None if since[-1] == "s" else since[-1]), f"counts {since[-1]} since 1970"
    step = float(np.median(np.diff(values)))
    low, high = USUAL_STEPS
    for unit, size in UNITS.items():
        if step > high and low <= step * size <= high:
            return unit, f"steps of {step:.4g} are hardly seconds"
    return None, ""
