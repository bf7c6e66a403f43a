"""Fields of records as arrays: joined over the entries of lists, whatever fields those have."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.units import Quantity


class ResolvedField(NamedTuple):
    """The values of one declared field.

    Attributes:
        path: keys that lead to it in a file, e.g. ("joints", "link", "mass").
        dims: one name an axis of `values`: joint, motor, axis, bound or direction.
        quantity: unit at revolute and prismatic joints, None for text.
        doc: the declared sentence.
        values: float64 or str objects; NaN or "" at entries that do not have the field.
    """

    path: tuple[str, ...]
    dims: tuple[str, ...]
    quantity: Quantity | None
    doc: str
    values: np.ndarray[Any, np.dtype[Any]]


def single(dims: tuple[str, ...], quantity: Quantity | None, content: Any) -> ResolvedField:
    """One text, one number, or numbers along the dimensions, whose path and sentence are still to come."""
    values = np.array(content, dtype=object if quantity is None else np.float64)
    return ResolvedField((), dims, quantity, "", values)


def stacked(dim: str, members: Iterable[Iterable[ResolvedField]]) -> Iterator[ResolvedField]:
    """Join the fields of all joints, or of both sides of a joint, along a new first axis."""
    parts = [list(member) for member in members]
    tables = [{part.path: part.values for part in member} for member in parts]
    for path, part in _prototypes(parts).items():
        absent = np.full_like(part.values, "" if part.quantity is None else np.nan)
        values = np.stack([_fitted(table.get(path, absent), absent) for table in tables])
        yield part._replace(dims=(dim, *part.dims), values=values)


def _prototypes(members: Sequence[list[ResolvedField]]) -> dict[tuple[str, ...], ResolvedField]:
    """Of each field the one with most dimensions: a joint may have one motor or spring, or two."""
    prototypes: dict[tuple[str, ...], ResolvedField] = {}
    for part in (part for member in reversed(members) for part in member):
        if part.path not in prototypes or len(part.dims) >= len(prototypes[part.path].dims):
            prototypes[part.path] = part
    return prototypes


def _fitted(values: np.ndarray[Any, Any], absent: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The values in the shape of those of two sides, if they are those of one: as of the first."""
    if values.shape == absent.shape:
        return values
    fitted = absent.copy()
    fitted[0] = values[()]
    return fitted
