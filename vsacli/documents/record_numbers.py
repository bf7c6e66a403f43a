"""The numbers of records, each with the path that leads to it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from vsacli.base.units import Quantity
from vsacli.documents.kinds.lists import Pair
from vsacli.documents.records import Kind, declared


class Entry(NamedTuple):
    """A step into a list, or into values by joint: number from 0, and the name if it has one."""

    number: int
    name: str = ""

    def __str__(self) -> str:
        return self.name or str(self.number)


NumberPath: TypeAlias = tuple[str | Entry, ...]
"""Leads to a number of a file; joined by dots as users write it."""


class Number(NamedTuple):
    """A number of a record.

    Attributes:
        path: to it.
        quantity: what it measures.
        value: in SI units.
        requirement: what it must be, as in "must be positive"; "" if it may be any number.
    """

    path: NumberPath
    quantity: Quantity
    value: float
    requirement: str


def numbers(
    record: Any, members: Mapping[str, str] = MappingProxyType({}), path: NumberPath = ()
) -> Iterator[Number]:
    """Every finite number in the declared fields of a record, and in the records in it.

    Args:
        record: whose fields are declared.
        members: name and unit variant of every joint, where the record has values by joint.
        path: to the record.
    """
    for name, (field, _) in declared(type(record)).items():
        requirement = "" if field.check is None else field.check.requirement
        yield from _numbers(field.kind, getattr(record, name), requirement, members, (*path, name))


def _numbers(
    kind: Kind, content: Any, requirement: str, members: Mapping[str, str], path: NumberPath
) -> Iterator[Number]:
    quantity = getattr(kind, "unit", None)
    if content is None:
        return
    if isinstance(kind, Pair) and content[0] is content[1]:
        yield from _numbers(kind.item, content[0], requirement, members, path)
    elif kind.each is not None:
        for number, (name, entry) in enumerate(zip(kind.names(content, members), content, strict=True)):
            yield from _numbers(kind.each, entry, requirement, members, (*path, Entry(number, name)))
    elif kind.records:
        yield from numbers(content, members, path)
    elif quantity is not None and math.isfinite(content):
        yield Number(path, quantity, float(content), requirement)
