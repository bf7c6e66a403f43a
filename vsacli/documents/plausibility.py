"""Warnings about valid but implausible values; each rule is a row of a table.

A rule compares a size, derived from one value of a file, with bounds far outside the range of real robots. A
value outside the bounds is reported with its line, its size, and the unit in which it would be plausible. The
rows are in `robot.plausibility` and `trajectory.plausibility`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from vsacli.base.errors import InputError, Problem
from vsacli.base.texts import listed
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import ANGLES, evaluate
from vsacli.documents.record_values import NumberPath, PathIndex
from vsacli.documents.source import Problems, Source
from vsacli.documents.tree import ListNode, MapNode, Node, TextNode, parse_yaml

_Subject = TypeVar("_Subject")
_COMPONENTS = {
    **dict.fromkeys(("com", "xyz"), ("x", "y", "z")),
    **dict.fromkeys(("limits", "range"), ("lower", "upper")),
}
"""Names of the components of fields that are lists."""

MOST_NAMED = 5
_EXPRESSION_OF_ANGLE = re.compile("deg|pi")


class OtherUnit(NamedTuple):
    """Another unit in which a number may have been written.

    Attributes:
        unit: name of the unit, e.g. `mm`.
        factor: size of the unit in the expected unit.
        power: exponent of the factor in the size of the rule.
        instead_of: expected unit, if the rule is about numbers of several units.
        field: path of the field to report instead, relative to the parent of the measured number; empty for
            the number itself.
    """

    unit: str
    factor: float
    power: float = 1.0
    instead_of: str = ""
    field: tuple[str, ...] = ()


class Measured(NamedTuple):
    """A measurement of one number by a rule.

    Attributes:
        path: path to the number.
        value: value of the number; NaN if the path leads to several.
        unit: unit of the number.
        size: size to compare with the bounds; NaN if the rule does not apply or has no reference.
        beside: further values for the words of the rule, by name.
    """

    path: NumberPath
    value: float
    unit: str
    size: float
    beside: Mapping[str, Any] = MappingProxyType({})


class Rule(NamedTuple, Generic[_Subject]):
    """A row of the table.

    Attributes:
        name: short name.
        fields: keys of the file, for the documentation.
        measure: function that yields measurements of a robot or trajectory.
        size: description of the size, for the documentation.
        reason: sentence on why sizes outside the bounds are implausible.
        finding: predicate about the value: a verb, `{size}`, and names of `Measured.beside` in braces.
        low: smallest plausible size.
        high: smallest size that is too large.
        usual: typical size, by which the most likely other unit is chosen.
        units: other units in which the value may have been written.
        advice: advice if none of these units is plausible.
        in_angles: whether values written with `deg` or `pi` pass, since their unit is certain.
        explained_by: names of rules whose findings suppress this rule.
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
        """Return whether a size is plausible or unknown."""
        return math.isnan(size) or self.low <= size < self.high

    def choose_units(self, outside: Sequence[Measured]) -> list[OtherUnit | None]:
        """Return the unit in which each number was probably written, or None; never two for one field.

        A unit is tried the earlier, the more of the numbers it makes plausible, and the more usual ones.
        """
        plausible = {other: self._plausible_sizes(outside, other) for other in self.units}
        chosen: dict[int, OtherUnit] = {}
        for other in sorted(
            plausible,
            key=lambda other: (
                -len(plausible[other]),
                sum(abs(math.log(size / self.usual)) for size in plausible[other].values()),
            ),
        ):
            taken = {(outside[index].unit, earlier.field) for index, earlier in chosen.items()}
            fitting = (each for each in plausible[other] if (outside[each].unit, other.field) not in taken)
            chosen = {**dict.fromkeys(fitting, other), **chosen}
        return [chosen.get(index) for index in range(len(outside))]

    def _plausible_sizes(self, outside: Sequence[Measured], other: OtherUnit) -> dict[int, float]:
        """Return the sizes in another unit of the numbers that it makes plausible, by index."""
        return {
            index: size
            for index, measured in enumerate(outside)
            if (size := measured.size * other.factor**other.power)
            and self.admits(size)
            and other.instead_of in ("", measured.unit)
        }

    def sentence(self, measured: Measured, other: OtherUnit | None) -> str:
        """Return the warning: field, value, finding, and the likely unit."""
        path = _path_to_report(measured.path, other)
        has_value = path == measured.path and not math.isnan(measured.value)
        value = f" = {measured.value:.6g} {measured.unit}".removesuffix(" 1") if has_value else ""
        # Three digits, with a power of ten only where there would be many zeros.
        finding = self.finding.format(size=f"{float(f'{measured.size:.3g}'):.6g}", **measured.beside)
        advice = self.advice
        if other is not None:
            advice = _guess_unit(measured, other) if has_value else f"is it in {other.unit}?"
        return f"{_name_of_path(path)}{value} {finding}; {advice.format(**measured.beside)}"


def _name_of_path(path: NumberPath) -> str:
    """Return a path joined by dots, with the name of a component that it gives by its index only."""
    words: Sequence[str] = ()
    if len(path) > 2 and isinstance(path[-1], PathIndex) and not path[-1].name:
        words = _COMPONENTS.get("limits" if path[-3] == "limits" else str(path[-2]), ())[path[-1].number :]
    return ".".join(map(str, path)) + (f" ({words[0]})" if words else "")


def _guess_unit(measured: Measured, other: OtherUnit) -> str:
    question = f"did you mean {measured.value:.6g} {other.unit}"
    if measured.unit in ANGLES and other.unit == "deg":
        return f"{question}?"
    return f"{question}, which is {measured.value * other.factor:.4g} {measured.unit}?"


def _path_to_report(path: NumberPath, other: OtherUnit | None) -> NumberPath:
    return (*path[:-1], *other.field) if other and other.field else path


TranslatePath: TypeAlias = Callable[[Node, NumberPath], NumberPath]
"""Function that returns the path in a file for its root and the path in the record made of it."""


class ValuesInFile:
    """Values and lines of a YAML file, by the path to a number."""

    def __init__(self, source: Source, translate_path: TranslatePath | None = None) -> None:
        """Store the file, and the function that translates paths of the record into paths of the file."""
        self.path = source.path
        self._text = source.text or ""
        self._translate_path = translate_path

    @cached_property
    def _root(self) -> Node:
        try:
            return parse_yaml(self._text, Problems(self.path))
        except InputError:  # not a YAML file
            return MapNode(0, {}, {})

    def node_along(self, path: NumberPath) -> tuple[Node, NumberPath]:
        """Return the deepest node along a path, and the remaining steps."""
        steps = path if self._translate_path is None else self._translate_path(self._root, path)
        node = self._root
        for count, step in enumerate(steps):
            inner = _child_node(node, step)
            if inner is None:
                return node, steps[count:]
            node = inner
        return node, ()

    def has(self, path: NumberPath) -> bool:
        """Return whether the file has a node at a path."""
        return not self.node_along(path)[1]

    def line(self, path: NumberPath) -> int:
        """Return the line of the deepest node along a path."""
        return self.node_along(path)[0].line

    def as_in_file(self, measured: Measured) -> Measured | None:
        """Return the number with the path to its scalar, which all joints may share; None if it differs."""
        node, remaining_steps = self.node_along(measured.path)
        if not isinstance(node, TextNode) or math.isnan(measured.value):
            return measured
        try:
            value = evaluate(node.text, measured.unit)
        except ExpressionError:
            return None
        if abs(value) != abs(measured.value):
            return None
        return measured._replace(path=measured.path[: len(measured.path) - len(remaining_steps)], value=value)

    def in_angles(self, measured: Measured) -> bool:
        """Return whether the file has this number as an expression with `deg` or `pi`."""
        node, _ = self.node_along(measured.path)
        if not isinstance(node, TextNode) or self.as_in_file(measured) is None:
            return False
        return bool(_EXPRESSION_OF_ANGLE.search(node.text))


def _child_node(node: Node, step: str | PathIndex) -> Node | None:
    match node, step:
        case MapNode(entries=entries), _:
            return entries.get(str(step))
        case ListNode(items=items), PathIndex(number=number) if number < len(items):
            return items[number]
    return None


def implausible_measurements(
    rules: Sequence[Rule[_Subject]],
    subject: _Subject,
    written: ValuesInFile | None = None,
    rules_with_findings: Collection[str] = (),
) -> dict[str, list[Measured]]:
    """Return the implausible numbers by rule name; rules without findings have no entry.

    Args:
        rules: rules in an order in which each follows the rules that explain its findings.
        subject: robot or trajectory.
        written: file of the subject, if any.
        rules_with_findings: names of rules with findings elsewhere.
    """
    implausible_by_rule: dict[str, list[Measured]] = {}
    with np.errstate(all="ignore"):  # extreme values may have an infinite size
        for rule in rules:
            if {*implausible_by_rule, *rules_with_findings}.isdisjoint(rule.explained_by):
                implausible = [
                    measured for measured in rule.measure(subject) if not rule.admits(measured.size)
                ]
                if rule.in_angles and written is not None:
                    implausible = [measured for measured in implausible if not written.in_angles(measured)]
                implausible_by_rule |= {rule.name: implausible} if implausible else {}
    return implausible_by_rule


def implausible_values(
    rules: Sequence[Rule[_Subject]],
    judged: Sequence[tuple[_Subject, ValuesInFile | None, Collection[str]]],
) -> tuple[Problem, ...]:
    """Return the warnings about implausible values, with file and line if the file has the same value.

    Args:
        rules: see `implausible_measurements`.
        judged: its other arguments, several times for a tree: once for each subtree.
    """
    implausible_by_rule = [implausible_measurements(rules, *each) for each in judged]
    problems = (
        problem
        for rule in rules
        for problem in _warnings_by_rule(
            rule,
            [
                (measured, written)
                for (_, written, _), outside in zip(judged, implausible_by_rule, strict=True)
                for measured in outside.get(rule.name, ())
            ],
        )
    )
    return tuple(dict.fromkeys(problems))


def _warnings_by_rule(
    rule: Rule[Any], outside: Sequence[tuple[Measured, ValuesInFile | None]]
) -> Iterator[Problem]:
    """Yield a warning about each number, but only one about all that probably have the same other unit."""
    groups: dict[object, dict[str, Problem]] = {}
    units = rule.choose_units([measured for measured, _ in outside])
    for index, ((measured, written), other) in enumerate(zip(outside, units, strict=True)):
        in_file = written.as_in_file(measured) if written is not None else None
        number, place = in_file or measured, ("", 0)
        if written is not None and in_file is not None:
            place = written.path, written.line(_path_to_report(measured.path, other))
        warning = Problem(*place, rule.sentence(number, other))
        of_unit = groups.setdefault(index if other is None else other, {})
        of_unit.setdefault(_name_of_path(_path_to_report(number.path, other)), warning)
    for group in groups.values():
        first, *further = group.values()
        places = [
            f"{name} (line {each.line})" if each.line != first.line else name
            for name, each in zip([*group][1:], further, strict=True)
        ]
        also = f" Also {listed(places, MOST_NAMED)}" if places else ""
        yield first._replace(message=first.message + also)
