"""Times as clocks show them: against `datetime`, which reads ISO 8601 by itself."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from vsacli import InputError
from vsacli.documents.table import read_table
from vsacli.documents.time_column import NANOSECONDS, ClockTime, nanoseconds_since_first, read_clock

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def random_moments(count: int) -> list[datetime]:
    random = np.random.default_rng(7)
    seconds = random.integers(-(10**9), 4 * 10**9, count).tolist()
    micros = random.integers(0, 10**6, count).tolist()
    return [EPOCH + timedelta(seconds=s, microseconds=us) for s, us in zip(seconds, micros, strict=True)]


@pytest.mark.parametrize("form", ["{0:%Y-%m-%dT%H:%M:%S.%f}Z", "{0:%Y/%m/%d %H:%M:%S.%f}", "iso"])
def test_dates_and_times_are_those_of_datetime(form: str) -> None:
    for moment in random_moments(200):
        text = moment.isoformat(timespec="microseconds") if form == "iso" else form.format(moment)
        expected = (moment - EPOCH) // timedelta(microseconds=1) * 1000
        assert read_clock(text) == ClockTime(expected, dated=True)


def test_a_zone_is_taken_off() -> None:
    for text in ("2024-05-01T22:30:01+02:00", "2024-05-01T22:30:01+0200"):
        expected = datetime.fromisoformat("2024-05-01T20:30:01+00:00")
        assert read_clock(text) == ClockTime(
            (expected - EPOCH) // timedelta(seconds=1) * NANOSECONDS, dated=True
        )


@pytest.mark.parametrize("separator", [".", ",", ":"])
def test_times_of_day_with_fractions(separator: str) -> None:
    random = np.random.default_rng(3)
    for seconds, micros in zip(random.integers(0, 86400, 100), random.integers(0, 10**6, 100), strict=True):
        hours, rest = divmod(int(seconds), 3600)
        text = f"{hours:02d}:{rest // 60:02d}:{rest % 60:02d}{separator}{micros:06d}"
        assert read_clock(text) == ClockTime(int(seconds) * NANOSECONDS + int(micros) * 1000, dated=False)


@pytest.mark.parametrize(
    ("text", "nanoseconds"),
    [
        ("22:30:01:720429", 81001_720429000),  # as one laboratory's program writes it
        ("9:05:00", 32700 * NANOSECONDS),
        ("00:00:00.000000001", 1),
        ("00:00:00.0000000019", 1),
        ("00:00:01:250", 1_250_000_000),
        ("12:00:00 AM", 0),
        ("1:00:00.5 PM", 46800_500000000),
    ],
)
def test_times_of_day(text: str, nanoseconds: int) -> None:
    assert read_clock(text) == ClockTime(nanoseconds, dated=False)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1.5",
        "12:30",
        "24:00:00",
        "22:61:00",
        "22:30:01:7",
        "2024-02-30T00:00:00",
        "13:00:00 PM",
        "01.05.2024",
    ],
)
def test_what_is_no_time_or_has_two_meanings(text: str) -> None:
    assert read_clock(text) is None


def test_midnight_is_passed() -> None:
    clocks = [read_clock(text) for text in ("23:59:59.5", "00:00:00", "12:00:00", "23:00:00", "01:00:00")]
    hours = (nanoseconds_since_first([clock for clock in clocks if clock]) / NANOSECONDS - 0.5) / 3600
    assert hours[1:].tolist() == [0, 12, 23, 25]


def rows_of(folder: Path, *lines: str) -> Path:
    path = folder / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("separator", [",", ";"])
def test_a_column_of_clock_times_is_read_to_the_nanosecond(tmp_path: Path, separator: str) -> None:
    texts = [f"22:30:0{1 + i // 100}.{i % 100:02d}0429{i % 7:03d}" for i in range(300)]
    lines = [separator.join(["1", text, str(i / 8)]) for i, text in enumerate(texts)]
    table = read_table(rows_of(tmp_path, separator.join(["a", "time", "b"]), *lines))
    expected = [i * 10_000_000 + i % 7 for i in range(300)]
    assert table.columns == ("a", "time [ns]", "b")
    assert table.values[:, 1].tolist() == expected
    assert table.values[:, 2].tolist() == [i / 8 for i in range(300)]
    assert table.first_stamp == texts[0]


def test_a_table_of_times_alone(tmp_path: Path) -> None:
    table = read_table(rows_of(tmp_path, "time", "22:30:01", "22:30:02"))
    assert table.values.tolist() == [[0], [1e9]]


@pytest.mark.parametrize(
    ("second", "third", "message"),
    [
        (
            "noon,1",
            "1,2",
            r"log.csv:2: column 'time': expected a number, a time of day such as .* found 'noon'",
        ),
        ("22:30:01,1", "22:30,2", r"log.csv:3: expected a time as in the rows above, found '22:30'"),
        (
            "22:30:01,1",
            "2024-05-01T22:30:02,2",
            r"log.csv:3: expected a time as in the rows above, found '2024",
        ),
        (
            "22:30:01,1",
            "22:30:02",
            r"log.csv:3: expected 2 values, one for each column of the header, found 1",
        ),
        ("22:30:01,x", "22:30:02,1", r"log.csv:2: column 'b': expected a number, found 'x'"),
    ],
)
def test_what_is_wrong_with_them_is_told_with_its_line(
    tmp_path: Path, second: str, third: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read_table(rows_of(tmp_path, "time,b", second, third))
