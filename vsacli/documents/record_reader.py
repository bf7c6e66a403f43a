"""Reading of records from the tree of a document: its nodes become checked values, and these become records.

Problems are noted with their lines and reading continues, so that all problems of a file are reported
together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import FieldProblem, InputError, InvalidRecordError
from vsacli.base.texts import counted
from vsacli.base.units import DIMENSIONLESS
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import (
    REQUIRED,
    Boolean,
    Field,
    FieldPath,
    Integer,
    Interval,
    Items,
    ItemsByName,
    Name,
    NamedNumbers,
    NumberList,
    NumberWithUnit,
    OneOf,
    OneOrMore,
    OwnKind,
    PairOf,
    PerJoint,
    RecordOf,
    Share,
    TablePath,
    Text,
    ValueKind,
    WordChoice,
    declared_fields,
    variant_inside,
)
from vsacli.documents.number import BOOLEANS, DECIMAL, PER_CENT, evaluate, expected_number
from vsacli.documents.record_checks import (
    DeclaredRecord,
    already_used,
    field_problems,
    repetitions,
    unknown_word,
)
from vsacli.documents.tree import INVALID, NULLS, ListNode, MapNode, Node, Scope, TextNode, all_valid, quoted

BOOLEAN_LITERALS = ("true", "false")
WITHOUT_UNIT = NumberWithUnit(DIMENSIONLESS)
NOT_TEXTS = BOOLEANS | NULLS
"""Words without quotes that are no texts in YAML, in lower case."""


def read_record(
    cls: type[DeclaredRecord], node: MapNode, label: str, scope: Scope, beside: tuple[str, ...] = ()
) -> Any:
    """Return a mapping as a record, or INVALID; the additional keys `beside` are left to the caller."""
    prefix = f"{label}: " if label else ""
    scope = scope_inside(scope, cls, node)
    fields = declared_fields(cls)
    mistyped_keys = _refuse_unknown_keys(cls, node, (*fields, *beside), scope)
    values: dict[str, Any] = {}
    for name, (field, default) in fields.items():
        if name in node.entries:
            values[name] = read_value(field.kind, node.entries[name], name, scope)
        elif default is REQUIRED and name not in mistyped_keys:
            _note_missing(name, field, node, prefix, scope)
            values[name] = INVALID
    valid_values = {name: content for name, content in values.items() if content is not INVALID}
    problems = list(field_problems(cls, valid_values))
    if problems:
        _note_field_problems(problems, fields, node, scope)
    if problems or len(valid_values) < len(values) or not mistyped_keys.isdisjoint(fields):
        return INVALID
    try:
        return cls.of_valid_fields(valid_values)
    except InvalidRecordError as error:
        _note_record_problems(error.fields, node, prefix, scope)
    except InputError as error:
        scope.problems.include(error)
    return INVALID


def scope_inside(scope: Scope, cls: type, node: MapNode) -> Scope:
    """Return the scope of the values in a record."""
    if not hasattr(cls, "unit_variant"):
        return scope
    variant_node = _scalar_entry(node, cls.unit_variant)
    return scope._replace(
        variant=variant_inside(cls, variant_node.text if variant_node else None, scope.variant)
    )


def _scalar_entry(node: Node, key: str) -> TextNode | None:
    entry = node.entries.get(key) if isinstance(node, MapNode) else None
    return entry if isinstance(entry, TextNode) else None


def _refuse_unknown_keys(cls: type, node: MapNode, valid_keys: Collection[str], scope: Scope) -> set[str]:
    """Note unknown keys; return the known keys probably meant, which are then not reported as missing."""
    intended_keys: set[str] = set()
    for key, line in node.key_lines.items():
        if key in valid_keys:
            continue
        if key in getattr(cls, "not_yet", ()):
            scope.problems.add(line, f"{key!r} is not supported yet")
        else:
            scope.problems.add(line, f"unknown key {quoted(key)}{did_you_mean(key, valid_keys)}")
            intended_keys.update(filter(None, [nearest(key, valid_keys)]))
    return intended_keys - node.entries.keys()


def _note_missing(name: str, field: Field, node: MapNode, prefix: str, scope: Scope) -> None:
    example = f", e.g. {name}: {{type: constant, value: ...}}" if "constant" in field.kind.records else ""
    scope.problems.add(node.line, f"{prefix}missing key {name!r} ({field.doc}){example}")


def _note_field_problems(
    problems: Iterable[FieldProblem],
    fields: Mapping[str, tuple[Field, Any]],
    node: MapNode,
    scope: Scope,
) -> None:
    """Note the problems of fields; joints with the same problem of a field share a message."""
    members = list(scope.members)
    joints_by_problem: dict[tuple[str, int, str, str], list[str]] = {}
    for problem in problems:
        name = str(problem.path[0])
        is_per_joint = fields[name][0].kind.per_joint
        joint = members[int(problem.path[-1])] if is_per_joint else ""
        message = problem.in_units(scope.members[joint] if is_per_joint else scope.variant).message
        fault = "" if is_per_joint else f"{name}: {problem.message}"
        joints_by_problem.setdefault(
            (name, line_along(problem.path, node, scope), message, fault), []
        ).append(joint)
    for (name, line, message, fault), joints in joints_by_problem.items():
        scope.problems.add(line, f"{name}{_joints_with_problem(joints, members)}: {message}", fault)


def _joints_with_problem(joints: Sequence[str], members: Sequence[str]) -> str:
    """Return the joints that share a problem, after the name of a field; empty if all joints do."""
    if not joints[0] or (len(joints) > 1 and len(joints) == len(members)):
        return ""
    return f" of {'joint' if len(joints) == 1 else 'joints'} {', '.join(joints)}"


def _note_record_problems(problems: Iterable[FieldProblem], node: MapNode, prefix: str, scope: Scope) -> None:
    """Note the problems of a record whose fields are valid."""
    for problem in problems:
        message = problem.in_units(scope.variant).in_file(list(scope.members))
        fault = f"{prefix}{problem.path} {problem.joint} {problem.message}"
        scope.problems.add(line_along(problem.path, node, scope), f"{prefix}{message}", fault)


def line_along(path: FieldPath, node: Node, scope: Scope) -> int:
    """Return the line of the deepest node along a path; a scalar counts for all entries of its value."""
    for step in path:
        if isinstance(node, MapNode):
            key = list(scope.members)[step] if isinstance(step, int) else step
            if key not in node.entries:
                break
            node = node.entries[key]
        elif isinstance(node, ListNode) and isinstance(step, int):
            node = node.items[step]
    return node.line


def read_value(kind: ValueKind, node: Node, label: str, scope: Scope) -> Any:
    """Return the value of a node, named `label` in messages; INVALID after noting a problem."""
    if isinstance(kind, OwnKind):
        return kind.read(node, label, scope)
    return _READERS[type(kind)](kind, node, label, scope)


def _read_number(kind: NumberWithUnit, node: Node, label: str, scope: Scope) -> Any:
    """Return the number in SI units; an unknown variant, itself a problem, counts as revolute."""
    if (
        isinstance(node, TextNode)
        and DECIMAL.fullmatch(node.text)
        and math.isfinite(decimal := float(node.text))
    ):
        return decimal
    unit = kind.unit.unit(scope.variant or "revolute")
    if not isinstance(node, TextNode) or node.is_null:
        return scope.unexpected(node, expected_number(unit), label)
    try:
        return evaluate(node.text, unit)
    except ExpressionError as error:
        scope.problems.add(node.line, f"{label}: {error}")
        return INVALID


def _read_share(kind: Share, node: Node, label: str, scope: Scope) -> Any:
    share = PER_CENT.fullmatch(node.text) if isinstance(node, TextNode) else None
    if share is None:
        return _read_number(kind, node, label, scope)
    number = _read_number(kind, TextNode(node.line, share["number"], plain=True), label, scope)
    return number if number is INVALID else number / 100


def _read_integer(_kind: Integer, node: Node, label: str, scope: Scope) -> Any:
    number = _read_number(WITHOUT_UNIT, node, label, scope)
    if number is INVALID or number.is_integer():
        return number if number is INVALID else int(number)
    return scope.unexpected(node, "a whole number", label)


def _read_boolean(_kind: Boolean, node: Node, label: str, scope: Scope) -> Any:
    if isinstance(node, TextNode) and node.plain and node.text in BOOLEAN_LITERALS:
        return node.text == "true"
    return scope.unexpected(node, "true or false", label)


def read_text(_kind: ValueKind, node: Node, label: str, scope: Scope) -> Any:
    """Return a text as written, unless YAML reads it as another type; see `read_value`."""
    if isinstance(node, TextNode) and not (node.plain and node.text.lower() in NOT_TEXTS):
        return node.text
    is_boolean = isinstance(node, TextNode) and not node.is_null
    reason = ", a boolean in YAML; put it in quotes" if is_boolean else ""
    return scope.unexpected(node, "a text", label, reason)


def _read_choice(kind: WordChoice, node: Node, label: str, scope: Scope) -> Any:
    """Return the word, which the check of the field compares with the options."""
    if isinstance(node, TextNode) and (node.text in kind.options or not node.is_null):
        return node.text
    return scope.unexpected(node, f"one of {', '.join(kind.options)}", label)


def _read_table_file(kind: TablePath, node: Node, label: str, scope: Scope) -> Any:
    """Return the table in a file, whose problems are noted under the name of that file."""
    name = read_text(kind, node, label, scope)
    if name is INVALID:
        return INVALID
    from vsacli.documents.table import read_table

    try:
        table = read_table(Path(scope.problems.file).parent / name)
        if table.columns != kind.columns:
            message = f"expected the header {','.join(kind.columns)}, found {','.join(table.columns)}"
            raise InputError.one(message, table.source.path, 1)
    except InputError as error:
        scope.problems.include(error)
        return INVALID
    return table


def _read_vector(kind: NumberList, node: Node, label: str, scope: Scope) -> Any:
    """Return the numbers, which the check of the field counts."""
    if not isinstance(node, ListNode):
        return scope.unexpected(node, f"a list of {kind.length} numbers in {kind.unit}", label)
    return all_valid(_read_number(kind.item, item, label, scope) for item in node.items)


def _read_interval(kind: Interval, node: Node, label: str, scope: Scope) -> Any:
    if isinstance(node, TextNode):
        upper = _read_number(kind.item, node, label, scope)
        return upper if upper is INVALID else (-upper if kind.lowest is None else kind.lowest, upper)
    if isinstance(node, ListNode) and len(node.items) == 2:
        return all_valid(_read_number(kind.item, item, label, scope) for item in node.items)
    return scope.unexpected(node, "[lower, upper] or one number", label)


def _read_named_numbers(kind: NamedNumbers, node: Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, MapNode):
        return scope.unexpected(node, "a mapping from names to numbers", label)
    numbers = all_valid(
        _read_number(kind.number, entry, f"{label}.{name}", scope) for name, entry in node.entries.items()
    )
    return numbers if numbers is INVALID else tuple(zip(node.entries, numbers, strict=True))


def _read_items(kind: Items, node: Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, ListNode) or not node.items:
        return scope.unexpected(node, "a list with at least one entry", label)
    values = all_valid([read_value(kind.item, item, label, scope) for item in node.items])
    return INVALID if kind.unique and _note_repeated(kind.unique, node, label, scope) else values


def _read_items_by_name(kind: ItemsByName, node: Node, label: str, scope: Scope) -> Any:
    """Return the records of a mapping, each with its key as `name`."""
    if not isinstance(node, MapNode) or not node.entries:
        return scope.unexpected(node, "a mapping with at least one name", label)
    assert kind.unique is not None, "see ItemsByName"
    keys = {"type", *(key for cls in kind.records.values() for key in declared_fields(cls))}
    if keys >= node.entries.keys() and not any(isinstance(each, MapNode) for each in node.entries.values()):
        example = f"{kind.noun.upper()}: {{{', '.join(f'{key}: ...' for key in node.entries)}}}"
        scope.problems.add(node.line, f"{label}: name the {kind.noun} first, as in {label}: {{{example}}}")
        return INVALID
    records = []
    for name, entry in node.entries.items():
        line, entry_with_name = node.key_lines[name], entry
        if isinstance(entry, MapNode):
            if kind.unique in entry.entries:
                message = f"{label}.{name}: leave out {kind.unique!r}; the key {name!r} is the {kind.unique}"
                scope.problems.add(entry.key_lines[kind.unique], message)
            entries = {**entry.entries, kind.unique: TextNode(line, name, plain=False)}
            entry_with_name = entry._replace(
                entries=entries, key_lines={**entry.key_lines, kind.unique: line}
            )
        records.append(read_value(kind.item, entry_with_name, f"{label}.{name}", scope))
    return all_valid(records)


def _note_repeated(key: str, node: ListNode, label: str, scope: Scope) -> bool:
    """Note the entries of a list whose text under a key occurred before; return whether there are any."""
    entries = [_scalar_entry(item, key) for item in node.items]
    repeated = list(repetitions(entry.text if entry else None for entry in entries))
    for index, first_index in repeated:
        line, first_line = (line_along((place, key), node, scope) for place in (index, first_index))
        message = already_used(entries[index].text, f"in line {first_line}")  # type: ignore[union-attr]
        scope.problems.add(line, f"{label}.{key}: {message}")
    return bool(repeated)


def _read_one_or_more(kind: OneOrMore, node: Node, label: str, scope: Scope) -> Any:
    if isinstance(node, ListNode):
        return _read_items(kind, node, label, scope)
    single_value = read_value(kind.item, node, label, scope)
    return single_value if single_value is INVALID else (single_value,)


def _read_pair(kind: PairOf, node: Node, label: str, scope: Scope) -> Any:
    if isinstance(node, MapNode) and _names_sides(kind, node):
        keys = ", ".join(map(quoted, node.entries))
        expected = "one mapping for both sides or a list of two"
        scope.problems.add(node.line, f"{label}: expected {expected}, found the keys {keys}")
        return INVALID
    if not isinstance(node, ListNode):
        side_value = read_value(kind.item, node, label, scope)
        return side_value if side_value is INVALID else (side_value, side_value)
    if len(node.items) != 2:
        return scope.unexpected(node, "one value for both sides or a list of 2", label)
    return all_valid([read_value(kind.item, item, label, scope) for item in node.items])


def _names_sides(kind: PairOf, node: MapNode) -> bool:
    """Return whether mappings stand under unknown keys, as in `{flexor: {...}, extensor: {...}}`."""
    if not node.entries or not all(isinstance(value, MapNode) for value in node.entries.values()):
        return False
    item_keys = {"type", *(name for cls in kind.records.values() for name in declared_fields(cls))}
    return item_keys.isdisjoint(node.entries)


def _read_per_joint(kind: PerJoint, node: Node, label: str, scope: Scope) -> Any:
    """Return a number for each joint in its unit, None if exempt; or add the node to a survey."""
    if scope.survey is not None:
        scope.survey.append((kind.unit, node))
        return INVALID
    exempt = scope.exempt.get(kind.purpose, {})
    nodes = _nodes_by_joint(node, label, scope, exempt)
    if nodes is None:
        return INVALID
    return all_valid(
        _refuse_number(nodes.get(name), name, exempt[name], label, scope)
        if name in exempt
        else _read_number(kind.item, nodes[name], label, scope.of_member(name))
        for name in scope.members
    )


def _refuse_number(node: Node | None, name: str, reason: str, label: str, scope: Scope) -> Any:
    """Return None for an exempt joint; note a problem if it has a value."""
    if node is None or (isinstance(node, TextNode) and node.is_null):
        return None
    return scope.unexpected(node, f"no value for {name}", label, f": {reason}")


def _nodes_by_joint(
    node: Node, label: str, scope: Scope, exempt: Mapping[str, str]
) -> Mapping[str, Node] | None:
    """Return the node for each joint (a scalar for all except exempt ones); None if joints are wrong."""
    names = scope.members
    match node:
        case TextNode():
            return {name: node for name in names if name not in exempt}
        case ListNode(items=items) if len(items) != len(names):
            expected = f"{counted(len(names), 'value')}, one for each joint ({', '.join(names)})"
            mismatch = f"found {len(items)}; is the file for another robot?"
            scope.problems.add(node.line, f"{label}: expected {expected}, {mismatch}")
            return None
        case ListNode(items=items):
            return dict(zip(names, items, strict=True))
        case MapNode(entries=entries):
            return entries if _check_names(node, label, scope, exempt) else None


def _check_names(node: MapNode, label: str, scope: Scope, exempt: Mapping[str, str]) -> bool:
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


def _read_mapping(kind: RecordOf, node: Node, label: str, scope: Scope) -> Any:
    if isinstance(node, MapNode):
        return read_record(kind.cls, node, label, scope)
    required = (name for name, (_, default) in declared_fields(kind.cls).items() if default is REQUIRED)
    keys = [name for name in required if name != getattr(kind.cls, "keyed_by", None)]
    keys_clause = f" with the {'key' if len(keys) == 1 else 'keys'} {', '.join(keys)}" if keys else ""
    return scope.unexpected(node, f"a mapping{keys_clause}", label)


def _read_one_of(kind: OneOf, node: Node, label: str, scope: Scope) -> Any:
    if not isinstance(node, MapNode):
        return scope.unexpected(node, "a mapping with the key 'type'", label)
    selector = node.entries.get("type")
    if selector is None:
        scope.problems.add(node.line, f"{label}: missing key 'type', one of {', '.join(kind.records)}")
        return INVALID
    if not isinstance(selector, TextNode) or (selector.text not in kind.records and selector.is_null):
        return scope.unexpected(selector, f"one of {', '.join(kind.records)}", f"{label}.type")
    if selector.text not in kind.records:
        reason = unknown_word(selector.text, kind.records, kind.not_yet)
        scope.problems.add(selector.line, f"{label}.type: {reason}")
        return INVALID
    return read_record(kind.records[selector.text], node, label, scope, beside=("type",))


_READERS: Mapping[type[ValueKind], Callable[[Any, Node, str, Scope], Any]] = {
    NumberWithUnit: _read_number,
    Share: _read_share,
    Integer: _read_integer,
    Boolean: _read_boolean,
    Text: read_text,
    Name: read_text,
    WordChoice: _read_choice,
    TablePath: _read_table_file,
    NumberList: _read_vector,
    Interval: _read_interval,
    NamedNumbers: _read_named_numbers,
    Items: _read_items,
    ItemsByName: _read_items_by_name,
    OneOrMore: _read_one_or_more,
    PairOf: _read_pair,
    PerJoint: _read_per_joint,
    RecordOf: _read_mapping,
    OneOf: _read_one_of,
}
"""The reader of each kind that more than one module declares."""
