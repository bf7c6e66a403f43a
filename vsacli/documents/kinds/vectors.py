"""Values that are several numbers: a vector, an interval, a number for each joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem
from vsacli.base.units import ANY_SI_UNIT, Quantity
from vsacli.documents import tree
from vsacli.documents.kinds.single import IDENTIFIER, Number, read_number, unit_words
from vsacli.documents.records import ArraysOfRecord, Check, FieldPath, JsonOfRecord, Kind, Refer, Schema
from vsacli.documents.resolved_fields import ResolvedField, single
from vsacli.documents.tree import INVALID, Node, Scope, all_valid


def list_of(item: Schema, length: int) -> Schema:
    """JSON Schema of lists of a length."""
    return {"type": "array", "items": item, "minItems": length, "maxItems": length}


class _Numbers(Kind):
    """Several numbers of one unit."""

    unit: Quantity

    @property
    def each(self) -> Number:
        """A number of the same unit."""
        return Number(self.unit)

    def json_value(self, content: Any, _of_record: JsonOfRecord, /) -> Any:
        """A list of the numbers."""
        return list(content)


@dataclass(eq=False)
class Vector(_Numbers):
    """A list of `length` numbers, read as a tuple."""

    length: int
    unit: Quantity

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """The numbers, which may still be too many or too few."""
        if not isinstance(node, tree.Sequence):
            return scope.unexpected(node, f"a list of {self.length} numbers", label)
        return all_valid(self.each.read(item, label, scope) for item in node.items)

    def problems(self, path: FieldPath, check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Another number of numbers, or what is wrong with one of them."""
        if len(content) == self.length:
            yield from super().problems(path, check, content)
        else:
            yield FieldProblem(path, f"expected {self.length} numbers, found {len(content)}")

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """A list of so many numbers."""
        return list_of(self.each.schema(check, refer), self.length)

    @property
    def words(self) -> str:
        """How many numbers, and their unit."""
        return f"{self.length} numbers, {unit_words(self.unit)}"

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """The numbers along the axes."""
        yield single(("axis",), self.unit, content)


@dataclass(eq=False)
class Interval(_Numbers):
    """`[lower, upper]`, read as a pair; a scalar x means [-x, x], or [lowest, x] with a `lowest`."""

    unit: Quantity
    lowest: float | None = None

    forms = " ([lower, upper] or one number)"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Both bounds."""
        if isinstance(node, tree.Scalar):
            upper = self.each.read(node, label, scope)
            return upper if upper is INVALID else (-upper if self.lowest is None else self.lowest, upper)
        if isinstance(node, tree.Sequence) and len(node.items) == 2:
            return all_valid(self.each.read(item, label, scope) for item in node.items)
        return scope.unexpected(node, "[lower, upper] or one number", label)

    def problems(self, path: FieldPath, check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """Bounds in the wrong order, or what is wrong with one of them."""
        if content[0] <= content[1]:
            yield from super().problems(path, check, content)
        else:
            bounds = f"the lower bound {content[0]:g} exceeds the upper bound {content[1]:g}"
            yield FieldProblem(path, bounds)

    def schema(self, _check: Check | None, refer: Refer, /) -> Schema:
        """A number or two, on which the condition is not stated."""
        bound = self.each.schema(None, refer)
        return {"anyOf": [*bound["anyOf"], list_of(bound, 2)]}

    @property
    def words(self) -> str:
        """Its forms and unit."""
        alone = {None: "-x to x", -math.inf: "upper"}.get(self.lowest, f"{self.lowest} to x")
        return f"[lower, upper], or one number x ({alone}), {unit_words(self.unit)}"

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """Both bounds."""
        yield single(("bound",), self.unit, content)


@dataclass(eq=False)
class NamedNumbers(Kind):
    """A mapping from names of one's own to numbers in SI units, read as pairs; angles may be in degrees."""

    words = "mapping from names to numbers in SI units"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Pairs of a name and a number."""
        if not isinstance(node, tree.Mapping):
            return scope.unexpected(node, "a mapping from names to numbers", label)
        numbers = all_valid(
            read_number(entry, str(ANY_SI_UNIT), f"{label}.{name}", scope)
            for name, entry in node.entries.items()
        )
        return numbers if numbers is INVALID else tuple(zip(node.entries, numbers, strict=True))

    def problems(self, path: FieldPath, check: Check | None, content: Any, /) -> Iterator[FieldProblem]:
        """What is wrong with one of the numbers."""
        for name, entry in content:
            yield from super().problems((*path, name), check, entry)

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """A mapping with a number at each key."""
        return {"type": "object", "additionalProperties": Number(ANY_SI_UNIT).schema(check, refer)}

    def arrays(self, content: Any, _of_record: ArraysOfRecord, /) -> Iterator[ResolvedField]:
        """Each number by its name."""
        for name, entry in content:
            yield single((), ANY_SI_UNIT, entry)._replace(path=(name,))

    def json_value(self, content: Any, _of_record: JsonOfRecord, /) -> Any:
        """The mapping."""
        return dict(content)


@dataclass(eq=False)
class PerJoint(_Numbers):
    """A scalar for all joints, a list, or a mapping by joint name; read as a tuple with one entry a joint.

    Joints that are exempt from `purpose` are named in no mapping and null in a list; their entry is None.
    """

    unit: Quantity
    purpose: str = ""

    per_joint = True

    def names(self, content: Any, members: Mapping[str, str], /) -> list[str]:
        """The names of the joints."""
        return list(members) or super().names(content, members)

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """A number for each joint in its own unit, None for those that are exempt; or part of a survey."""
        if scope.survey is not None:
            scope.survey.append((self.unit, node))
            return INVALID
        exempt = scope.exempt.get(self.purpose, {})
        nodes = _by_joint(node, label, scope, exempt)
        if nodes is None:
            return INVALID
        return all_valid(
            _no_number(nodes.get(name), name, exempt[name], label, scope)
            if name in exempt
            else read_number(nodes[name], self.unit.unit(variant), label, scope)
            for name, variant in scope.members.items()
        )

    def schema(self, check: Check | None, refer: Refer, /) -> Schema:
        """A number, a list or a mapping of numbers and nulls."""
        numbers = self.each.schema(check, refer)["anyOf"]
        return {
            "anyOf": [
                *numbers,
                {"type": "array", "minItems": 1, "items": {"anyOf": [*numbers, {"type": "null"}]}},
                {
                    "type": "object",
                    "propertyNames": {"pattern": f"^{IDENTIFIER.pattern}$"},
                    "additionalProperties": {"anyOf": [*numbers, {"type": "null"}]},
                },
            ]
        }

    @property
    def words(self) -> str:
        """Its unit."""
        return f"per joint, {unit_words(self.unit)}"


def _no_number(node: Node | None, name: str, reason: str, label: str, scope: Scope) -> Any:
    """None, for a joint that must not have a number."""
    if node is None or (isinstance(node, tree.Scalar) and node.is_null):
        return None
    return scope.unexpected(node, f"no value for {name}", label, f": {reason}")


def _by_joint(node: Node, label: str, scope: Scope, exempt: Mapping[str, str]) -> Mapping[str, Node] | None:
    """What is written for each joint, a scalar for those that are not exempt; None if joints are wrong."""
    names = scope.members
    match node:
        case tree.Scalar():
            return {name: node for name in names if name not in exempt}
        case tree.Sequence(items=items) if len(items) != len(names):
            scope.unexpected(node, f"{len(names)} numbers, one for each joint", label)
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
