"""Assignment of the columns of a table to quantities of joints and axes, with conversion of units.

`column_layout` reports all problems of a header together.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from vsacli.base.errors import InputError, Problem
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.base.variables import VARIABLES
from vsacli.base.wrench import wrench_columns
from vsacli.documents.csv_file import group_column_problems, split_heading
from vsacli.documents.expression import conversion_factor
from vsacli.documents.time_column import TIME
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.trajectory.recorded.header_problems import ColumnNames

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
    wanted: Sequence[Signal],
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
        wanted: signals whose values are required; their derivatives are optional.
        file: path of the file, for messages.
        line: line of the header, for messages.

    Raises:
        InputError: the header has problems; lists each.
    """
    headings = [split_heading(text) for text in header]
    names = [name for name, _ in headings]
    namings = [_name_columns(pattern, joints) for pattern in NAMINGS]
    used = [naming for naming in namings if any(column in names for column in _names_in_naming(naming))]
    naming = used[0] if used else namings[0]
    wrenches = (name for signal in wanted if signal.is_wrench for name in signal.names)
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
    if len(used) == len(namings):
        examples = " and ".join(
            repr(next(column for column in names if column in _names_in_naming(naming))) for naming in namings
        )
        problems.append(f"columns are named both by joint and by number ({examples}); use one way")
        problems += column_names.unknown_column_problems()
    else:
        problems += column_names.missing_column_problems(naming, {signal.names[0] for signal in wanted})
    factors = unit_factors(headings, _column_units(naming, joints), problems)
    columns = {names[place]: SignalColumn(place, names[place], factor) for place, factor in factors.items()}
    if problems:
        raise InputError(Problem(file, line, problem) for problem in problems)
    of_all_joints = _namings_of_all_joints(joints)
    of_signals = {
        key: {column for each in of_all_joints for name in signal.names for column in each[name].values()}
        for key, signal in COMMANDED.items()
    }
    return _assemble_layout(names, columns, naming, of_signals)


def _assemble_layout(
    names: Sequence[str],
    columns: Mapping[str, SignalColumn],
    naming: Naming,
    of_signals: Mapping[str, Collection[str]],
) -> ColumnLayout:
    """Return the columns of quantities of which no column is missing."""
    return ColumnLayout(
        time=columns[TIME],
        quantities={
            name: {index: columns[column] for index, column in of_joints.items()}
            for name, of_joints in naming.items()
            if all(column in columns for column in of_joints.values())
        },
        unused={
            key: [column for column in names if column in of_signal and column not in columns]
            for key, of_signal in of_signals.items()
        },
    )


def _name_columns(pattern: str, joints: CommandedJoints) -> Naming:
    commanded = ((signal, joints.joints_of(signal).items()) for signal in (POSITION, *COMMANDED.values()))
    return {
        name: {
            index: pattern.format(name=name, joint=joint, number=index + 1, ending="")
            for index, joint in of_signal
        }
        for signal, of_signal in commanded
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
    refused: list[tuple[str, str]] = []
    for place, (name, unit) in enumerate(headings):
        if name in units:
            try:
                factors[place] = 1.0 if unit is None else conversion_factor(unit, units[name])
            except InputError as error:
                refused.append((name, str(error)))
    problems.extend(group_column_problems(refused))
    return factors
