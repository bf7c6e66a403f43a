"""NumPy's other functions on arrays of symbols and constants."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vsacli.compute.tracing.symbol import Operand, Symbol, Table
from vsacli.compute.tracing.tape import Tape
from vsacli.compute.tracing.ufuncs import Cells, each, elementwise

STRUCTURAL: frozenset[Callable[..., Any]] = frozenset(
    {
        *(np.stack, np.concatenate, np.broadcast_to, np.moveaxis, np.transpose, np.reshape, np.ravel),
        *(np.full_like, np.zeros_like, np.ones_like, np.empty_like, np.atleast_1d, np.shape, np.ndim),
        *(np.diag, np.diagonal, np.copy),
    }
)
"""Functions that only arrange entries, whatever these are."""


def _where(tape: Tape, truth: Any, a: Any, b: Any) -> Cells:
    if any(np.asarray(argument).dtype.kind == "u" for argument in (a, b)):
        raise NotImplementedError("bits are recorded as set or not: truth.astype(numpy.uint16) * bits")
    return each(lambda *entries: _choice(tape, *entries), truth, a, b)


def _choice(tape: Tape, truth: Operand, a: Operand, b: Operand) -> Operand:
    if not isinstance(truth, Symbol):
        return a if truth else b
    return tape.record("where", truth, a, b)


def _clip(tape: Tape, values: Any, low: Any, high: Any) -> Cells:
    raised = elementwise(tape, np.maximum, *map(_objects, (values, low)))
    return elementwise(tape, np.minimum, raised, _objects(high))


def _searchsorted(tape: Tape, nodes: Any, values: Any, *, side: str = "left") -> Cells:
    if side != "right":
        raise NotImplementedError("numpy.searchsorted is recorded with side='right' only")
    table = Table(tuple(np.asarray(nodes, dtype=np.float64).tolist()))
    return each(lambda cell: tape.record("searchsorted", table, cell), values)


def _objects(argument: Any) -> Cells:
    return np.asarray(argument, dtype=object)


FUNCTIONS: dict[Callable[..., Any], Callable[..., Cells]] = {
    np.where: _where,
    np.clip: _clip,
    np.searchsorted: _searchsorted,
}
"""Functions of entries."""
