"""A robot as plain arrays, generated from the declared fields of its records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.motor import Motor
from vsacli.base.units import Quantity
from vsacli.documents.fields import (
    Choice,
    Field,
    Interval,
    Items,
    Kind,
    Number,
    OneOf,
    Pair,
    Record,
    TableFile,
    Text,
    Vector,
    declared,
)
from vsacli.robot.model import Robot

LABELS = {"axis": ("x", "y", "z"), "bound": ("lower", "upper")}
"""Dimensions that only the robot's arrays have."""


class ResolvedField(NamedTuple):
    """The values of one declared field.

    Attributes:
        path: keys that lead to it in a robot file, e.g. ("joints", "link", "mass").
        dims: one name an axis of `values`: joint, motor, axis or bound.
        quantity: unit at revolute and prismatic joints, None for text.
        doc: the declared sentence.
        values: float64 or str objects; NaN or "" at joints that do not have the field.
    """

    path: tuple[str, ...]
    dims: tuple[str, ...]
    quantity: Quantity | None
    doc: str
    values: np.ndarray[Any, np.dtype[Any]]


def resolve(robot: Robot) -> list[ResolvedField]:
    """Every declared field of a robot, defaults included, in SI units."""
    return list(_of_record(robot))


def _of_record(record: Any) -> Iterator[ResolvedField]:
    for name, (field, _) in declared(type(record)).items():
        content = getattr(record, name)
        if content is not None:
            for part in _of_kind(field.kind, content, field):
                yield part._replace(path=(name, *part.path))


def _of_kind(kind: Kind, content: Any, field: Field) -> Iterable[ResolvedField]:
    match kind:
        case Number(unit):
            return [_leaf((), unit, field, float(content))]
        case Vector(_, unit):
            return [_leaf(("axis",), unit, field, content)]
        case Interval(unit):
            return [_leaf(("bound",), unit, field, content)]
        case Text() | Choice():
            return [_leaf((), None, field, content)]
        case TableFile():
            return [_leaf((), None, field, content.source.path)]
        case Record():
            return _of_record(content.at_joint if isinstance(content, Motor) else content)
        case OneOf():
            return _of_variant(kind, content, field)
        case Pair(item):
            return _stack("motor", [list(_of_kind(item, side, field)) for side in content])
        case Items(Record()):
            return _stack("joint", [list(_of_record(joint)) for joint in content])
    raise TypeError(f"a field of the kind {kind} has no array form")


def _leaf(dims: tuple[str, ...], quantity: Quantity | None, field: Field, content: Any) -> ResolvedField:
    values = np.array(content, dtype=object if quantity is None else np.float64)
    return ResolvedField((), dims, quantity, field.doc, values)


def _of_variant(kind: OneOf, content: Any, field: Field) -> Iterator[ResolvedField]:
    word = next(name for name, variant in kind.variants.items() if type(content) is variant)
    yield _leaf((), None, field, word)._replace(path=("type",))
    yield from _of_record(content)


def _stack(dim: str, members: Sequence[list[ResolvedField]]) -> Iterator[ResolvedField]:
    """Join the fields of all joints, or of both sides of a joint, along a new first axis."""
    tables = [{part.path: part.values for part in member} for member in members]
    for path, part in _prototypes(members).items():
        absent = np.full_like(part.values, "" if part.quantity is None else np.nan)
        values = np.stack([_fitted(table.get(path, absent), absent) for table in tables])
        yield part._replace(dims=(dim, *part.dims), values=values)


def _prototypes(members: Sequence[list[ResolvedField]]) -> dict[tuple[str, ...], ResolvedField]:
    """Of each field the one with most dimensions: a motor may be one of a joint, or one of two."""
    prototypes: dict[tuple[str, ...], ResolvedField] = {}
    for part in (part for member in reversed(members) for part in member):
        if part.path not in prototypes or len(part.dims) >= len(prototypes[part.path].dims):
            prototypes[part.path] = part
    return prototypes


def _fitted(values: np.ndarray[Any, Any], absent: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The values in the shape of those of two motors, if they are those of one: as of the first."""
    if values.shape == absent.shape:
        return values
    fitted = absent.copy()
    fitted[0] = values
    return fitted
