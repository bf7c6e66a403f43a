"""Columns of times: their names and units, clock formats, counters and absolute stamps.

A clock text is a time of day, such as `22:30:01.720429` or `22:30:01:720429`, or a date with one in the form
of ISO 8601. Stamps are read as whole nanoseconds where floating-point numbers would lose digits, e.g. since
1970. To support a further format, add a case here; readers and descriptions of tables follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import date
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.documents.csv_file import RowsToRead, is_missing, is_number, read_integers

if TYPE_CHECKING:
    import numpy.typing as npt

TIME = "time"
"""Name of the column of stamps after reading."""

UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of stamps other than the second, with their size in seconds."""

USUAL_STEPS = (1e-5, 0.2)
"""Usual sampling intervals of recordings, s: 100 kHz to 5 Hz. The first unit that gives such an interval is
proposed."""

UNIT_WORDS_OF_TIMES = {
    **dict.fromkeys(("ms", "msec", "millis"), "ms"),
    **dict.fromkeys(("us", "usec", "micros"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanosec", "nanoseconds"), "ns"),
}
"""Units by lower-case words at the end of a column name."""

NAMES = (
    *("time", "__time", "field.header.stamp", "header.stamp", "%time", "rosbagtimestamp"),
    *("timestamp", "stamp", "t", "seconds", "zeit", "clock", "datetime"),
)
"""Names of columns of stamps, best first: stamps of sensors before stamps of loggers."""

SECONDS = ("sec", "secs")
REST = ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")
"""Endings of the second column of stamps that occupy two columns, as in ROS messages."""

UNITS_IN_NAMES = ("s", "sec", "secs", "ms", "msec", "us", "usec", "ns", "nsec", "nanosec")
"""Units that may end a column name."""

STEPS = "steps"
"""Beginning of the reason for a unit that only the size of the intervals suggests."""

SINCE_1970 = {1e8: "s", 1e11: "ms", 1e14: "us", 1e17: "ns"}
"""Unit of stamps that count from 1970, by the smallest such stamp (in 1973)."""

NANOSECONDS = 10**9
"""Nanoseconds in a second."""

HOUR, DAY = 3600 * NANOSECONDS, 86400 * NANOSECONDS

DIGITS = 9
"""Digits of a fraction of a second in nanoseconds; further digits are truncated."""

EXPECTED = "a number, a time of day such as 22:30:01.72, or a date and time such as 2024-05-01T22:30:01.72Z"
"""Description of the valid cells of a time column, for messages."""

LARGEST_EXACT = 2.0**53
"""Largest magnitude up to which floats represent all integers; ns since 1970 are 200 times larger."""

_CLOCK = re.compile(
    r"((?P<year>\d{4})[-/](?P<month>\d\d?)[-/](?P<day>\d\d?)[T ] *)?"
    r"(?P<hours>\d\d?):(?P<minutes>[0-5]\d):(?P<seconds>[0-5]\d)"
    r"([.,](?P<fraction>\d+)|:(?P<after_colon>\d{3}|\d{6}|\d{9}))?"  # after colons, 3, 6 or 9 digits
    r" *(?P<half>[AP]M)?(?P<zone>Z|[+-]\d\d:?\d\d)?",
    re.ASCII | re.IGNORECASE,
)


class ClockTime(NamedTuple):
    """A time read from a clock text.

    Attributes:
        nanoseconds: nanoseconds since midnight, or since 1970.
        dated: whether the text has a date.
    """

    nanoseconds: int
    dated: bool


def read_clock(text: str) -> ClockTime | None:
    """Return the time of a clock text; None if the text has no supported form."""
    match = _CLOCK.fullmatch(text.strip())
    if match is None:
        return None
    hours = int(match["hours"])
    if hours > (12 if match["half"] else 23):
        return None
    if match["half"]:
        hours = hours % 12 + 12 * (match["half"].upper() == "PM")
    fraction = (match["fraction"] or match["after_colon"] or "").ljust(DIGITS, "0")[:DIGITS]
    total_seconds = (
        hours * 3600 + int(match["minutes"]) * 60 + int(match["seconds"]) - _zone_offset(match["zone"])
    )
    if match["year"] is not None:
        try:
            day = date(int(match["year"]), int(match["month"]), int(match["day"]))
        except ValueError:
            return None
        total_seconds += (day.toordinal() - date(1970, 1, 1).toordinal()) * 86400
    return ClockTime(total_seconds * NANOSECONDS + int(fraction), match["year"] is not None)


def _zone_offset(zone: str | None) -> int:
    """Return the offset of a time zone from UTC, s."""
    if zone is None or zone.upper() == "Z":
        return 0
    minutes = int(zone[1:3]) * 60 + int(zone[-2:])
    return -60 * minutes if zone[0] == "-" else 60 * minutes


def nanoseconds_since_first(clocks: Sequence[ClockTime]) -> npt.NDArray[np.int64]:
    """Return the time from the first clock to each one, ns.

    A time of day that is more than twelve hours earlier than the one before it belongs to the next day.
    """
    elapsed = np.array([each.nanoseconds for each in clocks], dtype=np.int64)
    if not clocks[0].dated:
        elapsed[1:] += DAY * np.cumsum(np.diff(elapsed) < -12 * HOUR)
    return np.asarray(elapsed - elapsed[0])


def unit_of_steps(step: float) -> str | None:
    """Return the first unit other than the second in which a sampling interval is a usual one."""
    min_step, max_step = USUAL_STEPS
    return next((unit for unit, size in UNITS.items() if min_step <= step * size <= max_step), None)


def guessed_unit(stamps: Sequence[float]) -> tuple[str | None, str]:
    """Return the likely unit of stamps without a declared one (None: seconds), and the reason, a clause."""
    if len(stamps) < 2:
        return None, ""
    since = [unit for least, unit in SINCE_1970.items() if stamps[0] >= least]
    if since:
        return (None if since[-1] == "s" else since[-1]), f"counts {since[-1]} since 1970"
    step = float(np.median(np.diff(np.array(stamps))))
    unit = unit_of_steps(step) if step > USUAL_STEPS[1] else None
    return unit, f"{STEPS} of {step:.4g} are hardly seconds" if unit else ""


def are_seconds_and_nanoseconds(seconds: Sequence[float], rest: Sequence[float], least: float) -> bool:
    """Return whether two columns are whole seconds, `least` or more, and nanoseconds within a second."""
    return (
        len(seconds) == len(rest) > 0
        and all(second == int(second) and least <= second < 1e11 for second in seconds)
        and all(part == int(part) and 0 <= part < NANOSECONDS for part in rest)
        and max(rest) > 1
    )


def shows_a_clock(times: RowsToRead) -> bool:
    """Return whether the only column of these rows, the times, begins with a clock text.

    Raises:
        InputError: the column begins with a text that is neither a clock text nor a number.
    """
    line, cell = next(_time_cells(times), (0, ""))
    if is_number(cell.replace(",", ".")) or is_missing(cell):
        return False
    if read_clock(cell) is None:
        message = f"column {times.name(times.used[0])}: expected {EXPECTED}, found {cell[:40]!r}"
        raise InputError.one(message, times.path, line)
    return True


def read_clocks(times: RowsToRead) -> tuple[str, FloatArray]:
    """Return the first clock text of the only column of these rows, and the time since then in each row, ns.

    Raises:
        InputError: a cell is not a clock text, or not all cells have a date, or none.
    """
    cells, clocks = list(_time_cells(times)), list[ClockTime]()
    for line, cell in cells:
        clock = read_clock(cell)
        if clock is None or clock.dated != (clocks or [clock])[0].dated:
            message = f"expected a time as in the rows above, found {cell[:40]!r}"
            raise InputError.one(message, times.path, line)
        clocks.append(clock)
    return cells[0][1], nanoseconds_since_first(clocks).astype(float)


def _time_cells(times: RowsToRead) -> Iterator[tuple[int, str]]:
    return ((line, cells[times.used[0]].strip()) for line, cells in times.texts())


def read_stamps(
    times: RowsToRead, time: int, nanoseconds: int | None, stamps: FloatArray
) -> tuple[int | None, FloatArray]:
    """Return the first stamp and the exact times since then; None and the stamps if they are small.

    Args:
        times: rows of the table.
        time: position of the column of times.
        nanoseconds: position of the column of nanoseconds that completes whole seconds, if any.
        stamps: times as floating-point numbers.

    Raises:
        InputError: there are nanoseconds, but not both columns are whole numbers.
    """
    if nanoseconds is None and not np.abs(stamps).max() > LARGEST_EXACT:  # NaN max if cells are empty
        return None, stamps
    places = sorted({time, time if nanoseconds is None else nanoseconds})
    whole = read_integers(times._replace(used=places, empty_cells=False))
    if whole is None:
        if nanoseconds is not None:
            message = "whole seconds and nanoseconds are expected in the columns of the time"
            raise InputError.one(message, times.path)
        return int(stamps[0]), stamps - stamps[0]
    exact = whole[:, places.index(time)]
    if nanoseconds is not None:
        exact = exact * NANOSECONDS + whole[:, places.index(nanoseconds)]
    return int(exact[0]), (exact - exact[0]).astype(float)
