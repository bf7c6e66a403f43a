"""Which column of a recording is which variable of a result or a robot, in the units of these."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, Problem
from vsacli.base.unit_expressions import conversion_factor
from vsacli.base.variables import MOTORS, Variable
from vsacli.documents.column_mapping import TIME, ColumnMapping
from vsacli.documents.table import Table, read_table
from vsacli.documents.table_header import split_heading


class Jointed(Protocol):
    """What a recording may be of: a result, or a robot."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        ...

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Their types."""
        ...

    @property
    def gear_ratio(self) -> FloatArray:
        """Of the motors, (joints, 2); NaN where it is not known."""
        ...

    def existing(self, variable: Variable) -> BoolArray:
        """Which columns of a variable of joints there are, (joints, 1 or 2)."""
        ...


class Place(NamedTuple):
    """Where a column belongs.

    Attributes:
        variable: its name.
        joint: its index.
        motor: 1 or 2, None if the variable is none of motors.
        unit: of numbers without a unit of their own.
        gear: what those are multiplied by to be on the joint side of the gear.
    """

    variable: str
    joint: int
    motor: int | None
    unit: str
    gear: float = 1.0


@dataclass(frozen=True, eq=False)
class Measured:
    """A recorded signal.

    Attributes:
        column: its name in the recording.
        place: what it is.
        values: (samples,), SI units, joint side of the gear.
    """

    column: str
    place: Place
    values: FloatArray = field(repr=False)


class Recording(NamedTuple):
    """What was recorded of some variables.

    Attributes:
        time: (samples,), s, from the first sample on.
        signals: in the order of the variables, then of the joints.
        others: names of the columns that are none of these variables, or are not to be read.
        table: the file.
    """

    time: FloatArray
    signals: tuple[Measured, ...]
    others: tuple[str, ...]
    table: Table


def read_recording(
    path: str | Path, places: Mapping[str, Place], owner: str, mapping: ColumnMapping
) -> Recording:
    """The columns of a CSV file that have a place, NaN in cells that are empty.

    Args:
        path: a file with a column `time`, and columns named as `vsacli export` names them, or by the number
            of the joint, `q1` for the first; a unit in brackets may follow any name.
        places: by the names that columns may have, see `known_columns`.
        owner: whose variables they are, for sentences.
        mapping: what columns with other names stand for.

    Raises:
        InputError: there is no such column, a unit is one of something else, or the times do not ascend.
    """
    table = read_table(path, mapping, {TIME, *places}, empty_cells=True)
    headings = [split_heading(column) for column in table.columns]
    names = [name for name, _ in headings]
    problems = [
        Problem(table.source.path, table.header_line, text)
        for text in _unusable(names, table.others, places, owner)
    ]
    factors: dict[int, float] = {}
    for index, (name, unit) in enumerate(headings):
        if name == TIME or name in places:
            try:
                factors[index] = _factor(unit, "s" if name == TIME else places[name].unit)
            except InputError as error:
                problems.append(Problem(table.source.path, table.header_line, f"column {name!r}: {error}"))
    if problems:
        raise InputError(problems)
    order = {name: number for number, name in enumerate(places)}
    signals = [
        Measured(name, places[name], table.values[:, index] * (factors[index] * places[name].gear))
        for index, name in enumerate(names)
        if name in places
    ]
    signals.sort(key=lambda signal: order[signal.column])
    others = (*table.others, *table.ignored)
    return Recording(_elapsed(table, factors[names.index(TIME)]), tuple(signals), others, table)


def known_columns(jointed: Jointed, variables: Iterable[Variable]) -> dict[str, Place]:
    """Every name that a column of some variables may have, those of joints."""
    return {
        name: place
        for variable in variables
        if "joint" in variable.dims and variable.name != "flags"
        for name, place in _names(jointed, variable)
    }


def _names(jointed: Jointed, variable: Variable) -> Iterator[tuple[str, Place]]:
    """Names of the columns of a variable, of those joints and motors that have it."""
    of_motors = "motor" in variable.dims
    for joint, there in enumerate(jointed.existing(variable)):
        unit = variable.quantity.unit(jointed.joint_types[joint])
        for number in (motor for motor, exists in zip(MOTORS, there, strict=False) if exists):
            motor = number if of_motors else None
            ending = f"_{number}" if of_motors else ""
            place = Place(variable.name, joint, motor, unit)
            yield f"{jointed.joint_names[joint]}.{variable.name}{ending}", place
            yield f"{variable.name}{joint + 1}{ending}", place
            ratio = float(jointed.gear_ratio[joint, number - 1])
            if variable.geared and np.isfinite(ratio):  # a shaft turns, whatever the joint does
                on_shaft = variable.quantity.unit("revolute")
                shaft = place._replace(unit=on_shaft, gear=ratio**-variable.geared)
                yield f"{jointed.joint_names[joint]}.{variable.name}_shaft{ending}", shaft


def _unusable(
    names: Sequence[str], strangers: Sequence[str], places: Mapping[str, Place], owner: str
) -> Iterator[str]:
    if TIME not in names:
        yield f"there is no column {TIME!r}{did_you_mean(TIME, strangers)}; --columns says which it is"
    found = [name for name in names if name in places]
    if not found:
        hint = next((hint for name in strangers if (hint := did_you_mean(name, places))), "")
        examples = ", ".join(list(places)[:3])
        say = "; `vsacli info` shows what the file has, and --columns says what it stands for"
        yield f"no column is a variable of {owner}, such as {examples}{hint or say}"
    for name in sorted({name for name in names if names.count(name) > 1 and name in places}):
        yield f"column {name!r} appears {names.count(name)} times"
    twice = {place: name for name in found if (place := places[name]._replace(unit="", gear=1.0))}
    for name in found:
        other = twice[places[name]._replace(unit="", gear=1.0)]
        if other != name:
            yield f"columns {name!r} and {other!r} are the same; leave one"


def _factor(unit: str | None, expected: str) -> float:
    return 1.0 if unit is None else conversion_factor(unit, expected)


def _elapsed(table: Table, factor: float) -> FloatArray:
    """Times from the first sample on, s; stamps since 1970 lose nothing."""
    names = [split_heading(column)[0] for column in table.columns]
    stamps = table.values[:, names.index(TIME)]
    if len(stamps) < 2:
        raise InputError.one("a recording needs two rows at least", table.source.path)
    back = np.flatnonzero(~(np.diff(stamps) > 0))
    if back.size:
        line = table.line_of(int(back[0]) + 1)
        raise InputError.one("the times must ascend from row to row", table.source.path, line)
    return np.asarray((stamps - stamps[0]) * factor)
