"""Which column of a recording holds its stamps, and what these count."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.documents.clocks import EXPECTED, NANOSECONDS, read_clock
from vsacli.documents.column_mapping import MappedColumn
from vsacli.documents.table_header import is_number, split_heading
from vsacli.files.recordings.first_rows import RISING_SHARE, FirstRows
from vsacli.files.recordings.names import QUANTITY_WORDS, WORDS, words_of
from vsacli.trajectory.recorded.stamps import UNITS
from vsacli.trajectory.recorded.thresholds import USUAL_STEPS

NAMES = (
    *("time", "__time", "field.header.stamp", "header.stamp", "%time", "rosbagtimestamp"),
    *("timestamp", "stamp", "t", "seconds", "zeit", "clock", "datetime"),
)
"""What stamps are called, the best first: those of sensors before those of loggers."""

SECONDS = ("sec", "secs")
REST = ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")
"""How names of stamps end that fill two columns, as in messages of ROS."""

UNITS_IN_NAMES = ("s", "sec", "secs", "ms", "msec", "us", "usec", "ns", "nsec", "nanosec")
"""Words behind a name that say what it counts."""

GUESSED = "guessed"
"""How the reason begins why a column is taken for times that nothing calls so."""

EVEN = 0.5
"""By how much of the median step nearly all others may differ in a column that nothing calls a time."""

SINCE_1970 = {1e8: "s", 1e11: "ms", 1e14: "us", 1e17: "ns"}
"""From which number on a stamp counts so from 1970: since 1973, for the least."""


class TimeColumn(NamedTuple):
    """The stamps of a recording.

    Attributes:
        place: of the column, from 0.
        source: what a mapping says of it.
        reason: why it is taken for that, a clause.
        nanoseconds: place of the column of nanoseconds beside it, if there is one.
        clock: whether it is written as a clock shows times.
    """

    place: int
    source: MappedColumn
    reason: str
    nanoseconds: int | None = None
    clock: bool = False

    @property
    def guessed(self) -> bool:
        """Whether nothing calls it a time."""
        return self.reason.startswith(GUESSED)


def time_column(rows: FirstRows) -> TimeColumn | None:
    """The column that holds the stamps, if one does: called so, of clock texts, or of even steps."""
    pair = _seconds_and_nanoseconds(rows)
    if pair is not None:
        seconds, rest = map(rows.called, pair)
        source = MappedColumn(column=seconds, nanoseconds=rest)
        return TimeColumn(pair[0], source, "seconds and nanoseconds", pair[1])
    called, every = _called(rows), range(len(rows.columns))
    clocks = (place for place in every if rows.clocks(place))
    rising = [place for place in (*called, *clocks) if rows.rises(place)]
    if rising:
        return _described(rows, rising[0], "")
    guess = None if called else next(filter(lambda place: _like_stamps(rows, place), rows.of_numbers), None)
    return None if guess is None else _described(rows, guess, f"{GUESSED}: it increases in nearly even steps")


def unread_times(rows: FirstRows) -> Iterator[str]:
    """What is wrong with columns that are called times, if none of them can be one."""
    if time_column(rows) is not None:
        return
    for place in _called(rows):
        name, filled = rows.columns[place], rows.filled(place)
        if rows.numbers(place) or rows.clocks(place):
            yield f"column {name!r} is called a time, but does not increase from row to row"
        elif filled:
            unread = (cell for cell in filled if not is_number(cell) and read_clock(cell) is None)
            text = next(unread, filled[0])  # numbers and clocks by turns
            yield f"column {name!r} is called a time, but holds {text[:40]!r}; expected {EXPECTED}"


def _described(rows: FirstRows, place: int, reason: str) -> TimeColumn:
    column = rows.called(place)
    if rows.clocks(place):
        return TimeColumn(place, MappedColumn(column=column), "as a clock shows it", clock=True)
    own = split_heading(rows.columns[place])[1] or MappedColumn(column=column).doubt(rows.columns[place])
    unit, why = _unit(rows, place) if own is None else (own, "")
    return TimeColumn(place, MappedColumn(column=column, unit=unit), "; ".join(filter(None, (reason, why))))


def _called(rows: FirstRows) -> list[int]:
    """Columns whose names say that they are times, the best first: the whole name before its last word."""
    whole, last = {}, {}
    for place, column in enumerate(rows.columns):
        name = split_heading(column)[0].strip().lower()
        words = [word.lower() for word in WORDS.findall(split_heading(column)[0])]
        while len(words) > 1 and words[-1] in UNITS_IN_NAMES:
            words.pop()
        if name in NAMES:
            whole[place] = NAMES.index(name)
        elif words and words[-1] in NAMES and not rows.is_index(place):
            last[place] = NAMES.index(words[-1])
    return [*sorted(whole, key=lambda place: whole[place]), *sorted(last, key=lambda place: last[place])]


def _like_stamps(rows: FirstRows, place: int) -> bool:
    """Whether a column that nothing calls a time rises in nearly even steps, and counts no rows."""
    words = words_of(split_heading(rows.columns[place])[0])
    if QUANTITY_WORDS.intersection(words) or rows.counts_rows(place) or not rows.rises(place):
        return False
    steps = np.diff(rows.numbers(place))
    usual = float(np.median(steps))
    return usual > 0 and bool(np.mean(np.abs(steps - usual) <= EVEN * usual) > RISING_SHARE)


def _seconds_and_nanoseconds(rows: FirstRows) -> tuple[int, int] | None:
    """Two columns: whole seconds, and nanoseconds that start again; called so, or seconds since 1970."""
    words = [words_of(split_heading(column)[0]) for column in rows.columns]
    for place in rows.of_numbers:
        *before, last = words[place] or ("",)
        named = [other for other in rows.of_numbers if words[other] in [(*before, rest) for rest in REST]]
        if last not in SECONDS:
            continue
        if named and _start_again(rows.numbers(place), rows.numbers(named[0]), least=0):
            return place, named[0]
    for place in rows.of_numbers[:-1]:
        if _start_again(rows.numbers(place), rows.numbers(place + 1), least=1e8):
            return place, place + 1
    return None


def _start_again(seconds: Sequence[float], rest: Sequence[float], least: float) -> bool:
    """Whether these are whole seconds, and nanoseconds that start again in each."""
    return (
        len(seconds) == len(rest) > 0
        and all(second == int(second) and least <= second < 1e11 for second in seconds)
        and all(part == int(part) and 0 <= part < NANOSECONDS for part in rest)
        and max(rest) > 1
    )


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
