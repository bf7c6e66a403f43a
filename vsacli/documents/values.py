"""Reading single values: numbers, texts, vectors, intervals and values per joint."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import singledispatch
from pathlib import Path
from typing import Any, Final, NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.units import DIMENSIONLESS, Quantity
from vsacli.documents import tree
from vsacli.documents.expression import BOOLEANS, ExpressionError, evaluate
from vsacli.documents.fields import (
    Choice,
    Integer,
    Interval,
    Kind,
    Number,
    PerJoint,
    TableFile,
    Text,
    Vector,
    declared,
)
from vsacli.documents.problems import Problems

INVALID: Final = object()
"""In place of a value that cannot be used; its problem is noted already."""


class Scope(NamedTuple):
    """What the meaning of a value depends on besides its own text.

    Attributes:
        problems: receives everything that is wrong.
        members: name and unit variant of every joint, for PerJoint values.
        exempt: for a purpose of PerJoint values the joints that have none, each with the reason.
        variant: the choice on which units depend here, None while it is unknown.
        survey: collects the quantity and the node of each PerJoint value, which is then not read; None to
            read them.
    """

    problems: Problems
    members: Mapping[str, str]
    exempt: Mapping[str, Mapping[str, str]]
    variant: str | None = None
    survey: list[tuple[Quantity, tree.Node]] | None = None

    def unit(self, quantity: Quantity) -> str:
        """Unit of a quantity here; an unknown variant is a problem of its own and must not make others."""
        return quantity.unit(self.variant or "revolute")

    def of_member(self, name: str) -> Scope:
        """The scope of the value of one joint; the same if none is called so."""
        return self._replace(variant=self.members.get(name, self.variant))

    def inside(self, cls: type, node: tree.Mapping) -> Scope:
        """The scope of the values in a record."""
        key, variant = getattr(cls, "unit_variant_with", (None, None))
        if key in node.entries:
            return self._replace(variant=variant)
        selector = getattr(cls, "unit_variant", None)
        if selector is None:
            return self
        match declared(cls)[selector][0].kind, node.entries.get(selector):
            case Choice(options=options), tree.Scalar(text=word) if word in options:
                return self._replace(variant=word)
        return self._replace(variant=None)


@singledispatch
def read_value(kind: Kind, node: tree.Node, label: str, scope: Scope) -> Any:
    """Read a value of a kind; INVALID if its problem was noted."""
    raise NotImplementedError


@read_value.register(Number)
def _read_number(kind: Number, node: tree.Node, label: str, scope: Scope) -> Any:
    return _number(node, scope.unit(kind.unit), label, scope)


def _number(node: tree.Node, unit: str, label: str, scope: Scope) -> Any:
    expected = "a number" if unit == str(DIMENSIONLESS) else f"a number in {unit}"
    if not isinstance(node, tree.Scalar) or node.is_null:
        return unexpected(node, expected, label, scope)
    try:
        return evaluate(node.text, unit)
    except ExpressionError as error:
        return unexpected(node, expected, label, scope, f": {error}")


def unexpected(node: tree.Node, expected: str, label: str, scope: Scope, reason: str = "") -> Any:
    """Note that something else was found, and return INVALID."""
    scope.problems.add(node.line, f"{label}: expected {expected}, found {node}{reason}")
    return INVALID


@read_value.register(Integer)
def _read_integer(_: Integer, node: tree.Node, label: str, scope: Scope) -> Any:
    value = _number(node, str(DIMENSIONLESS), label, scope)
    if value is INVALID or value.is_integer():
        return value if value is INVALID else int(value)
    return unexpected(node, "a whole number", label, scope)


@read_value.register(Text)
def _read_text(_: Text, node: tree.Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, tree.Scalar) or node.is_null:
        return unexpected(node, "a text", label, scope)
    if node.plain and node.text.lower() in BOOLEANS:
        return unexpected(node, "a text", label, scope, ", a boolean in YAML; put it in quotes")
    return node.text


@read_value.register(Choice)
def _read_choice(kind: Choice, node: tree.Node, label: str, scope: Scope) -> Any:
    if isinstance(node, tree.Scalar) and not node.is_null:
        return node.text
    return unexpected(node, f"one of {', '.join(kind.options)}", label, scope)


@read_value.register(Vector)
def _read_vector(kind: Vector, node: tree.Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, tree.Sequence):
        return unexpected(node, f"a list of {kind.length} numbers", label, scope)
    unit = scope.unit(kind.unit)
    return all_valid(_number(item, unit, label, scope) for item in node.items)


@read_value.register(Interval)
def _read_interval(kind: Interval, node: tree.Node, label: str, scope: Scope) -> Any:
    unit = scope.unit(kind.unit)
    if isinstance(node, tree.Scalar):
        upper = _number(node, unit, label, scope)
        return upper if upper is INVALID else (-math.inf if kind.one_sided else -upper, upper)
    if isinstance(node, tree.Sequence) and len(node.items) == 2:
        return all_valid(_number(item, unit, label, scope) for item in node.items)
    return unexpected(node, "[lower, upper] or one number", label, scope)


@read_value.register(TableFile)
def _read_table_file(kind: TableFile, node: tree.Node, label: str, scope: Scope) -> Any:
    name = _read_text(Text(), node, label, scope)
    if name is INVALID:
        return INVALID
    from vsacli.documents.table import read_table

    try:
        table = read_table(Path(scope.problems.file).parent / name)
        if table.columns != kind.columns:
            expected, found = ",".join(kind.columns), ",".join(table.columns)
            raise InputError.one(f"expected the header {expected}, found {found}", table.source.path, 1)
    except InputError as error:
        scope.problems.include(error)
        return INVALID
    return table


@read_value.register(PerJoint)
def _read_per_joint(kind: PerJoint, node: tree.Node, label: str, scope: Scope) -> Any:
    if scope.survey is not None:
        scope.survey.append((kind.unit, node))
        return INVALID
    exempt = scope.exempt.get(kind.purpose, {})
    nodes = _by_joint(node, label, scope, exempt)
    if nodes is None:
        return INVALID
    return all_valid(
        _no_number(nodes.get(name), name, exempt[name], label, scope)
        if name in exempt
        else _number(nodes[name], kind.unit.unit(variant), label, scope)
        for name, variant in scope.members.items()
    )


def _no_number(node: tree.Node | None, name: str, reason: str, label: str, scope: Scope) -> Any:
    """None, for a joint that must not have a number."""
    if node is None or (isinstance(node, tree.Scalar) and node.is_null):
        return None
    return unexpected(node, f"no value for {name}", label, scope, f": {reason}")


def _by_joint(
    node: tree.Node, label: str, scope: Scope, exempt: Mapping[str, str]
) -> Mapping[str, tree.Node] | None:
    """What is written for each joint, a scalar for those that are not exempt; None if joints are wrong."""
    names = scope.members
    match node:
        case tree.Scalar():
            return {name: node for name in names if name not in exempt}
        case tree.Sequence(items=items) if len(items) != len(names):
            unexpected(node, f"{len(names)} numbers, one for each joint", label, scope)
            return None
        case tree.Sequence(items=items):
            return dict(zip(names, items, strict=True))
        case tree.Mapping(entries=entries):
            return entries if _check_names(node, label, scope, exempt) else None


def _check_names(node: tree.Mapping, label: str, scope: Scope, exempt: Mapping[str, str]) -> bool:
    """Note names that are no joint's, and joints without a value."""
    names = scope.members
    unknown = [name for name in node.entries if name not in names]
    for name in unknown:
        message = f"{label}: no joint is called {tree.quoted(name)}{did_you_mean(name, names)}"
        scope.problems.add(node.key_lines[name], message)
    missing = [name for name in names if name not in node.entries and name not in exempt]
    if missing:
        scope.problems.add(node.line, f"{label}: no value for {', '.join(missing)}; each joint needs one")
    return not unknown and not missing


def all_valid(values: Iterable[Any]) -> Any:
    """The values as a tuple, or INVALID if one is; each is read, so each problem is noted."""
    everything = tuple(values)
    return INVALID if INVALID in everything else everything
