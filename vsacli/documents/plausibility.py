"""Warnings of values that can be computed with but are hardly meant: a row of a table is a rule.

A rule compares a size, which is made of one value of a file, with bounds that whatever is built keeps by far.
A value outside is a warning with its line, its size, and the unit in which it would be a common one.
The rows are in `robot.plausibility` and `trajectory.plausibility`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from vsacli.base.errors import InputError, Problem
from vsacli.documents import tree
from vsacli.documents.expression import ANGLES, ExpressionError, evaluate
from vsacli.documents.record_values import Entry, NumberPath
from vsacli.documents.source import Problems, Source
from vsacli.documents.tree import parse_yaml

_Subject = TypeVar("_Subject")
_EXPRESSION_OF_ANGLE = re.compile("deg|pi")


class OtherUnit(NamedTuple):
    """Another unit in which a number may have been written.

    Attributes:
        unit: the unit, e.g. `mm`.
        factor: its size in the unit that was expected.
        power: of the factor by which the size of the rule changes.
        instead_of: the unit that was expected, if the rule is about numbers of several.
        field: path, beside the number that was measured, to the field it is about; that number if empty.
    """

    unit: str
    factor: float
    power: float = 1.0
    instead_of: str = ""
    field: tuple[str, ...] = ()


class Measured(NamedTuple):
    """A measurement of one number by a rule.

    Attributes:
        path: to the number.
        value: of it; NaN if the path leads to several.
        unit: of it.
        size: compared with the bounds; NaN if the rule does not apply or there is nothing to compare with.
        beside: values that the words of the rule name, by name.
    """

    path: NumberPath
    value: float
    unit: str
    size: float
    beside: Mapping[str, Any] = MappingProxyType({})


class Rule(NamedTuple, Generic[_Subject]):
    """A row of the table.

    Attributes:
        name: a few words.
        fields: keys of the file, for the documentation.
        measure: yields values of a robot or trajectory with their sizes.
        size: the size in words, for the documentation.
        reason: why sizes outside the bounds are hardly meant, a sentence.
        finding: words about the value: a verb, `{size}`, and words from `Measured.beside` in braces.
        low: least size that passes.
        high: sizes from here on do not pass.
        usual: a common size, towards which another unit is looked for.
        units: other units that the value may be in.
        advice: what to look at if none of them fits.
        in_angles: whether a value written with `deg` or `pi` passes, as its writer knew the unit.
        explained_by: names of rules; if one of them finds something, this one is not asked.
    """

    name: str
    fields: str
    measure: Callable[[_Subject], Iterable[Measured]]
    size: str
    reason: str
    finding: str
    low: float = 0.0
    high: float = math.inf
    usual: float = 1.0
    units: tuple[OtherUnit, ...] = ()
    advice: str = "check its unit"
    in_angles: bool = False
    explained_by: tuple[str, ...] = ()

    def admits(self, size: float) -> bool:
        """Return whether a size is as usual, or nothing is known of it."""
        return math.isnan(size) or self.low <= size < self.high

    def other_unit(self, measured: Measured) -> OtherUnit | None:
        """Return the unit in which the number would be nearest to a common one; None without such a unit."""
        sizes = {
            other: measured.size * other.factor**other.power
            for other in self.units
            if other.instead_of in ("", measured.unit)
        }
        fitting = [other for other, size in sizes.items() if size and self.admits(size)]
        return min(fitting, key=lambda other: abs(math.log(sizes[other] / self.usual)), default=None)

    def sentence(self, measured: Measured, other: OtherUnit | None) -> str:
        """Return the warning: field, value, finding, and the likely unit."""
        path = _of_unit(measured.path, other)
        known = path == measured.path and not math.isnan(measured.value)
        value = f" = {measured.value:.6g} {measured.unit}".removesuffix(" 1") if known else ""
        # Three digits, with a power of ten only where there would be many zeros.
        found = self.finding.format(size=f"{float(f'{measured.size:.3g}'):.6g}", **measured.beside)
        advice = self.advice
        if other is not None:
            advice = _guess(measured, other) if known else f"is it in {other.unit}?"
        return f"{'.'.join(map(str, path))}{value} {found}; {advice}"


def _guess(measured: Measured, other: OtherUnit) -> str:
    meant = f"did you mean {measured.value:.6g} {other.unit}"
    if measured.unit in ANGLES and other.unit == "deg":
        return f"{meant}?"
    return f"{meant}, which is {measured.value * other.factor:.6g} {measured.unit}?"


def _of_unit(path: NumberPath, other: OtherUnit | None) -> NumberPath:
    return (*path[:-1], *other.field) if other and other.field else path


Moved: TypeAlias = Callable[[tree.Node, NumberPath], NumberPath]
"""Gives the path in a file, from its root and the path in the record made of it."""


class Written:
    """Values and lines of a YAML file by the path to a number."""

    def __init__(self, source: Source, moved: Moved | None = None) -> None:
        """Take the file, and the paths that differ between it and the record made of it."""
        self.path = source.path
        self._text = source.text or ""
        self._moved = moved

    @cached_property
    def _root(self) -> tree.Node:
        try:
            return parse_yaml(self._text, Problems(self.path))
        except InputError:  # no YAML file
            return tree.Mapping(0, {}, {})

    def at(self, path: NumberPath) -> tuple[tree.Node, NumberPath]:
        """Return the deepest node on the way along a path, and the steps that do not lead into it."""
        steps = path if self._moved is None else self._moved(self._root, path)
        node = self._root
        for taken, step in enumerate(steps):
            inner = _inside(node, step)
            if inner is None:
                return node, steps[taken:]
            node = inner
        return node, ()

    def line(self, path: NumberPath) -> int:
        """Return the line of the file on which a path ends."""
        return self.at(path)[0].line

    def said(self, measured: Measured) -> Measured | None:
        """Return the number as written, once if equal for all joints or both ends; None if it differs."""
        node, left = self.at(measured.path)
        if not isinstance(node, tree.Scalar) or math.isnan(measured.value):
            return measured
        try:
            value = evaluate(node.text, measured.unit)
        except ExpressionError:
            return None
        if abs(value) != abs(measured.value):
            return None
        return measured._replace(path=measured.path[: len(measured.path) - len(left)], value=value)

    def in_angles(self, measured: Measured) -> bool:
        """Return whether it says this number with `deg` or `pi`."""
        node, _ = self.at(measured.path)
        if not isinstance(node, tree.Scalar) or self.said(measured) is None:
            return False
        return bool(_EXPRESSION_OF_ANGLE.search(node.text))


def _inside(node: tree.Node, step: str | Entry) -> tree.Node | None:
    match node, step:
        case tree.Mapping(entries=entries), _:
            return entries.get(str(step))
        case tree.Sequence(items=items), Entry(number=number) if number < len(items):
            return items[number]
    return None


def strange(
    rules: Sequence[Rule[_Subject]],
    subject: _Subject,
    written: Written | None = None,
    known: Collection[str] = (),
) -> dict[str, list[Measured]]:
    """Return the numbers found by rules, by name of the rule; rules without findings have no entry.

    Args:
        rules: a rule comes after those that explain its findings.
        subject: the robot or trajectory.
        written: the file it is from, if there is one.
        known: names of rules that found something elsewhere.
    """
    found: dict[str, list[Measured]] = {}
    with np.errstate(all="ignore"):  # a number may be so strange that a size is infinite
        for rule in rules:
            if {*found, *known}.isdisjoint(rule.explained_by):
                outside = [measured for measured in rule.measure(subject) if not rule.admits(measured.size)]
                if rule.in_angles and written is not None:
                    outside = [measured for measured in outside if not written.in_angles(measured)]
                found |= {rule.name: outside} if outside else {}
    return found


def findings(
    rules: Sequence[Rule[_Subject]],
    subject: _Subject,
    written: Written | None = None,
    known: Collection[str] = (),
) -> tuple[Problem, ...]:
    """Return the warnings for strange values, with file and line where the file still has the value."""
    named = {rule.name: rule for rule in rules}
    found = strange(rules, subject, written, known)
    problems = (_problem(named[name], each, written) for name, several in found.items() for each in several)
    return tuple(dict.fromkeys(problems))


def _problem(rule: Rule[Any], measured: Measured, written: Written | None) -> Problem:
    """Return the warning about a number."""
    other = rule.other_unit(measured)
    said = written.said(measured) if written is not None else None
    if written is None or said is None:
        return Problem("", 0, rule.sentence(measured, other))
    line = written.line(_of_unit(measured.path, other))
    return Problem(written.path, line, rule.sentence(said, other))
