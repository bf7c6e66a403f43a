"""Likely meanings of the columns of a recording, each with its reason."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from typing import NamedTuple

from vsacli.documents.column_mapping import MappedColumn
from vsacli.documents.csv_file import split_heading
from vsacli.documents.fields import IDENTIFIER
from vsacli.files.recordings.first_rows import FirstRows, TimeColumn
from vsacli.trajectory.recorded.header_words import (
    AXES,
    COMMANDED,
    ERROR,
    GENERIC,
    MOTOR_WORDS,
    OF_MOTORS,
    PLAIN,
    POSES,
    QUANTITIES,
    ROLES,
    WORDS,
    JointNames,
    motor_of,
    role_of,
    side_of,
    words_of_column_name,
)
from vsacli.trajectory.recorded.thresholds import LARGEST_ANGLE

TAKEN = ("q", "stiffness")
"""Quantities that are proposed in a trajectory file; others become comments there."""

VARIABLES_OF_MOTORS = ("theta_1", "theta_2", "tau_motor_1", "tau_motor_2")
"""Quantities that are proposed in a mapping for `compare` and `identify` if the names say of which motor."""

COMMAND = "a command, not a measurement"
"""Reason of a column that is proposed for lack of a measured one."""

ARRAYS = ("q", "dq", "tau_motor_1")
"""Content of the arrays of `sensor_msgs/JointState`: position, velocity, effort."""

_STIFFNESS = re.compile(r"k[_ -]?\d+", re.IGNORECASE)
"""Regular expression of the whole name of a stiffness in short; gains, such as `Kp1`, do not match."""

_INDEX = re.compile(r"[\[_ ]?(\d+)")
_SEPARATORS = re.compile(r"[./\s]")


class Guess(NamedTuple):
    """A likely meaning of a column.

    Attributes:
        place: position of the column, from 0.
        joint: name of the joint.
        quantity: quantity of the joint.
        source: entry of the column in a mapping.
        reason: reason, a clause.
        sure: whether the names are unambiguous.
        of_motor: whether the name of the column says of which motor it is.
    """

    place: int
    joint: str
    quantity: str
    source: MappedColumn
    reason: str
    sure: bool
    of_motor: bool = False

    @property
    def name(self) -> str:
        """Name of the column in this package."""
        return f"{self.joint}.{self.quantity}"


class _QuantityColumn(NamedTuple):
    """A column of a quantity.

    Attributes:
        place: position of the column, from 0.
        quantity: quantity of a joint.
        before: part of the name before the word for the quantity.
        words: words of the name, without that for the quantity.
        entry: index in an array.
        bare: whether the name has no word for a quantity.
        of_motor: whether the name says of which motor it is.
        sided: whether it says so by left or right.
        role: role of the column, a key of `ROLES`; its words are in neither `before` nor `words`.
    """

    place: int
    quantity: str
    before: str = ""
    words: tuple[str, ...] = ()
    entry: int | None = None
    bare: bool = False
    of_motor: bool = False
    sided: bool = False
    role: str = PLAIN

    @property
    def signal(self) -> tuple[object, ...]:
        """The same for all variants of a signal, such as raw, filtered and commanded positions of a joint."""
        words = (word for word in self.words if word not in GENERIC)
        return self.quantity, self.bare, self.of_motor, *words

    @property
    def of_motors(self) -> bool:
        """Whether the name speaks of motors."""
        return any(word in MOTOR_WORDS for word in self.words)

    @property
    def family(self) -> tuple[str, ...]:
        """Words of the name that are common to the same signal of other joints."""
        return tuple("#" if word.isdecimal() or len(word) == 1 else word for word in self.words)


class _GuessedJoint(NamedTuple):
    """The joint of a column, the reason, and whether the name is unambiguous."""

    name: str
    reason: str = ""
    sure: bool = True


def guesses(rows: FirstRows, time: TimeColumn | None, joint_names: Sequence[str]) -> list[Guess]:
    """Return likely meanings of the columns, each name once.

    Args:
        rows: first rows of the table.
        time: column of stamps, if there is one.
        joint_names: joints of the robot that was recorded; empty if unknown.
    """
    columns, labels = (
        (_columns_by_name(rows, time), _labels_in_rows(rows))
        if rows.header.line
        else _joint_states(rows, time)
    )
    guesses_by_name: dict[str, Guess] = {}
    names = JointNames(joint_names)
    if joint_names:
        columns = _sided([_as_motor_column(column, names) for column in columns], names)
    best_roles = {column.signal: column.role for column in reversed(columns)}
    columns = [column for column in columns if column.role == best_roles[column.signal]]
    assign = partial(_assign_robot_joints, joints=names) if joint_names else _assign_named_joints
    for quantity in dict.fromkeys((*QUANTITIES, *VARIABLES_OF_MOTORS)):
        quantity_columns = [column for column in columns if column.quantity == quantity != "theta"]
        measured = [column for column in quantity_columns if column.role != COMMANDED]
        # commands only if, by name or order, none of the joints has a measurement
        for column, joint in list(assign(measured, labels)) or assign(quantity_columns, labels):
            source, doubt = _column_source(rows, column)
            command = COMMAND if column.role == COMMANDED else ""
            sides = "sides taken for motors 1 and 2" * column.sided
            reasons = "; ".join(filter(None, (joint.reason, sides, command, doubt)))
            sure = joint.sure and not column.sided
            guess = Guess(column.place, joint.name, quantity, source, reasons, sure, column.of_motor)
            guesses_by_name.setdefault(guess.name, guess)
    return sorted(guesses_by_name.values(), key=lambda guess: (guess.quantity not in TAKEN, guess.place))


def _columns_by_name(rows: FirstRows, time: TimeColumn | None) -> list[_QuantityColumn]:
    """Return columns of joints by their names: with a quantity first, then in the order of the roles."""
    column_indices = [
        column_index for column_index in rows.of_numbers if time is None or column_index != time.place
    ]
    columns = [
        column
        for column_index in column_indices
        if not rows.is_index(column_index)
        for column in _meanings_by_name(rows, column_index)
    ]
    columns.sort(key=lambda column: (column.of_motors, column.bare, list(ROLES).index(column.role)))
    return [column for column in columns if column.role != ERROR]


def _meanings_by_name(rows: FirstRows, column_index: int) -> Iterator[_QuantityColumn]:
    """Yield the meaning of a column by its name; a name without a word for a quantity may mean a position."""
    heading = split_heading(rows.columns[column_index])[0]
    role, name = role_of(heading)
    if _STIFFNESS.fullmatch(name.strip("_ ")) and min(rows.numbers(column_index)) > 0:
        yield _QuantityColumn(column_index, "stiffness", words=words_of_column_name(name)[1:], role=role)
        return
    for match in reversed(list(WORDS.finditer(name))):
        quantity = next(
            (key for key, known_words in QUANTITIES.items() if match[0].lower() in known_words), None
        )
        if quantity is not None:
            entry = _INDEX.match(name, match.end())
            before_quantity, words = (
                name[: match.start()],
                (*words_of_column_name(name[: match.start()]), *words_of_column_name(name[match.end() :])),
            )
            yield _QuantityColumn(
                column_index, quantity, before_quantity, words, int(entry[1]) if entry else None, role=role
            )
            return
    if heading:
        yield _QuantityColumn(column_index, "q", heading, words_of_column_name(heading), bare=True, role=role)


def _as_motor_column(column: _QuantityColumn, joints: JointNames) -> _QuantityColumn:
    """Return a column as that of a motor if its name says of which motor it is, otherwise unchanged."""
    variable = OF_MOTORS.get(column.quantity)
    if variable is None or (column.quantity == "q" and not column.of_motors):
        return column
    match = motor_of(column.words, joints)
    if match is None:
        return column
    motor, words = match
    return _QuantityColumn(
        column.place, f"{variable}_{motor}", column.before, words, of_motor=True, role=column.role
    )


def _sided(columns: Sequence[_QuantityColumn], joints: JointNames) -> list[_QuantityColumn]:
    """Return columns as those of motors where both sides of a joint are there.

    Positions of sides are those of motors only next to a position of the joint; they may be two arms else.
    """
    of_side = {
        column.place: (side[0], (column.quantity, *side[1]))
        for column in columns
        if column.quantity in ("q", "tau_motor_1") and (side := side_of(column.words, joints))
    }
    sides = set(of_side.values())
    of_joints = {(column.quantity, *column.words) for column in columns if not column.bare}
    pairs = {
        signal
        for motor, signal in sides
        if (3 - motor, signal) in sides and (signal[0] != "q" or signal in of_joints)
    }
    return [
        column._replace(
            quantity=f"{OF_MOTORS[column.quantity]}_{motor}", words=signal[1:], of_motor=True, sided=True
        )
        if signal in pairs
        else column
        for column in columns
        for motor, signal in [of_side.get(column.place, (0, ()))]
    ]


def _labels_in_rows(rows: FirstRows) -> dict[int, str]:
    """Return joint names found in the rows, as ROS writes them, by their indices in arrays."""
    words_by_column = [words_of_column_name(column) or ("",) for column in rows.columns]
    return {
        int(last_word): rows.text(column_index)
        for column_index, (*prefix, last_word) in enumerate(words_by_column)
        if prefix[-1:] == ["name"] and last_word.isdecimal() and rows.text(column_index)
    }


def _joint_states(rows: FirstRows, time: TimeColumn | None) -> tuple[list[_QuantityColumn], dict[int, str]]:
    """Return the columns of a `sensor_msgs/JointState` without header: stamp, frame, names, three arrays."""
    first_name = None if time is None or time.nanoseconds is None else time.nanoseconds + 2
    text_columns = [
        column_index for column_index in range(first_name or 0, len(rows.columns)) if rows.text(column_index)
    ]
    count = next(
        (rank for rank, column_index in enumerate(text_columns) if column_index != text_columns[0] + rank),
        len(text_columns),
    )
    if first_name is None or text_columns[:1] != [first_name]:
        return [], {}
    numeric_columns = range(first_name + count, min(first_name + 4 * count, len(rows.columns)))
    columns = [
        _QuantityColumn(column_index, ARRAYS[entry // count], entry=entry % count)
        for entry, column_index in enumerate(numeric_columns)
        if rows.numbers(column_index)
    ]
    return columns, {rank: rows.text(first_name + rank) for rank in range(count)}


def _assign_robot_joints(
    columns: Sequence[_QuantityColumn], labels: Mapping[int, str], joints: JointNames
) -> list[tuple[_QuantityColumn, _GuessedJoint]]:
    """Return columns with the joints that their names indicate; if none does, one family in joint order."""
    families = defaultdict(list)
    for column in columns:
        families[column.family].append(column)
    complete_families = (
        family
        for family in families.values()
        if len(family) == len(joints.names) and not any(map(_is_no_joint, family))
    )
    return [pair for family in families.values() for pair in _match_family(family, labels, joints)] or [
        (column, _GuessedJoint(name, f"joint {rank} of the robot, by the order alone", sure=False))
        for family in islice(complete_families, 1)
        for rank, (column, name) in enumerate(zip(family, joints.names, strict=True), 1)
    ]


def _match_family(
    family: Sequence[_QuantityColumn], labels: Mapping[int, str], joints: JointNames
) -> list[tuple[_QuantityColumn, _GuessedJoint]]:
    """Return the columns of a family that match joints, by their names or by names in their rows.

    If columns count from zero and joints from one, or vice versa, numbers are not used.
    """
    matched, unmatched = [], []
    for column in family:
        label = None if column.entry is None else labels.get(column.entry)
        if label is not None:
            name, reason = joints.in_words(words_of_column_name(label)), f"the rows call it {label}"
        elif column.bare:
            name, reason = joints.called(column.words), "named as the joint; taken for its position"
        else:
            name, reason = joints.in_words(column.words), ""
        if name:
            matched.append((column, _GuessedJoint(name, reason, label in (None, name))))
        elif label is None:
            unmatched.append(column)
    numbered_columns = [column for column in unmatched if any(word.isdecimal() for word in column.words)]
    is_shifted = len(family) == len(joints.names) or any("0" in column.words for column in numbered_columns)
    return [] if numbered_columns and is_shifted else matched


def _assign_named_joints(
    columns: Sequence[_QuantityColumn], labels: Mapping[int, str]
) -> Iterator[tuple[_QuantityColumn, _GuessedJoint]]:
    """Yield columns with joints named by their own names, or by names in their rows."""
    rank = 0
    for column in columns:
        label = None if column.entry is None else labels.get(column.entry)
        last_part = _SEPARATORS.split(column.before.rstrip("_-./ "))[-1]
        if label is None and _is_no_joint(column):
            continue
        rank += 1
        if label is not None:
            if IDENTIFIER.fullmatch(label):
                yield column, _GuessedJoint(label, f"the rows call it {label}")
        elif column.entry is None and IDENTIFIER.fullmatch(last_part) and last_part.lower() not in GENERIC:
            yield column, _GuessedJoint(last_part)
        else:
            yield column, _GuessedJoint(f"joint_{rank}", "by the order alone", sure=False)


def names_torque(heading: str) -> bool:
    """Return whether a name speaks of a measured torque, other than a moment of a force sensor."""
    role, name = role_of(split_heading(heading)[0])
    words = {*words_of_column_name(name)}
    return (
        role not in (COMMANDED, ERROR)
        and not words.isdisjoint(QUANTITIES["tau_motor_1"])
        and words.isdisjoint(AXES)
    )


def _is_no_joint(column: _QuantityColumn) -> bool:
    """Return whether a name indicates a pose, such as `tcp_pos_x`, or no quantity."""
    specific_words = [word for word in column.words if word not in GENERIC]
    return (
        column.bare
        or any(word in AXES for word in specific_words)
        or bool(specific_words and set(specific_words) <= {*POSES})
    )


def _column_source(rows: FirstRows, column: _QuantityColumn) -> tuple[MappedColumn, str]:
    """Return the mapping of a column, and a remark if its unit is uncertain."""
    heading = rows.columns[column.place]
    declared_unit = rows.unit(column.place)
    source = MappedColumn(column=rows.called(column.place), unit=declared_unit)
    unit_in_name = source.undeclared_unit(heading)
    if unit_in_name is not None:
        return MappedColumn(column=source.column, unit=unit_in_name), f"its name speaks of {unit_in_name}"
    largest = max(map(abs, rows.numbers(column.place)), default=math.nan)
    if declared_unit is None and column.quantity == "q" and largest > LARGEST_ANGLE:
        return source, f"goes to {largest:.4g}: if these are degrees, add unit: deg"
    return source, ""
