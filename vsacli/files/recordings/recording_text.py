"""A recording as text: its description, and a YAML mapping of its columns with comments on guesses."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vsacli.base.tables import aligned
from vsacli.base.texts import counted, for_yaml
from vsacli.documents.column_mapping import REST, MappedColumn
from vsacli.documents.number import BOOLEANS
from vsacli.documents.time_column import TIME
from vsacli.files.recordings.first_rows import GUESSED, TimeColumn
from vsacli.files.recordings.guesses import TAKEN, Guess
from vsacli.trajectory.recorded.health import step_text

KIND = "recording"

COMMENT_BY_QUANTITY = {
    "dq": "measured; a fit of the positions mostly gives a better one",
    "tau_motor_1": "for compare and identify, if it is what motor 1 gives on the joint side of its gear",
}
"""Reasons for which columns of a quantity are only shown in comments."""

_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_./]*")


def recording_lines(recording: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines with rows and rate, the columns, their faults, and a proposed trajectory file."""
    time = recording["time"]
    yield f"recording {recording['name']}: {counted(recording['rows'], 'row')}{_timing_text(time)}"
    yield from aligned([("column", "number", "holds", "smallest", "largest"), *_column_rows(recording)])
    yield from (f"warning: {warning}" for warning in recording["warnings"])
    yield ""
    guess_clause = ", some of which are guessed" if GUESSED in recording["trajectory"] else ""
    if recording["refusal"]:
        yield f"no complete trajectory file for this recording: {recording['refusal']}"
    else:
        yield f"trajectory file for this recording; check the columns{guess_clause}:"
    yield ""
    yield from recording["trajectory"].splitlines()


def _timing_text(time: Mapping[str, Any] | None) -> str:
    if time is None:
        return ", no column of which holds times; give their rate with --rate HZ"
    step = time["step"]
    steps_text = (
        f" (steps of {step_text(step['min'])} to {step_text(step['max'])})" if step["min"] > 0 else ""
    )
    rate = "" if math.isnan(time["rate"]) else f", {time['rate']:.4g} Hz{steps_text}"
    duration = "" if math.isnan(time["duration"]) else f", {time['duration']:.6g} s"
    return f"{duration}{rate}"


def _column_rows(recording: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    rows, time = recording["rows"], recording["time"]
    for column in recording["columns"]:
        content_text = column["holds"]
        if content_text == "numbers" and column["rows"] < rows:
            content_text = f"numbers in {column['rows']} rows"
        elif content_text in ("text", "list"):
            content_text = f"{content_text}: {column['first'][:20]}"
        elif content_text == "time":
            guess_clause = " (guessed)" if time and time["unit_guessed"] else ""
            content_text = "time" if time is None else f"time, {time['unit']}{guess_clause}"
        yield (
            column["name"] or "-",
            str(column["number"]),
            content_text,
            *("-" if math.isnan(column[end]) else f"{column[end]:.5g}" for end in ("min", "max")),
        )


def mapping_lines(
    time: TimeColumn | None,
    guesses: Sequence[Guess],
    joint_names: Sequence[str],
    ignored: str | tuple[str | int, ...],
    rate: float | None = None,
    skip_rows: Sequence[int] = (),
) -> Iterator[str]:
    """Yield the keys `columns`, `ignore` and `skip_rows`.

    Args:
        time: column of stamps, if there is one.
        guesses: likely meanings of the columns.
        joint_names: joints of the robot, empty if unknown.
        ignored: `REST`, or further columns; empty if there are none.
        rate: rows per second, in place of times.
        skip_rows: numbers of lines that are neither header nor rows.
    """
    times = [] if rate is not None else _time_entry(time)
    lines = [*times, *_missing_entries(guesses, joint_names), *map(_guess_entry, guesses)]
    width = max((len(entry) for entry, _ in lines), default=0)
    if any(not entry.startswith("#") for entry, _ in lines):
        yield "columns:"
    elif lines:
        yield "# columns:"
    for entry, comment in lines:
        yield f"  {entry:<{width}}  # {comment}" if comment else f"  {entry}"
    if ignored:
        yield f"ignore: {ignored if ignored == REST else '[' + ', '.join(map(_yaml_word, ignored)) + ']'}"
    if skip_rows:
        yield f"skip_rows: {list(skip_rows)}"


def _time_entry(time: TimeColumn | None) -> Iterator[tuple[str, str]]:
    if time is None:
        yield f"# {TIME}: ...", "no column holds usable times; say which does, or the rate of the rows"
    else:
        yield f"{TIME}: {_source_text(time.source)}", time.reason


def _missing_entries(guesses: Sequence[Guess], joint_names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield commented entries for joints without a column of positions."""
    guessed_names = {guess.name for guess in guesses}
    for joint in joint_names or ([] if guessed_names else ["<joint>"]):
        if f"{joint}.q" not in guessed_names:
            yield f"# {joint}.q: ...", "the name or the number of its column"


def is_proposed(guess: Guess) -> bool:
    """Return whether a mapping contains a guess; other guesses are comments there."""
    return guess.quantity in TAKEN or guess.of_motor


def _guess_entry(guess: Guess) -> tuple[str, str]:
    reason = guess.reason if guess.sure else f"{GUESSED}: {guess.reason}"
    if not is_proposed(guess):
        comment = COMMENT_BY_QUANTITY[guess.quantity]
        return (
            f"# {guess.name}: {_source_text(guess.source)}",
            comment if guess.sure else f"{comment}; {reason}",
        )
    return f"{guess.name}: {_source_text(guess.source)}", reason


def _source_text(source: MappedColumn) -> str:
    keys = {"column": source.column, "unit": source.unit, "nanoseconds": source.nanoseconds}
    mapping_entries = {key: _yaml_word(value) for key, value in keys.items() if value is not None}
    if list(mapping_entries) == ["column"]:
        return mapping_entries["column"]
    return f"{{{', '.join(f'{key}: {value}' for key, value in mapping_entries.items())}}}"


def _yaml_word(value: str | int) -> str:
    is_plain = isinstance(value, int) or (_PLAIN.fullmatch(value) and value.lower() not in BOOLEANS)
    return str(value) if is_plain else for_yaml(str(value))
