"""Assignment of the columns of a table to quantities of joints and axes, with conversion of units.

`column_layout` reports all problems of a header together: misspelled, unknown and missing columns, with one
message for each fault.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError, Problem
from vsacli.base.renamed import successor
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.base.texts import listed, together
from vsacli.base.variables import VARIABLES
from vsacli.base.wrench import wrench_columns
from vsacli.documents.csv_file import group_column_problems, split_heading
from vsacli.documents.expression import conversion_factor
from vsacli.documents.time_column import TIME
from vsacli.robot.commanded_joints import CommandedJoints

RATE_INSTEAD = (
    "if the rows are equally spaced, give their rate: --set rate=HZ, or rate in a trajectory or columns file"
)

MOST_NAMED = 3
"""Most unknown columns of which all are named."""

MOST_PRESENT = 8
"""Most columns of a file that a message on a missing column lists."""

_PARENTHESISED = re.compile(r"(?P<name>[^()]*?)\s*\((?P<unit>[^()]*)\)")


@dataclass(frozen=True)
class ColumnNames:
    """The names of the columns of a table, compared with those that are expected.

    Attributes:
        names: names of all columns, without units.
        possible: all possible names.
        expected: names in the naming that the header uses.
        joint_names: names of the joints.
        file: path of the file.
        renaming: advice for columns with other names, a clause.
    """

    names: Sequence[str]
    possible: Collection[str]
    expected: Sequence[str]
    joint_names: Sequence[str]
    file: str
    renaming: str

    @cached_property
    def parenthesised_units(self) -> dict[str, re.Match[str]]:
        """Name and unit of the known columns whose unit is in parentheses, by the whole name."""
        matches = {name: _PARENTHESISED.fullmatch(name) for name in self.names if name not in self.possible}
        return {
            name: match
            for name, match in matches.items()
            if match is not None and match["name"] in self.possible
        }

    @cached_property
    def intended_columns(self) -> dict[str, str]:
        """The column that each renamed or misspelled one probably stands for."""
        unknown = [name for name in self.names if name not in {*self.possible, *self.parenthesised_units}]
        return self.find_intended_columns(
            unknown, [column for column in self.expected if column not in self.names]
        )

    @property
    def accounted_names(self) -> set[str]:
        """Names of the columns that are there, if under a wrong name."""
        return {
            *self.names,
            *self.intended_columns.values(),
            *(each["name"] for each in self.parenthesised_units.values()),
        }

    @property
    def is_foreign(self) -> bool:
        """Whether no column but the time is known, and not all others are misspelled ones."""
        signals = {*self.possible} - {TIME}
        return signals.isdisjoint(self.names) and bool(
            self.unknown_names or signals.isdisjoint(self.accounted_names)
        )

    def find_intended_columns(self, unknown: Collection[str], missing: Sequence[str]) -> dict[str, str]:
        """Return the columns that probably stand for known ones, renamed or `missing`, with these."""
        near_names = {
            name: successor(name, self.possible) or probable_column(name, missing) for name in unknown
        }
        return {name: intended for name, intended in near_names.items() if intended is not None}

    @cached_property
    def unknown_names(self) -> list[str]:
        """Names that are unknown, one of which may be a missing column under another name."""
        return [
            name
            for name in self.names
            if name not in {*self.possible, *self.parenthesised_units, *self.intended_columns}
        ]

    def naming_problems(self) -> Iterator[str]:
        """Yield problems of names: misspellings and units in parentheses."""
        yield from misspellings(self.intended_columns)
        for name, parts in self.parenthesised_units.items():
            yield f"{name!r}: units are written in square brackets, {parts['name']} [{parts['unit']}]"

    def unknown_column_problems(self) -> Iterator[str]:
        """Yield one problem for all unknown columns, if there are any."""
        if self.unknown_names:
            yield (
                f"{_describe_unknown_columns(self.unknown_names)}; to leave columns out or to rename them,"
                f" {self.renaming}"
            )

    def missing_time_problems(self, otherwise: str) -> Iterator[str]:
        """Yield that no column holds times, if so; `otherwise` is the advice if all columns are known."""
        if TIME not in self.accounted_names:
            yield (
                f"there is no column {TIME!r};"
                f" {self._advise_other_name(1) if self.unknown_names else otherwise}"
            )

    def missing_column_problems(
        self, naming: Mapping[str, Mapping[int, str]], needed: Collection[str]
    ) -> Iterator[str]:
        """Yield problems of missing and unknown columns: one for both, if a name may be the reason.

        Args:
            naming: expected columns of each quantity, by index of the joint or wrench axis.
            needed: quantities that are required.
        """
        accounted = self.accounted_names
        yield from self.missing_time_problems(RATE_INSTEAD)
        may_be_renamed = TIME not in accounted and bool(self.unknown_names)
        for name, columns in naming.items():
            missing_columns = {index: column for index, column in columns.items() if column not in accounted}
            if not missing_columns:
                continue
            all_missing = len(missing_columns) == len(columns)
            if name in needed and not (name in COMMANDED and all_missing):
                may_be_renamed = True
                meaning = self._describe_joints_without_column(name, missing_columns)
                yield (
                    f"{_describe_missing_columns(missing_columns)}{meaning}; "
                    f"{self._advise_other_name(len(missing_columns))}"
                )
            elif name in needed:
                yield f"{_describe_missing_columns(missing_columns)}; {self._advise_combination(name)}"
            elif not all_missing:
                members = "axes" if _is_of_wrench(name) else "joints"
                yield (
                    f"{_describe_missing_columns(missing_columns)}; {name} is given for all {members} "
                    "or for none"
                )
        if not may_be_renamed:
            yield from self.unknown_column_problems()

    def _advise_other_name(self, missing: int) -> str:
        """Return the columns one of which may be missing, and what to do then, as two clauses."""
        condition = "if it has another name" if missing == 1 else "if they have other names"
        columns = (
            _describe_unknown_columns(self.unknown_names)
            if self.unknown_names
            else f"columns: {listed(self.names, MOST_PRESENT)}"
        )
        return f"{columns}; {condition}, {self.renaming}"

    def _advise_combination(self, signal: str) -> str:
        motion = f"position: {{type: csv, file: {self.file}}}"
        return f"a YAML trajectory can combine the motion of this file ({motion}) with a {signal}"

    def _describe_joints_without_column(self, name: str, missing_columns: Mapping[int, str]) -> str:
        """Return the meaning of missing columns in parentheses; empty for those of a wrench."""
        if _is_of_wrench(name):
            return ""
        key = POSITION.key if name in POSITION.names else name
        return (
            f" ({key} of joint{'s'[: len(missing_columns) > 1]} "
            f"{together(list(missing_columns), self.joint_names)})"
        )


def _is_of_wrench(quantity: str) -> bool:
    return quantity.rpartition(".")[2] in WRENCH.names


def probable_column(column: str, missing: Sequence[str]) -> str | None:
    """Return the missing column that an unknown one probably stands for, or None.

    Of a joint's columns only the part that is wrong is compared: `shoulder.theta` shares its joint with
    `shoulder.dq`, and nothing else.
    """
    joint, dot, quantity = column.partition(".")
    missing_parts = [each.partition(".") for each in missing]
    if not dot or not any(separator for _, separator, _ in missing_parts):
        return nearest(column, missing)
    nearest_name = nearest(quantity, [each for name, _, each in missing_parts if name == joint])
    if nearest_name is not None:
        return f"{joint}.{nearest_name}"
    nearest_name = nearest(joint, [name for name, _, each in missing_parts if each == quantity])
    return None if nearest_name is None else f"{nearest_name}.{quantity}"


def misspellings(intended_columns: Mapping[str, str]) -> Iterator[str]:
    """Yield one problem for all columns with the same mistake, in the joint or in the quantity."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for column, intended in intended_columns.items():
        parts = zip(column.split("."), intended.split("."), strict=False)
        mistake = [part for pair in parts if pair[0] != pair[1] for part in pair]
        groups.setdefault(tuple(mistake), []).append(column)
    for columns in groups.values():
        intended_names = [intended_columns[each] for each in columns]
        if successor(columns[0], intended_names) is None:
            yield f"{_describe_unknown_columns(columns)}; did you mean {_quote_columns(intended_names)}?"
        else:
            verb = "it is" if len(columns) == 1 else "they are"
            yield f"{_describe_unknown_columns(columns)}; {verb} now {_quote_columns(intended_names)}"


def _describe_unknown_columns(columns: Sequence[str]) -> str:
    words = "unknown column" if len(columns) == 1 else f"{len(columns)} unknown columns:"
    return f"{words} {_quote_columns(columns)}"


def _quote_columns(columns: Sequence[str]) -> str:
    return repr(columns[0]) if len(columns) == 1 else listed(columns, MOST_NAMED)


def _describe_missing_columns(missing_columns: Mapping[int, str]) -> str:
    words = "the column {} is missing" if len(missing_columns) == 1 else "the columns {} are missing"
    return words.format(", ".join(missing_columns.values()))


Naming = dict[str, dict[int, str]]
"""Names of the columns of each quantity, by index of the joint or wrench axis."""

NAMINGS = ("{joint}.{name}{ending}", "{name}{number}{ending}")
"""Patterns of column names: by joint, and by the joint's number; motors have an ending, `_1` or `_2`."""


@dataclass(frozen=True)
class SignalColumn:
    """A column of a table.

    Attributes:
        index: index in the table, from 0.
        name: name in the header, without the unit.
        factor: factor from its numbers to SI units.
    """

    index: int
    name: str
    factor: float


@dataclass(frozen=True)
class ColumnLayout:
    """The columns of quantities in a table.

    Attributes:
        time: column of the times.
        quantities: columns of each quantity in the table, e.g. `dq`, by index of the joint or axis.
        unused: names of columns of joints that their signal does not command, by signal key.
    """

    time: SignalColumn
    quantities: Mapping[str, Mapping[int, SignalColumn]]
    unused: Mapping[str, Sequence[str]]


def trajectory_column_names(joints: CommandedJoints) -> set[str]:
    """Return all possible column names of a recorded trajectory of these joints."""
    return {
        TIME,
        *_names_in_naming(_name_wrench_columns(joints)),
        *(name for naming in _namings_of_all_joints(joints) for name in _names_in_naming(naming)),
    }


def _namings_of_all_joints(joints: CommandedJoints) -> list[Naming]:
    """Return both namings of columns, as if every signal commanded all joints."""
    return [_name_columns(pattern, CommandedJoints(joints.types, exempt={})) for pattern in NAMINGS]


def column_layout(
    header: Sequence[str],
    joints: CommandedJoints,
    required_signals: Sequence[Signal],
    file: str,
    line: int = 1,
) -> ColumnLayout:
    """Return the columns of the quantities in a table.

    Columns of joints are named `<joint>.<quantity>`, or `<quantity><i>` with i counted from 1, in one way
    throughout. Columns of wrenches are named by `wrench_columns`. A unit in brackets may follow any name.

    Args:
        header: names of all columns, without duplicates.
        joints: commanded joints. Each must have a column of each quantity that any joint has, except of
            signals that do not command it; such columns are allowed, but not in the layout.
        required_signals: signals whose values are required; their derivatives are optional.
        file: path of the file, for messages.
        line: line of the header, for messages.

    Raises:
        InputError: the header has problems; lists each.
    """
    headings = [split_heading(text) for text in header]
    names = [name for name, _ in headings]
    namings = [_name_columns(pattern, joints) for pattern in NAMINGS]
    used_namings = [
        naming for naming in namings if any(column in names for column in _names_in_naming(naming))
    ]
    naming = used_namings[0] if used_namings else namings[0]
    wrenches = (name for signal in required_signals if signal.is_wrench for name in signal.names)
    expected = [
        TIME,
        *_names_in_naming(naming),
        *(axis for name in wrenches for axis in wrench_columns(name)),
    ]

    renaming = f"use a trajectory file as printed by vsacli info {file}"
    column_names = ColumnNames(names, trajectory_column_names(joints), expected, joints.names, file, renaming)
    if column_names.is_foreign:
        examples = ", ".join(expected[:2])
        advice = (
            f"for a motor catalog use --catalog {file}"
            if "inertia" in names
            else f"vsacli info {file} --robot ROBOT --field trajectory writes a file to use in its place"
        )
        message = f"is not a trajectory: expected columns such as {examples}; {advice}"
        raise InputError.one(message, file, line)
    problems = list(column_names.naming_problems())
    naming = naming | _name_wrench_columns(joints)
    if len(used_namings) == len(namings):
        examples = " and ".join(
            repr(next(column for column in names if column in _names_in_naming(naming))) for naming in namings
        )
        problems.append(f"columns are named both by joint and by number ({examples}); use one way")
        problems += column_names.unknown_column_problems()
    else:
        problems += column_names.missing_column_problems(
            naming, {signal.names[0] for signal in required_signals}
        )
    factors = unit_factors(headings, _column_units(naming, joints), problems)
    columns = {names[index]: SignalColumn(index, names[index], factor) for index, factor in factors.items()}
    if problems:
        raise InputError(Problem(file, line, problem) for problem in problems)
    all_namings = _namings_of_all_joints(joints)
    columns_by_signal = {
        key: {column for each in all_namings for name in signal.names for column in each[name].values()}
        for key, signal in COMMANDED.items()
    }
    return _assemble_layout(names, columns, naming, columns_by_signal)


def _assemble_layout(
    names: Sequence[str],
    columns: Mapping[str, SignalColumn],
    naming: Naming,
    columns_by_signal: Mapping[str, Collection[str]],
) -> ColumnLayout:
    """Return the columns of quantities of which no column is missing."""
    return ColumnLayout(
        time=columns[TIME],
        quantities={
            name: {index: columns[column] for index, column in joint_columns.items()}
            for name, joint_columns in naming.items()
            if all(column in columns for column in joint_columns.values())
        },
        unused={
            key: [column for column in names if column in signal_columns and column not in columns]
            for key, signal_columns in columns_by_signal.items()
        },
    )


def _name_columns(pattern: str, joints: CommandedJoints) -> Naming:
    commanded = ((signal, joints.joints_of(signal).items()) for signal in (POSITION, *COMMANDED.values()))
    return {
        name: {
            index: pattern.format(name=name, joint=joint, number=index + 1, ending="")
            for index, joint in joints_of_signal
        }
        for signal, joints_of_signal in commanded
        for name in signal.names
    }


def _name_wrench_columns(joints: CommandedJoints) -> Naming:
    """Return the columns of wrenches by tool, and those of the only tool, which need no name."""
    signals = (*(() if len(joints.tools) > 1 else (WRENCH,)), *joints.wrenches.values())
    return {name: dict(enumerate(wrench_columns(name))) for signal in signals for name in signal.names}


def _names_in_naming(naming: Naming) -> list[str]:
    return [column for columns in naming.values() for column in columns.values()]


def _column_units(naming: Naming, joints: CommandedJoints) -> dict[str, str]:
    """Return the units of columns by name."""
    types = tuple(joints.types.values())
    return {TIME: VARIABLES[TIME].quantity.unit("")} | {
        column: VARIABLES[quantity.rpartition(".")[2]].quantity.of_component(index, types)
        for quantity, columns in naming.items()
        for index, column in columns.items()
    }


def unit_factors(
    headings: Sequence[tuple[str, str | None]], units: Mapping[str, str], problems: list[str]
) -> dict[int, float]:
    """Return the factors from known columns to their units, by position in a header.

    Args:
        headings: names of columns, each with its own unit, or None for that of the table.
        units: units by known names.
        problems: list to which units that cannot be converted are added.
    """
    factors: dict[int, float] = {}
    unit_problems: list[tuple[str, str]] = []
    for index, (name, unit) in enumerate(headings):
        if name in units:
            try:
                factors[index] = 1.0 if unit is None else conversion_factor(unit, units[name])
            except InputError as error:
                unit_problems.append((name, str(error)))
    problems.extend(group_column_problems(unit_problems))
    return factors
