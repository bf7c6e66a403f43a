"""Values of records in other forms: arrays of a result, JSON values, and single numbers with their paths."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np

from vsacli.base.texts import on_one_line
from vsacli.base.units import Quantity
from vsacli.documents.fields import (
    Items,
    ItemsByName,
    NamedNumbers,
    OneOf,
    OwnKind,
    PairOf,
    PerJoint,
    RecordOf,
    TablePath,
    Text,
    ValueKind,
    declared_fields,
    variant_inside,
)
from vsacli.documents.record_checks import DeclaredRecord, replaced_unchecked

_Record = TypeVar("_Record")


class ResolvedField(NamedTuple):
    """The values of one declared field.

    Attributes:
        path: keys that lead to the field in a file, e.g. ("joints", "link", "mass").
        dims: names of the axes of `values`: joint, tool, motor, axis, bound or direction.
        quantity: unit at revolute and prismatic joints, None for text.
        doc: declared description.
        values: float64 or str objects; NaN or "" at entries without the field.
    """

    path: tuple[str, ...]
    dims: tuple[str, ...]
    quantity: Quantity | None
    doc: str
    values: np.ndarray[Any, np.dtype[Any]]


def resolve_values(
    kind: ValueKind, content: Any, of_record: Callable[[Any], Iterable[ResolvedField]]
) -> Iterator[ResolvedField]:
    """Yield a value of a kind as arrays; `of_record` yields the arrays of a nested record.

    Raises:
        TypeError: the kind has no array form.
    """
    match kind:
        case RecordOf():
            yield from of_record(content)
        case OneOf():
            yield _resolve_single(Text(), kind.word_of(content))._replace(path=("type",))
            yield from of_record(content)
        case NamedNumbers():
            for name, entry in content:
                yield _resolve_single(kind.number, entry)._replace(path=(name,))
        case PairOf(item, dim):
            yield from _stack_members(dim, (resolve_values(item, side, of_record) for side in content))
        case ItemsByName(item=item):
            yield from _stack_members("tool", (resolve_values(item, tool, of_record) for tool in content))
        case Items(item=item, records=records) if records:
            yield from _stack_members("joint", (resolve_values(item, joint, of_record) for joint in content))
        case _:
            yield _resolve_single(kind, content)


def _resolve_single(kind: ValueKind, content: Any) -> ResolvedField:
    """Return one text, one number, or numbers along dimensions; the caller sets path and description."""
    if kind.dims is None:
        raise TypeError(f"a field of the kind {type(kind).__name__} has no array form")
    if kind.unit is None:  # booleans too, which some HDF5 readers lack
        text = content.source.path if isinstance(kind, TablePath) else on_one_line(content)
        return ResolvedField((), kind.dims, None, "", np.array(text, dtype=object))
    return ResolvedField((), kind.dims, kind.unit, "", np.array(content, dtype=np.float64))


def _stack_members(dim: str, members: Iterable[Iterable[ResolvedField]]) -> Iterator[ResolvedField]:
    """Join the fields of all joints or tools, or of both sides of a joint, along a new first axis.

    The variant of a field with most dimensions determines the shape: joints may have one or two motors or
    springs.
    """
    parts = [list(member) for member in members]
    tables = [{part.path: part.values for part in member} for member in parts]
    prototypes: dict[tuple[str, ...], ResolvedField] = {}
    for part in (part for member in reversed(parts) for part in member):
        if part.path not in prototypes or len(part.dims) >= len(prototypes[part.path].dims):
            prototypes[part.path] = part
    for path, part in prototypes.items():
        absent = np.full_like(part.values, "" if part.quantity is None else np.nan)
        values = np.stack([_pad_to_both_sides(table.get(path, absent), absent) for table in tables])
        yield part._replace(dims=(dim, *part.dims), values=values)


def _pad_to_both_sides(values: np.ndarray[Any, Any], absent: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the values in the shape of two sides; values of one side become the first."""
    if values.shape == absent.shape:
        return values
    fitted = absent.copy()
    fitted[0] = values[()]
    return fitted


def json_fields(record: DeclaredRecord) -> dict[str, Any]:
    """Return the declared fields of a record as JSON values, except that numbers may be non-finite."""
    return {
        name: None if (content := getattr(record, name)) is None else value_as_json(field.kind, content)
        for name, (field, _) in declared_fields(type(record)).items()
    }


def value_as_json(kind: ValueKind, content: Any, of_record: Callable[[Any], Any] = json_fields) -> Any:
    """Return a value of a kind as JSON value, except that numbers may be non-finite."""
    match kind:
        case OwnKind():
            return kind.json_value(content, of_record)
        case RecordOf():
            return of_record(content)
        case OneOf():
            return {"type": kind.word_of(content), **of_record(content)}
        case NamedNumbers():
            return dict(content)
        case TablePath():
            return content.source.path
        case ItemsByName(item=item):
            fields = (value_as_json(item, entry, of_record) for entry in content)
            return {each.pop(kind.unique): each for each in fields}
        case ValueKind(item=ValueKind() as item):
            return [value_as_json(item, entry, of_record) for entry in content]
    return content


class PathIndex(NamedTuple):
    """An element of a path into a list or values by joint: index from 0, and the name if it has one."""

    number: int
    name: str = ""

    def __str__(self) -> str:
        return self.name or str(self.number)


NumberPath: TypeAlias = tuple[str | PathIndex, ...]
"""Path to a number of a file; users write it joined by dots."""


class NumberAtPath(NamedTuple):
    """A number of a record.

    Attributes:
        path: path to the number.
        quantity: physical quantity.
        value: value in SI units.
        requirement: words that complete "must be", such as "positive"; "" if any number is valid.
    """

    path: NumberPath
    quantity: Quantity
    value: float
    requirement: str


def numbers_in_record(
    record: Any,
    members: Mapping[str, str] = MappingProxyType({}),
    path: NumberPath = (),
    variant: str | None = None,
) -> Iterator[NumberAtPath]:
    """Yield every finite number in the declared fields of a record, nested records included.

    Args:
        record: record with declared fields.
        members: name and unit variant of every joint, if the record has values by joint.
        path: path to the record.
        variant: unit variant in the enclosing record, if it is not that of the joint.
    """
    cls = type(record)
    if hasattr(cls, "unit_variants"):
        variant = variant_inside(cls, getattr(record, cls.unit_variant), variant)
    for name, (field, _) in declared_fields(cls).items():
        requirement = "" if field.check is None else field.check.requirement
        yield from _numbers_in_value(
            field.kind, getattr(record, name), requirement, members, (*path, name), variant
        )


def _numbers_in_value(
    kind: ValueKind,
    content: Any,
    requirement: str,
    members: Mapping[str, str],
    path: NumberPath,
    variant: str | None,
) -> Iterator[NumberAtPath]:
    if content is None:
        return
    if isinstance(kind, PairOf) and content[0] is content[1]:
        yield from _numbers_in_value(kind.item, content[0], requirement, members, path, variant)
    elif kind.item is not None:
        names = entry_names(kind, content, members)
        for number, (name, entry) in enumerate(zip(names, content, strict=True)):
            yield from _numbers_in_value(
                kind.item, entry, requirement, members, (*path, PathIndex(number, name)), variant
            )
    elif kind.records:
        yield from numbers_in_record(content, members, path, variant)
    elif kind.unit is not None and math.isfinite(content):
        yield NumberAtPath(path, kind.unit.inside(variant), float(content), requirement)


def entry_names(kind: ValueKind, content: Any, members: Mapping[str, str]) -> list[str]:
    """Return the names of a value's entries, "" if an entry has none; `members` are the joints, if known."""
    if isinstance(kind, PerJoint) and members:
        return list(members)
    return [getattr(entry, "name", "") if isinstance(kind, Items) else "" for entry in content]


class AtPath(Protocol):
    """A number of a record by its path, such as `NumberAtPath`."""

    @property
    def path(self) -> NumberPath:
        """Path to the number."""


def with_numbers(record: _Record, numbers: Sequence[AtPath], values: Sequence[Any]) -> _Record:
    """Return a record with other values of some numbers, which may be scalars of any kind.

    Rows of samples among them are one value for each sample. Both sides of an equal pair change. Records on
    the paths are made without their checks, so the record cannot be checked or written to a file.
    """
    entries = [(number.path, value) for number, value in zip(numbers, values, strict=True)]
    return _with_scalars(record, entries) if entries else record


def _with_scalars(content: Any, entries: Sequence[tuple[NumberPath, Any]]) -> Any:
    path, scalar = entries[0]
    step = path[0] if path else ""
    if isinstance(content, tuple) and not isinstance(step, PathIndex):
        return (_with_scalars(content[0], entries),) * len(content)
    if not path:
        return scalar
    inside: dict[Any, list[tuple[NumberPath, Any]]] = {}
    for (first, *rest), entry in entries:
        key = first.number if isinstance(first, PathIndex) else first
        inside.setdefault(key, []).append((tuple(rest), entry))
    if isinstance(content, tuple):
        return tuple(
            _with_scalars(entry, inside[index]) if index in inside else entry
            for index, entry in enumerate(content)
        )
    return replaced_unchecked(
        content, {word: _with_scalars(getattr(content, word), entries) for word, entries in inside.items()}
    )


def number_at(record: Any, path: NumberPath) -> float:
    """Return the number at a path, that of the first side of an equal pair."""
    content = record
    for step in path:
        if isinstance(content, tuple) and not isinstance(step, PathIndex):
            content = content[0]
        content = content[step.number] if isinstance(step, PathIndex) else getattr(content, step)
    return float(content[0] if isinstance(content, tuple) else content)
