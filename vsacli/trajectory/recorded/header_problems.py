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
        known: all possible names.
        expected: names in the naming that the header uses.
        joint_names: names of the joints.
        file: path of the file.
        renaming: advice for columns with other names, a clause.
    """

    names: Sequence[str]
    known: Collection[str]
    expected: Sequence[str]
    joint_names: Sequence[str]
    file: str
    renaming: str

    @cached_property
    def parenthesised(self) -> dict[str, re.Match[str]]:
        """Name and unit of the known columns whose unit is in parentheses, by the whole name."""
        matches = {name: _PARENTHESISED.fullmatch(name) for name in self.names if name not in self.known}
        return {
            name: match
            for name, match in matches.items()
            if match is not None and match["name"] in self.known
        }

    @cached_property
    def meant(self) -> dict[str, str]:
        """The column that each renamed or misspelled one probably stands for."""
        unknown = [name for name in self.names if name not in {*self.known, *self.parenthesised}]
        return self.misspelled(unknown, [column for column in self.expected if column not in self.names])

    @property
    def explained(self) -> set[str]:
        """Names of the columns that are there, if under a wrong name."""
        return {*self.names, *self.meant.values(), *(each["name"] for each in self.parenthesised.values())}

    @property
    def is_foreign(self) -> bool:
        """Whether no column but the time is known, and not all others are misspelled ones."""
        signals = {*self.known} - {TIME}
        return signals.isdisjoint(self.names) and bool(self.strangers or signals.isdisjoint(self.explained))

    def misspelled(self, unknown: Collection[str], missing: Sequence[str]) -> dict[str, str]:
        """Return the columns that probably stand for known ones, renamed or `missing`, with these."""
        near_names = {name: successor(name, self.known) or probable_column(name, missing) for name in unknown}
        return {name: near for name, near in near_names.items() if near is not None}

    @cached_property
    def strangers(self) -> list[str]:
        """Names that are unknown, one of which may be a missing column under another name."""
        return [name for name in self.names if name not in {*self.known, *self.parenthesised, *self.meant}]

    def of_names(self) -> Iterator[str]:
        """Yield problems of names: misspellings and units in parentheses."""
        yield from misspellings(self.meant)
        for name, parts in self.parenthesised.items():
            yield f"{name!r}: units are written in square brackets, {parts['name']} [{parts['unit']}]"

    def of_strangers(self) -> Iterator[str]:
        """Yield one problem for all unknown columns, if there are any."""
        if self.strangers:
            yield (
                f"{_describe_unknown_columns(self.strangers)}; to leave columns out or to rename them,"
                f" {self.renaming}"
            )

    def of_time(self, otherwise: str) -> Iterator[str]:
        """Yield that no column holds times, if so; `otherwise` is the advice if all columns are known."""
        if TIME not in self.explained:
            yield f"there is no column {TIME!r}; {self._other_name(1) if self.strangers else otherwise}"

    def of_gaps(self, naming: Mapping[str, Mapping[int, str]], needed: Collection[str]) -> Iterator[str]:
        """Yield problems of missing and unknown columns: one for both, if a name may be the reason.

        Args:
            naming: expected columns of each quantity, by index of the joint or wrench axis.
            needed: quantities that are required.
        """
        explained = self.explained
        yield from self.of_time(RATE_INSTEAD)
        renamed = TIME not in explained and bool(self.strangers)
        for name, columns in naming.items():
            absent = {index: column for index, column in columns.items() if column not in explained}
            if not absent:
                continue
            whole = len(absent) == len(columns)
            if name in needed and not (name in COMMANDED and whole):
                renamed = True
                meaning = self._of_joints(name, absent)
                yield f"{_describe_missing_columns(absent)}{meaning}; {self._other_name(len(absent))}"
            elif name in needed:
                yield f"{_describe_missing_columns(absent)}; {self._combined(name)}"
            elif not whole:
                every = "axes" if name in WRENCH.names else "joints"
                yield f"{_describe_missing_columns(absent)}; {name} is given for all {every} or for none"
        if not renamed:
            yield from self.of_strangers()

    def _other_name(self, missing: int) -> str:
        """Return the columns one of which may be missing, and what to do then, as two clauses."""
        condition = "if it has another name" if missing == 1 else "if they have other names"
        columns = (
            _describe_unknown_columns(self.strangers)
            if self.strangers
            else f"columns: {listed(self.names, MOST_PRESENT)}"
        )
        return f"{columns}; {condition}, {self.renaming}"

    def _combined(self, signal: str) -> str:
        motion = f"position: {{type: csv, file: {self.file}}}"
        return f"a YAML trajectory can combine the motion of this file ({motion}) with a {signal}"

    def _of_joints(self, name: str, absent: Mapping[int, str]) -> str:
        """Return the meaning of missing columns in parentheses; empty for those of a wrench."""
        if name in WRENCH.names:
            return ""
        key = POSITION.key if name in POSITION.names else name
        return f" ({key} of joint{'s'[: len(absent) > 1]} {together(list(absent), self.joint_names)})"


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


def misspellings(meant: Mapping[str, str]) -> Iterator[str]:
    """Yield one problem for all columns with the same mistake, in the joint or in the quantity."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for column, near in meant.items():
        parts = zip(column.split("."), near.split("."), strict=False)
        mistake = [part for pair in parts if pair[0] != pair[1] for part in pair]
        groups.setdefault(tuple(mistake), []).append(column)
    for columns in groups.values():
        right = [meant[each] for each in columns]
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
