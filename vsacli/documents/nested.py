"""Kinds of nested values (lists, pairs of sides, values by joint, and records), and the reading of records.

A record is read field by field. Problems are noted with their lines and reading continues, so that all
problems of a file are reported together.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import FieldProblem, InputError, InvalidRecordError
from vsacli.base.texts import counted
from vsacli.base.units import Quantity
from vsacli.documents import tree
from vsacli.documents.field_kinds import (
    REQUIRED,
    Check,
    Field,
    FieldPath,
    Kind,
    Number,
    declared,
    read_number,
    unknown_word,
    variant_inside,
)
from vsacli.documents.tree import INVALID, Node, Scope, all_valid, quoted


class Items(Kind):
    """A list of one or more values of a kind, read as a tuple; the text field `unique` must differ in all."""

    item: Kind

    def __init__(self, item: Kind, unique: str | None = None) -> None:
        self.item, self.unique = item, unique
        self.records, self.per_joint = item.records, item.per_joint

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the entries, all different."""
        if not isinstance(node, tree.Sequence) or not node.items:
            return scope.unexpected(node, "a list with at least one entry", label)
        values = all_valid([self.item.read(item, label, scope) for item in node.items])
        return INVALID if self._note_repeated(node, label, scope) else values

    def _note_repeated(self, node: tree.Sequence, label: str, scope: Scope) -> bool:
        if self.unique is None:
            return False
        keys = [_scalar_entry(item, self.unique) for item in node.items]
        found = list(_repeated(key.text if key else None for key in keys))
        for index, first in found:
            line, before = (line_of((place, self.unique), node, scope) for place in (index, first))
            message = _taken(keys[index].text, f"in line {before}")  # type: ignore[union-attr]
            scope.problems.add(line, f"{label}.{self.unique}: {message}")
        return bool(found)

    def problems(self, path: FieldPath, check: Check | None, content: Any) -> Iterator[FieldProblem]:
        """See `Kind.problems`; entries with a unique field are records, checked on construction."""
        if self.unique is None:
            yield from super().problems(path, check, tuple(content))
        else:
            words = [getattr(item, self.unique) for item in content]
            for index, first in _repeated(words):
                message = _taken(words[index], f"by entry {first}")
                yield FieldProblem((*path, index, self.unique), message)


def _repeated(words: Iterable[str | None]) -> Iterator[tuple[int, int]]:
    """Yield the index of each word that occurred before, and that of its first occurrence; skip None."""
    seen: dict[str, int] = {}
    for index, word in enumerate(words):
        if word is not None and seen.setdefault(word, index) != index:
            yield index, seen[word]


def _taken(word: str, where: str) -> str:
    return f"{quoted(word)} is already used {where}; choose another one"


def _scalar_entry(node: Node, key: str) -> tree.Scalar | None:
    entry = node.entries.get(key) if isinstance(node, tree.Mapping) else None
    return entry if isinstance(entry, tree.Scalar) else None


class OneOrMore(Items):
    """One value of a kind, or a list of one or more, read as a tuple."""

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the values."""
        if isinstance(node, tree.Sequence):
            return super().read(node, label, scope)
        one = self.item.read(node, label, scope)
        return one if one is INVALID else (one,)


class Pair(Kind):
    """One value for both members of a pair, such as the sides of a joint, or a list of two; read as a pair.

    `dim` is the dimension of arrays along which both are stored.
    """

    __match_args__ = ("item", "dim")
    item: Kind

    def __init__(self, item: Kind, dim: str = "motor") -> None:
        self.item, self.dim = item, dim
        self.records, self.unit = item.records, item.unit

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return both values; they are the same object if one was written."""
        if isinstance(node, tree.Mapping) and self._names_sides(node):
            keys = ", ".join(map(quoted, node.entries))
            expected = "one mapping for both sides or a list of two"
            scope.problems.add(node.line, f"{label}: expected {expected}, found the keys {keys}")
            return INVALID
        if not isinstance(node, tree.Sequence):
            both = self.item.read(node, label, scope)
            return both if both is INVALID else (both, both)
        if len(node.items) != 2:
            return scope.unexpected(node, "one value for both sides or a list of 2", label)
        return all_valid([self.item.read(item, label, scope) for item in node.items])

    def problems(self, path: FieldPath, check: Check | None, content: Any) -> Iterator[FieldProblem]:
        """See `Kind.problems`."""
        return super().problems(path, check, tuple(content))

    def _names_sides(self, node: tree.Mapping) -> bool:
        """Return whether mappings stand under unknown keys, as in `{flexor: {...}, extensor: {...}}`."""
        if not node.entries or not all(isinstance(value, tree.Mapping) for value in node.entries.values()):
            return False
        known = {"type", *(name for cls in self.records.values() for name in declared(cls))}
        return known.isdisjoint(node.entries)


class PerJoint(Kind):
    """A scalar for all joints, a list, or a mapping by joint name; read as a tuple with one entry a joint.

    Joints exempt from `purpose` are omitted in mappings and null in lists; their entry is None.
    """

    unit: Quantity
    per_joint = True

    def __init__(self, unit: Quantity, purpose: str = "") -> None:
        self.unit, self.purpose, self.item = unit, purpose, Number(unit)

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return a number for each joint in its unit, None if exempt; or add the node to a survey."""
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


def _no_number(node: Node | None, name: str, reason: str, label: str, scope: Scope) -> Any:
    """Return None for an exempt joint; note a problem if it has a value."""
    if node is None or (isinstance(node, tree.Scalar) and node.is_null):
        return None
    return scope.unexpected(node, f"no value for {name}", label, f": {reason}")


def _by_joint(node: Node, label: str, scope: Scope, exempt: Mapping[str, str]) -> Mapping[str, Node] | None:
    """Return the node for each joint (a scalar for all except exempt ones); None if joints are wrong."""
    names = scope.members
    match node:
        case tree.Scalar():
            return {name: node for name in names if name not in exempt}
        case tree.Sequence(items=items) if len(items) != len(names):
            expected = f"{counted(len(names), 'value')}, one for each joint ({', '.join(names)})"
            found = f"found {len(items)}; is the file for another robot?"
            scope.problems.add(node.line, f"{label}: expected {expected}, {found}")
            return None
        case tree.Sequence(items=items):
            return dict(zip(names, items, strict=True))
        case tree.Mapping(entries=entries):
            return entries if _check_names(node, label, scope, exempt) else None


def _check_names(node: tree.Mapping, label: str, scope: Scope, exempt: Mapping[str, str]) -> bool:
    """Note names of unknown joints, and joints without a value."""
    names = scope.members
    unknown = [name for name in node.entries if name not in names]
    for name in unknown:
        message = f"{label}: no joint is called {quoted(name)}{did_you_mean(name, names)}"
        scope.problems.add(node.key_lines[name], message)
    missing = [name for name in names if name not in node.entries and name not in exempt]
    if missing:
        scope.problems.add(node.line, f"{label}: no value for {', '.join(missing)}; each joint needs one")
    return not unknown and not missing


class Record(Kind):
    """A mapping read into the record class `cls`."""

    __match_args__ = ("cls",)

    def __init__(self, cls: type) -> None:
        self.cls, self.records = cls, {"": cls}

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return an instance of the class."""
        if isinstance(node, tree.Mapping):
            return read_record(self.cls, node, label, scope)
        return scope.unexpected(node, f"a mapping{_with_keys(self.cls)}", label)


def _with_keys(cls: type) -> str:
    """Return the keys that a mapping must have, as the end of `a mapping`; empty if it needs none."""
    keys = [name for name, (_, default) in declared(cls).items() if default is REQUIRED]
    return f" with the {'key' if len(keys) == 1 else 'keys'} {', '.join(keys)}" if keys else ""


class OneOf(Kind):
    """A mapping whose key `type` selects the record class; see `Choice` for `not_yet`."""

    __match_args__ = ("records",)

    def __init__(self, variants: Mapping[str, type], not_yet: tuple[str, ...] = ()) -> None:
        self.records, self.not_yet = variants, not_yet

    def word_of(self, record: Any) -> str:
        """Return the word that selects the class of a record."""
        return next(word for word, variant in self.records.items() if type(record) is variant)

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return an instance of the class that `type` selects."""
        if not isinstance(node, tree.Mapping):
            return scope.unexpected(node, "a mapping with the key 'type'", label)
        selector = node.entries.get("type")
        if selector is None:
            scope.problems.add(node.line, f"{label}: missing key 'type', one of {', '.join(self.records)}")
            return INVALID
        if not isinstance(selector, tree.Scalar) or selector.is_null:
            return scope.unexpected(selector, f"one of {', '.join(self.records)}", f"{label}.type")
        if selector.text not in self.records:
            reason = unknown_word(selector.text, self.records, self.not_yet)
            scope.problems.add(selector.line, f"{label}.type: {reason}")
            return INVALID
        return read_record(self.records[selector.text], node, label, scope, beside=("type",))


def read_record(cls: type, node: tree.Mapping, label: str, scope: Scope, beside: tuple[str, ...] = ()) -> Any:
    """Read a mapping into a record class; the additional keys `beside` are left to the caller."""
    prefix = f"{label}: " if label else ""
    scope = scope_inside(scope, cls, node)
    fields = declared(cls)
    mistyped = _refuse_unknown_keys(cls, node, (*fields, *beside), scope)
    values = {
        name: _read_field(name, field, node, prefix, scope)
        for name, (field, default) in fields.items()
        if name in node.entries or (default is REQUIRED and name not in mistyped)
    }
    if INVALID in values.values() or not mistyped.isdisjoint(fields):
        return INVALID
    try:
        return cls(**values)
    except InvalidRecordError as error:
        for problem in error.fields:
            message = problem.in_units(scope.variant).in_file(list(scope.members))
            fault = f"{prefix}{problem.path} {problem.joint} {problem.message}"
            scope.problems.add(line_of(problem.path, node, scope), f"{prefix}{message}", fault)
        return INVALID
    except InputError as error:
        scope.problems.include(error)
        return INVALID


def scope_inside(scope: Scope, cls: type, node: tree.Mapping) -> Scope:
    """Return the scope of the values in a record."""
    chosen = _scalar_entry(node, getattr(cls, "unit_variant", ""))
    return scope._replace(variant=variant_inside(cls, chosen.text if chosen else None, scope.variant))


def _refuse_unknown_keys(cls: type, node: tree.Mapping, known: Collection[str], scope: Scope) -> set[str]:
    """Note unknown keys; return the known keys probably meant, which are then not reported as missing."""
    meant: set[str] = set()
    for key, line in node.key_lines.items():
        if key in getattr(cls, "not_yet", ()):
            scope.problems.add(line, f"{key!r} is not supported yet")
        elif key not in known:
            scope.problems.add(line, f"unknown key {quoted(key)}{did_you_mean(key, known)}")
            meant.update(filter(None, [nearest(key, known)]))
    return meant - node.entries.keys()


def _read_field(name: str, field: Field, node: tree.Mapping, prefix: str, scope: Scope) -> Any:
    content = node.entries.get(name)
    if content is None:
        example = f", e.g. {name}: {{type: constant, value: ...}}" if "constant" in field.kind.records else ""
        scope.problems.add(node.line, f"{prefix}missing key {name!r} ({field.doc}){example}")
        return INVALID
    value = field.kind.read(content, name, scope)
    if value is INVALID:
        return INVALID
    problems = list(field.problems(name, value))
    _note(problems, name, field.kind.per_joint, node, scope)
    return INVALID if problems else value


def _note(
    problems: Iterable[FieldProblem], name: str, of_joints: bool, node: tree.Mapping, scope: Scope
) -> None:
    """Note the problems of a field; joints with the same problem share a message."""
    equal: dict[tuple[int, str, str], list[str]] = {}
    for problem in problems:
        joint = list(scope.members)[int(problem.path[-1])] if of_joints else ""
        message = problem.in_units(scope.members[joint] if of_joints else scope.variant).message
        fault = "" if of_joints else f"{name}: {problem.message}"
        equal.setdefault((line_of(problem.path, node, scope), message, fault), []).append(joint)
    for (line, message, fault), joints in equal.items():
        place = _of_joints(joints, scope) if of_joints else ""
        scope.problems.add(line, f"{name}{place}: {message}", fault)


def _of_joints(joints: Sequence[str], scope: Scope) -> str:
    """Return the joints that share a problem, after the name of a field; empty if all joints do."""
    if len(joints) > 1 and len(joints) == len(scope.members):
        return ""
    return f" of {'joint' if len(joints) == 1 else 'joints'} {', '.join(joints)}"


def line_of(path: FieldPath, node: Node, scope: Scope) -> int:
    """Return the line of the deepest node along a path; a scalar counts for all entries of its value."""
    for step in path:
        if isinstance(node, tree.Mapping):
            key = list(scope.members)[step] if isinstance(step, int) else step
            if key not in node.entries:
                break
            node = node.entries[key]
        elif isinstance(node, tree.Sequence) and isinstance(step, int):
            node = node.items[step]
    return node.line
