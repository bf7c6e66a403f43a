"""Assignment of the columns of a recording to variables of a result or a robot, in their units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.simulation_variables import measured
from vsacli.base.texts import counted, listed
from vsacli.base.variables import MOTORS, VARIABLES, Variable
from vsacli.documents.column_mapping import ColumnMapping
from vsacli.documents.csv_file import split_heading
from vsacli.documents.table import CsvTable, read_table
from vsacli.documents.time_column import TIME
from vsacli.trajectory.recorded.columns import NAMINGS, ColumnNames, misspellings, unit_factors
from vsacli.trajectory.recorded.header_words import COMMANDED, role_of
from vsacli.trajectory.recorded.problems import replace_stamps, time_problems

EXAMPLE_VARIABLES = ("q", "tau_motor")
"""Variables that a message names as examples of columns."""


class Jointed(Protocol):
    """The subject of a recording: a result, or a robot."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Types of the joints."""

    @property
    def gear_ratio(self) -> FloatArray:
        """Gear ratios of the motors, (joints, 2); NaN where unknown."""

    def existing(self, variable: Variable) -> BoolArray:
        """Return the existing columns of a variable of joints, (joints, 1 or 2)."""


class Place(NamedTuple):
    """The place of a column.

    Attributes:
        variable: name of the variable that the column stands for.
        joint: index of the joint.
        motor: 1 or 2; None for variables of joints.
        unit: unit of values if the column names none.
        gear: factor to the joint side of the gear.
        rank: rank by how directly the column shows the motion of the robot; of columns for the same variable
            the highest counts.
    """

    variable: str
    joint: int
    motor: int | None
    unit: str
    gear: float = 1.0
    rank: int = 0

    @property
    def target(self) -> tuple[str, int, int | None]:
        """Variable, joint and motor."""
        return self.variable, self.joint, self.motor


@dataclass(frozen=True, eq=False)
class MeasuredSignal:
    """A recorded signal.

    Attributes:
        column: name in the recording.
        place: variable, joint and motor.
        values: values, (samples,), SI units on the joint side of the gear.
    """

    column: str
    place: Place
    values: FloatArray = field(repr=False)


class Recording(NamedTuple):
    """A recording of some variables.

    Attributes:
        time: times, (samples,) in s since the first sample.
        signals: signals in the order of the variables, then of the joints.
        table: table of the file; its `unknown_columns` are not among these variables.
        stranger: sentence on joints that the subject of the recording does not have; otherwise empty.
    """

    time: FloatArray
    signals: tuple[MeasuredSignal, ...]
    table: CsvTable
    stranger: str


def read_recording(
    path: str | Path,
    jointed: Jointed,
    variable_names: Iterable[tuple[str, int, Variable]],
    robot: str,
    mapping: ColumnMapping,
) -> Recording:
    """Return the columns of a CSV file that have a place, with NaN in empty cells.

    Args:
        path: file with a column `time`, and columns named as by `vsacli export`, or by the number of the
            joint, `q1` for the first; a unit in brackets may follow any name.
        jointed: subject of the recording.
        variable_names: names of variables in columns, see `known_columns`.
        robot: name of the subject's robot.
        mapping: mapping of other column names.

    Raises:
        InputError: no column has a place, a unit does not fit its variable, or the times do not ascend.
    """
    places = known_columns(jointed, variable_names)
    mapping = _mapping_of_signals(mapping, places, jointed)
    table = read_table(path, mapping, {TIME, *places}, empty_cells=True)
    table = table.without_empty_rows(stamped=True).with_joined_rows()
    headings = [split_heading(column) for column in table.columns]
    names = [name for name, _ in headings]
    unknown_names = [
        name for name, _ in map(split_heading, table.unknown_columns) if role_of(name)[0] != COMMANDED
    ]
    expected = (TIME,) if any(name in places for name in names) else (TIME, *places)
    header = ColumnNames(
        (*names, *unknown_names),
        {TIME, *places},
        expected,
        jointed.joint_names,
        table.source.path,
        "use --columns",
    )
    stranger = _unknown_joints_sentence(header, places, robot)
    problems = list(_header_problems(header, places, stranger))
    units = {TIME: "s", **{name: place.unit for name, place in places.items()}}
    factors = unit_factors(headings, units, problems)
    if problems:
        raise InputError(Problem(table.source.path, table.header.line, text) for text in problems)
    order = {name: number for number, name in enumerate(places)}
    signals = [
        MeasuredSignal(
            name, places[name], _in_si_units(table.values[:, index], factors[index], places[name], mapping)
        )
        for index, name in enumerate(names)
        if name in places
    ]
    signals.sort(key=lambda signal: order[signal.column])
    times = _elapsed_seconds(table, names.index(TIME), factors, mapping.rate)
    return Recording(times, tuple(signals), table, stranger)


def _mapping_of_signals(
    mapping: ColumnMapping, places: Mapping[str, Place], jointed: Jointed
) -> ColumnMapping:
    """Return a mapping without the other variables of the robot, so that one file serves all commands."""
    other_columns = known_columns(jointed, stand_ins(VARIABLES)).keys() - places.keys()
    columns = {name: source for name, source in mapping.columns.items() if name not in other_columns}
    return replace(mapping, columns=columns)


def stand_ins(variables: Mapping[str, Variable]) -> Iterator[tuple[str, int, Variable]]:
    """Yield possible names of columns, each with its rank and the variable that it stands for.

    Sensor readings, `q_measured`, take precedence over the plain name.

    Args:
        variables: variables by plain name.
    """
    for plain, variable in variables.items():
        for rank, name in enumerate((plain, measured(plain))):
            yield name, rank, variable


def known_columns(jointed: Jointed, named: Iterable[tuple[str, int, Variable]]) -> dict[str, Place]:
    """Return the places of all columns of joint variables, by possible name.

    Args:
        jointed: subject of the recording.
        named: names of variables in columns, with rank and variable, as from `stand_ins`.
    """
    return {
        column: place
        for name, rank, variable in named
        if "joint" in variable.dims and variable.name != "flags"
        for column, place in _names_and_places(jointed, name, rank, variable)
    }


def preferred(signals: Iterable[MeasuredSignal]) -> dict[tuple[str, int, int | None], MeasuredSignal]:
    """Return the most direct column for each variable of a joint or motor."""
    ranked = sorted(signals, key=lambda signal: signal.place.rank)
    return {signal.place.target: signal for signal in ranked}


def _names_and_places(
    jointed: Jointed, name: str, rank: int, variable: Variable
) -> Iterator[tuple[str, Place]]:
    """Yield names and places of the columns of a variable, for the joints and motors that have it."""
    is_of_motors = "motor" in variable.dims
    for joint, exists_by_motor in enumerate(jointed.existing(variable)):
        unit = variable.quantity.unit(jointed.joint_types[joint])
        for number in (motor for motor, exists in zip(MOTORS, exists_by_motor, strict=False) if exists):
            motor = number if is_of_motors else None
            ending = f"_{number}" if is_of_motors else ""
            place = Place(variable.name, joint, motor, unit, rank=rank)
            name_fields = {"joint": jointed.joint_names[joint], "number": joint + 1, "ending": ending}
            yield from ((pattern.format(name=name, **name_fields), place) for pattern in NAMINGS)
            ratio = float(jointed.gear_ratio[joint, number - 1])
            if variable.geared and np.isfinite(ratio):  # a shaft turns, whatever the joint does
                shaft_unit = variable.quantity.unit("revolute")
                shaft_place = place._replace(unit=shaft_unit, gear=ratio**-variable.geared)
                yield NAMINGS[0].format(name=f"{name}_shaft", **name_fields), shaft_place


MAX_LISTED_JOINTS = 7
"""Largest number of joints of a robot that a message lists."""


def _unknown_joints_sentence(header: ColumnNames, places: Mapping[str, Place], robot: str) -> str:
    """Return a sentence on columns of joints that the robot does not have; empty without any."""
    endings = {name.rpartition(".")[2] for name in places if "." in name}
    known_prefixes = tuple(f"{joint}." for joint in header.joint_names)
    split_names = [
        (name, *name.rpartition(".")) for name in header.names if not name.startswith(known_prefixes)
    ]
    columns = {name: joint for name, joint, _, ending in split_names if joint and ending in endings}
    intended_columns = header.find_intended_columns(
        columns, [name for name in places if name not in header.names]
    )
    if len(intended_columns) == len(columns):
        return "; ".join(misspellings(intended_columns))
    joints = dict.fromkeys(columns.values())
    joint_noun, verb, them = ("joint", "is", "its") if len(joints) == 1 else ("joints", "are", "their")
    location = f"not in {robot} ({listed(header.joint_names, MAX_LISTED_JOINTS)})"
    return (
        f"{joint_noun} {', '.join(map(repr, joints))} {verb} {location}: is this the recording of "
        f"another robot? If not, map or ignore {them} columns with --columns"
    )


def _header_problems(header: ColumnNames, places: Mapping[str, Place], stranger: str) -> Iterator[str]:
    """Yield problems of the header of a recording.

    Args:
        header: names of its columns, except for commands under unknown names.
        places: places by possible names of columns.
        stranger: sentence on unknown joints; otherwise empty.
    """
    if header.is_foreign:
        yield stranger or _no_known_column_text(header, places)
        return
    yield from header.naming_problems()
    yield from header.missing_time_problems(
        "if the rows are equally spaced, give their rate in a file for --columns"
    )
    first_names: dict[Place, str] = {}
    for name in filter(places.get, header.names):
        other = first_names.setdefault(places[name]._replace(unit="", gear=1.0), name)
        if other != name:
            yield f"columns {other!r} and {name!r} are the same signal; keep one"


def _no_known_column_text(header: ColumnNames, places: Mapping[str, Place]) -> str:
    """Return that no column of a recording is known, with the nearest or some possible names."""
    name_of_variable: dict[str, str] = {}
    for name, place in places.items():
        name_of_variable.setdefault(place.variable, name)
    example_names = [
        name_of_variable[name] for name in EXAMPLE_VARIABLES if name in name_of_variable
    ] or list(name_of_variable.values())[:2]
    suggestions = [
        f"; {name!r} may be {meant!r}" for name, meant in header.intended_columns.items() if meant in places
    ]
    hint = f"{''.join(suggestions[:1])}; if they have other names, {header.renaming}"
    return f"expected columns such as {', '.join([TIME, *example_names])}{hint}"


@np.errstate(over="ignore")  # an overflow to infinity means a missing sample
def _in_si_units(values: FloatArray, factor: float, place: Place, mapping: ColumnMapping) -> FloatArray:
    """Return values on the joint side of the gear, with angles unwrapped on demand."""
    if mapping.unwrap and place.unit == "rad":
        there = np.isfinite(values)
        angles = np.array(values * factor)
        angles[there] = np.unwrap(angles[there])
        return np.asarray(angles * place.gear)
    return np.asarray(values * (factor * place.gear))


def nearest_turn(angles: FloatArray, others: FloatArray) -> FloatArray:
    """Return unwrapped angles plus the whole turns that bring most of them nearest to others, (samples,)."""
    apart = (angles - others)[np.isfinite(angles - others)]
    turns = np.round(np.median(apart) / (2 * np.pi)) if apart.size else 0.0
    return np.asarray(angles - 2 * np.pi * turns)


def _elapsed_seconds(
    table: CsvTable, column_index: int, factors: Mapping[int, float], rate: float | None
) -> FloatArray:
    """Return the times since the first sample, s; with a stated rate it stands in place of wrong stamps."""
    time_stamps = table.values[:, column_index]
    if len(time_stamps) < 2:
        rows = counted(len(time_stamps), "row")
        raise InputError.one(f"has {rows}; a recording needs at least 2", table.source.path)
    times, is_replaced = replace_stamps(time_stamps * factors[column_index], rate)
    for problem in time_problems(times):
        raise InputError.one(f"time {problem.message}", table.source.path, table.line_of(problem.sample or 0))
    # subtraction before scaling: stamps since 1970 lose no digits
    return times if is_replaced else np.asarray((time_stamps - time_stamps[0]) * factors[column_index])
