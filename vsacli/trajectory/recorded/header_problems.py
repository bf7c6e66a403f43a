"""Problems of the header of a table: misspelled, unknown and missing columns, one message for each fault."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from vsacli.base.did_you_mean import nearest
from vsacli.base.renamed import successor
from vsacli.base.signals import COMMANDED, POSITION, WRENCH
from vsacli.base.texts import listed, together
from vsacli.documents.time_column import TIME

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
        return {name: near for name, near in near_names.items() if near is not None}

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
        renamed = TIME not in accounted and bool(self.unknown_names)
        for name, columns in naming.items():
            absent = {index: column for index, column in columns.items() if column not in accounted}
            if not absent:
                continue
            whole = len(absent) == len(columns)
            if name in needed and not (name in COMMANDED and whole):
                renamed = True
                meaning = self._describe_joints_without_column(name, absent)
                yield f"{_describe_missing_columns(absent)}{meaning}; {self._advise_other_name(len(absent))}"
            elif name in needed:
                yield f"{_describe_missing_columns(absent)}; {self._advise_combination(name)}"
            elif not whole:
                every = "axes" if _is_of_wrench(name) else "joints"
                yield f"{_describe_missing_columns(absent)}; {name} is given for all {every} or for none"
        if not renamed:
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

    def _describe_joints_without_column(self, name: str, absent: Mapping[int, str]) -> str:
        """Return the meaning of missing columns in parentheses; empty for those of a wrench."""
        if _is_of_wrench(name):
            return ""
        key = POSITION.key if name in POSITION.names else name
        return f" ({key} of joint{'s'[: len(absent) > 1]} {together(list(absent), self.joint_names)})"


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
    near = nearest(quantity, [each for name, _, each in missing_parts if name == joint])
    if near is not None:
        return f"{joint}.{near}"
    near = nearest(joint, [name for name, _, each in missing_parts if each == quantity])
    return None if near is None else f"{near}.{quantity}"


def misspellings(intended_columns: Mapping[str, str]) -> Iterator[str]:
    """Yield one problem for all columns with the same mistake, in the joint or in the quantity."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for column, near in intended_columns.items():
        parts = zip(column.split("."), near.split("."), strict=False)
        mistake = [part for pair in parts if pair[0] != pair[1] for part in pair]
        groups.setdefault(tuple(mistake), []).append(column)
    for columns in groups.values():
        right = [intended_columns[each] for each in columns]
        if successor(columns[0], right) is None:
            yield f"{_describe_unknown_columns(columns)}; did you mean {_quote_columns(right)}?"
        else:
            verb = "it is" if len(columns) == 1 else "they are"
            yield f"{_describe_unknown_columns(columns)}; {verb} now {_quote_columns(right)}"


def _describe_unknown_columns(columns: Sequence[str]) -> str:
    words = "unknown column" if len(columns) == 1 else f"{len(columns)} unknown columns:"
    return f"{words} {_quote_columns(columns)}"


def _quote_columns(columns: Sequence[str]) -> str:
    return repr(columns[0]) if len(columns) == 1 else listed(columns, MOST_NAMED)


def _describe_missing_columns(absent: Mapping[int, str]) -> str:
    words = "the column {} is missing" if len(absent) == 1 else "the columns {} are missing"
    return words.format(", ".join(absent.values()))
