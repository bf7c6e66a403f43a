"""Loops and branches over samples, each of which runs as if it were alone; and calls that are alike.

Everything else in the solvers is elementwise: NumPy functions, comparisons, `np.where`, and lookups in
constant arrays with `np.searchsorted` and `look_up`. So one text computes blocks of samples, or is traced to
a program for a single one. The functions here have two texts: that of `..._on` is chosen by the class of
its first argument, and `vsacli.compute.tracing` registers the second text, for arrays of symbols.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray

Values = tuple[FloatArray, ...]
Step = Callable[[Values, Values], tuple[Values, BoolArray]]
Function = Callable[..., Values]


def repeat(step: Step, state: Values, constants: Values, limit: int) -> Values:
    """Return the state of each sample after as many steps as it needs, at most `limit`.

    Args:
        step: from a state and the constants to the next state, and whether the sample is done with it.
        state: where to begin; arrays of any one shape.
        constants: further inputs of the step for each sample; arrays of that shape.
        limit: largest number of steps.
    """
    result: Values = repeat_on(state[0], step, state, constants, limit)
    return result


def where_needed(mask: BoolArray, function: Function, arguments: Values, otherwise: Values) -> Values:
    """`function(*arguments)` where the mask holds, computed for those samples only; `otherwise` elsewhere."""
    result: Values = where_needed_on(mask, function, arguments, otherwise)
    return result


def look_up(tables: Sequence[FloatArray], index: IndexArray) -> Values:
    """Return the entries of several tables of constants, (count,), at indices of any shape."""
    result: Values = look_up_on(index, tables)
    return result


def cell_of(position: FloatArray, count: int) -> IndexArray:
    """Index of the cell in which a position lies, or of the nearest: of `count` of width 1 from zero on.

    NaN lies in any.
    """
    result: IndexArray = cell_on(position, count)
    return result


def subroutine(function: Function, arguments: Values) -> Values:
    """`function(*arguments)`, which code that must be short has once, however often it is computed.

    Args:
        function: from arrays (samples,) to as many as it likes; what it takes and returns are real numbers.
        arguments: the arrays.
    """
    result: Values = subroutine_on(arguments[0], function, arguments)
    return result


def call(row: Any, function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)`, which may be recorded once for all calls that are alike.

    These have equal functions, and arguments that are equal but for rows of samples. So what is computed
    joint by joint need not be written out as often.

    Args:
        row: any of the rows of samples among the arguments.
        function: one that does nothing but compute its result, of nothing but its arguments; hashable.
        arguments: rows of samples, constants, hashable objects, and tuples, lists and dictionaries of such.
    """
    return call_on(row, function, arguments)


@dataclass(frozen=True)
class Keyed:
    """A function that equals another one if its key does, for `call`.

    Attributes:
        key: all that decides on its results.
        function: the function.
    """

    key: Hashable
    function: Callable[..., Any] = field(compare=False)

    def __call__(self, *arguments: Any) -> Any:
        """Return the values of the function."""
        return self.function(*arguments)


@singledispatch
def repeat_on(_: Any, step: Step, state: Values, constants: Values, limit: int) -> Values:
    """`repeat` on NumPy arrays."""
    found = _repeated(step, _flat(state), _flat(constants), limit)
    return _shaped(found, state[0].shape)


def _repeated(step: Step, state: Values, constants: Values, limit: int) -> Values:
    """Samples that are done keep their state; once they are half of all, the others go on without them."""
    result = state
    over: BoolArray = np.zeros(state[0].size, dtype=bool)
    while limit and 2 * np.count_nonzero(over) < over.size:
        state, done = step(state, constants)
        result = _kept(over, result, state)
        over = over | done
        limit -= 1
    going = np.flatnonzero(~over)
    if not limit or not going.size:
        return result
    rest = _repeated(step, _taken(result, going), _taken(constants, going), limit)
    return _put(result, going, rest)


def _kept(over: BoolArray, result: Values, latest: Values) -> Values:
    if not over.any():
        return latest
    return tuple(np.where(over, *pair) for pair in zip(result, latest, strict=True))


@singledispatch
def where_needed_on(mask: Any, function: Function, arguments: Values, otherwise: Values) -> Values:
    """`where_needed` on NumPy arrays."""
    samples = np.flatnonzero(mask)
    if not samples.size:
        return otherwise
    if samples.size == mask.size:
        return function(*arguments)
    found = _put(_flat(otherwise), samples, function(*_taken(_flat(arguments), samples)))
    return _shaped(found, mask.shape)


@singledispatch
def call_on(_: Any, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """`call` on anything but rows of symbols."""
    return function(*arguments)


@singledispatch
def subroutine_on(_: Any, function: Function, arguments: Values) -> Values:
    """`subroutine` on NumPy arrays."""
    return function(*arguments)


@singledispatch
def look_up_on(index: Any, tables: Sequence[FloatArray]) -> Values:
    """`look_up` on NumPy arrays."""
    return tuple(table[index] for table in tables)


@singledispatch
def cell_on(position: Any, count: int) -> IndexArray:
    """`cell_of` on NumPy arrays."""
    cell: IndexArray = np.fmin(np.fmax(position, 0), count - 1).astype(np.intp)
    return cell


def _flat(arrays: Values) -> Values:
    return tuple(values.ravel() for values in arrays)


def _shaped(arrays: Values, shape: tuple[int, ...]) -> Values:
    return tuple(values.reshape(shape) for values in arrays)


def _taken(arrays: Values, samples: IndexArray) -> Values:
    return tuple(values[samples] for values in arrays)


def _put(arrays: Values, samples: IndexArray, latest: Values) -> Values:
    result = tuple(np.array(values) for values in arrays)
    for values, each in zip(result, latest, strict=True):
        values[samples] = each
    return result
