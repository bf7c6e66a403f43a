"""What the columns of a recording may stand for, by their names: guesses, each with its reason."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from vsacli.documents.column_mapping import MappedColumn
from vsacli.documents.fields import IDENTIFIER
from vsacli.documents.table_header import split_heading
from vsacli.files.recordings.first_rows import FirstRows
from vsacli.files.recordings.times import TimeColumn
from vsacli.trajectory.recorded.thresholds import LARGEST_ANGLE

QUANTITIES = {
    "q": ("position", "positions", "pos", "q", "angle", "angles"),
    "dq": ("velocity", "velocities", "vel", "dq", "qd", "speed"),
    "tau_motor_1": ("effort", "efforts", "torque", "torques", "tau"),
    "stiffness": ("stiffness",),
}
"""Words for each quantity of a joint."""

TAKEN = ("q", "stiffness")
"""Of these, what is proposed; the others stand beside it as comments."""

GENERIC = (
    *("field", "joint", "joints", "state", "states", "data", "measured", "actual", "feedback", "name", "msg"),
    *("deg", "degree", "degrees", "rad", "mm", "m", "nm", "n"),
)
"""Words in names of columns that say nothing of which joint it is."""

ARRAYS = ("q", "dq", "tau_motor_1")
"""What the arrays of `sensor_msgs/JointState` hold: position, velocity, effort."""

OTHER_THAN_MEASURED = (
    *("desired", "command", "commanded", "target", "reference", "ref", "goal", "error", "setpoint"),
)
"""Words that speak of something else than what a joint did."""

WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")

_INDEX = re.compile(r"[\[_ ]?(\d+)")
_SEPARATORS = re.compile(r"[./\s]")


class Guess(NamedTuple):
    """What a column may stand for.

    Attributes:
        place: of the column, from 0.
        joint: name of the joint.
        quantity: what of it.
        source: what a mapping says of the column.
        reason: why, a clause.
        sure: whether the names themselves say so.
    """

    place: int
    joint: str
    quantity: str
    source: MappedColumn
    reason: str
    sure: bool

    @property
    def name(self) -> str:
        """What the column is called here."""
        return f"{self.joint}.{self.quantity}"


class _Column(NamedTuple):
    """A column of a quantity.

    Attributes:
        place: of the column, from 0.
        quantity: what of a joint.
        before: its name before the word for the quantity.
        entry: index in an array.
    """

    place: int
    quantity: str
    before: str = ""
    entry: int | None = None


def guesses(rows: FirstRows, time: TimeColumn | None, joint_names: Sequence[str]) -> list[Guess]:
    """What the columns may stand for, each name once.

    Args:
        rows: the first rows.
        time: the stamps.
        joint_names: of the robot that was recorded; empty if it is not known.
    """
    columns, labels = _named_columns(rows, time), _labels(rows)
    if not rows.header.line:
        columns, labels = _joint_states(rows, time)
    found: dict[str, Guess] = {}
    for quantity in QUANTITIES:
        of_it = [column for column in columns if column.quantity == quantity]
        for rank, column in enumerate(of_it):
            joint, reason, sure = _joint(column, rank, labels, joint_names)
            source, doubt = _source(rows, column)
            reasons = "; ".join(filter(None, (reason, doubt)))
            guess = Guess(column.place, joint, quantity, source, reasons, sure)
            if joint:
                found.setdefault(guess.name, guess)
    return sorted(found.values(), key=lambda guess: (guess.quantity not in TAKEN, guess.place))


def _named_columns(rows: FirstRows, time: TimeColumn | None) -> list[_Column]:
    """Columns whose names have a word for a quantity, those that were measured before others."""
    places = [place for place in rows.of_numbers if time is None or place != time.place]
    columns = [column for place in places for column in _of_name(rows, place)]
    columns.sort(key=lambda column: any(word in OTHER_THAN_MEASURED for word in _split(column.before)))
    return columns


def _of_name(rows: FirstRows, place: int) -> Iterator[_Column]:
    name = split_heading(rows.columns[place])[0]
    for match in reversed(list(WORDS.finditer(name))):
        quantity = next((key for key, known in QUANTITIES.items() if match[0].lower() in known), None)
        if quantity is not None:
            entry = _INDEX.match(name, match.end())
            yield _Column(place, quantity, name[: match.start()], int(entry[1]) if entry else None)
            return


def _labels(rows: FirstRows) -> dict[int, str]:
    """Names of joints that stand in the rows, as ROS writes them, by their indices in arrays."""
    labels = {}
    for place, column in enumerate(rows.columns):
        words = _split(column)
        if len(words) > 1 and words[-2] == "name" and words[-1].isdecimal() and rows.text(place):
            labels[int(words[-1])] = rows.text(place)
    return labels


def _joint_states(rows: FirstRows, time: TimeColumn | None) -> tuple[list[_Column], dict[int, str]]:
    """The columns of `sensor_msgs/JointState` without a header: stamp, frame, names, then three arrays."""
    first = None if time is None or time.nanoseconds is None else time.nanoseconds + 2
    texts = [place for place in range(first or 0, len(rows.columns)) if rows.text(place)]
    count = next((number for number, place in enumerate(texts) if place != texts[0] + number), len(texts))
    if first is None or texts[:1] != [first]:
        return [], {}
    numbers = range(first + count, min(first + 4 * count, len(rows.columns)))
    columns = [
        _Column(place, ARRAYS[at // count], entry=at % count)
        for at, place in enumerate(numbers)
        if rows.numbers(place)
    ]
    return columns, {number: rows.text(first + number) for number in range(count)}


def _joint(
    column: _Column, rank: int, labels: dict[int, str], joint_names: Sequence[str]
) -> tuple[str, str, bool]:
    """Which joint a column is of, why, and whether that is sure; no name if it is none that is known."""
    label = None if column.entry is None else labels.get(column.entry)
    if label is not None:
        joint = _in_words(_split(label), joint_names) if joint_names else label
        return (joint if IDENTIFIER.fullmatch(joint) else ""), f"the rows call it {label}", joint == label
    joint = _in_words(_split(column.before), joint_names)
    if joint:
        return joint, "", True
    if joint_names:
        if rank < len(joint_names):
            return joint_names[rank], f"joint {rank + 1} of the robot, by the order alone", False
        return "", "", False
    last = _SEPARATORS.split(column.before.rstrip("_-./ "))[-1]
    if column.entry is None and IDENTIFIER.fullmatch(last) and last.lower() not in GENERIC:
        return last, "", True
    return f"joint_{rank + 1}", "by the order alone", False


def _in_words(words: Sequence[str], joint_names: Sequence[str]) -> str:
    """The joint whose name stands in these words, the longest if several do; empty if none does."""
    text = f" {' '.join(words)} "
    there = [joint for joint in joint_names if f" {' '.join(_split(joint))} " in text]
    return max(there, key=len, default="")


def _split(name: str) -> tuple[str, ...]:
    return tuple(word.lower() for word in WORDS.findall(name))


def _source(rows: FirstRows, column: _Column) -> tuple[MappedColumn, str]:
    """What a mapping says of a column, and what is doubtful about its unit."""
    heading = rows.columns[column.place]
    own = split_heading(heading)[1]
    source = MappedColumn(column=rows.called(column.place), unit=own)
    spoken = source.doubt(heading)
    if spoken is not None:
        return MappedColumn(column=source.column, unit=spoken), f"its name speaks of {spoken}"
    largest = max(map(abs, rows.numbers(column.place)), default=math.nan)
    if own is None and column.quantity == "q" and largest > LARGEST_ANGLE:
        return source, f"goes to {largest:.4g}: if these are degrees, add unit: deg"
    return source, ""
