"""Times that are written as a clock shows them: what such texts mean, for all that read or describe tables.

A text is a time of day, as `22:30:01.720429` or `22:30:01:720429`, or a date with one, as ISO 8601 writes it.
They are read in whole nanoseconds, of which floating-point numbers would lose digits since 1970.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

NANOSECONDS = 10**9
"""In a second."""

HOUR, DAY = 3600 * NANOSECONDS, 86400 * NANOSECONDS

DIGITS = 9
"""Of a fraction of a second in nanoseconds; further ones are cut off."""

EXPECTED = "a number, a time of day such as 22:30:01.72, or a date and time such as 2024-05-01T22:30:01.72Z"
"""What a cell of a column of times may hold, for messages."""

_CLOCK = re.compile(
    r"((?P<year>\d{4})[-/](?P<month>\d\d?)[-/](?P<day>\d\d?)[T ] *)?"
    r"(?P<hours>\d\d?):(?P<minutes>[0-5]\d):(?P<seconds>[0-5]\d)"
    r"([.,](?P<fraction>\d+)|:(?P<after_colon>\d{3}|\d{6}|\d{9}))?"  # after a colon only whole groups are one
    r" *(?P<half>[AP]M)?(?P<zone>Z|[+-]\d\d:?\d\d)?",
    re.ASCII | re.IGNORECASE,
)


class Clock(NamedTuple):
    """A time that a text tells.

    Attributes:
        nanoseconds: since midnight, or since 1970.
        dated: whether the text has a date.
    """

    nanoseconds: int
    dated: bool


def read_clock(text: str) -> Clock | None:
    """The time that a text tells; None if it tells none in a form that is known here."""
    found = _CLOCK.fullmatch(text.strip())
    if found is None:
        return None
    hours = int(found["hours"])
    if hours > (12 if found["half"] else 23):
        return None
    if found["half"]:
        hours = hours % 12 + 12 * (found["half"].upper() == "PM")
    fraction = (found["fraction"] or found["after_colon"] or "").ljust(DIGITS, "0")[:DIGITS]
    whole = hours * 3600 + int(found["minutes"]) * 60 + int(found["seconds"]) - _offset(found["zone"])
    if found["year"] is not None:
        try:
            day = date(int(found["year"]), int(found["month"]), int(found["day"]))
        except ValueError:
            return None
        whole += (day.toordinal() - date(1970, 1, 1).toordinal()) * 86400
    return Clock(whole * NANOSECONDS + int(fraction), found["year"] is not None)


def _offset(zone: str | None) -> int:
    """Of a time zone from UTC, s."""
    if zone is None or zone.upper() == "Z":
        return 0
    minutes = int(zone[1:3]) * 60 + int(zone[-2:])
    return -60 * minutes if zone[0] == "-" else 60 * minutes


def elapsed(clocks: Sequence[Clock]) -> npt.NDArray[np.int64]:
    """By how much each time is later than the first one, ns.

    A time of day that falls by more than twelve hours is one of the next day.
    """
    since = np.array([each.nanoseconds for each in clocks], dtype=np.int64)
    if not clocks[0].dated:
        since[1:] += DAY * np.cumsum(np.diff(since) < -12 * HOUR)
    return np.asarray(since - since[0])
