"""Loops and conditionals per sample, and calls that are recorded once, for kernels that run or are traced.

Everything else in the solvers is elementwise: NumPy functions, comparisons, `np.where`, and lookups in
constant arrays with `np.searchsorted` and `look_up`. So the same code computes blocks of samples, or is
traced to a program for one sample. The functions here have two implementations: `..._on` dispatches on the
class of its first argument, and `vsacli.compute.tracing` registers the one for arrays of symbols.
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
        step: Function from a state and the constants to the next state, and whether the sample is done.
        state: Initial state; arrays of any one shape.
        constants: Further inputs of the step; arrays of that shape.
        limit: Largest number of steps.
    """
    result: Values = repeat_on(state[0], step, state, constants, limit)
    return result


def where_needed(mask: BoolArray, function: Function, arguments: Values, otherwise: Values) -> Values:
    """Return `function(*arguments)` where the mask holds, computed only there; `otherwise` elsewhere."""
    result: Values = where_needed_on(mask, function, arguments, otherwise)
    return result


def look_up(tables: Sequence[FloatArray], index: IndexArray) -> Values:
    """Return the entries of several tables of constants, (count,), at indices of any shape."""
    result: Values = look_up_on(index, tables)
    return result


def cell_of(position: FloatArray, count: int) -> IndexArray:
    """Return the index of the cell with a position, or of the nearest, of `count` cells of width 1 from zero.

    The cell of NaN is arbitrary.
    """
    result: IndexArray = cell_on(position, count)
    return result


def subroutine(function: Function, arguments: Values) -> Values:
    """Return `function(*arguments)`; generated code that must be short contains the function once.

    Args:
        function: Function of arrays (samples,) that returns a tuple of arrays; all of real numbers.
        arguments: Arrays.
    """
    result: Values = subroutine_on(arguments[0], function, arguments)
    return result


def call(row: Any, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return `function(*arguments)`; while tracing, equal calls share one recorded body.

    Calls are equal if their functions are, and their arguments except for rows of samples. So the program of
    a long chain contains the computation of equal joints once. Without tracing, this is a plain call.

    Args:
        row: Any row of samples among the arguments; its class chooses the implementation.
        function: Pure function; hashable, see `Keyed`.
        arguments: Rows of samples, constants, hashable objects, and tuples, lists and dictionaries of such.
    """
    return call_on(row, function, arguments)


@dataclass(frozen=True)
class Keyed:
    """A function that equals another if their keys are equal, for `call`.

    Attributes:
        key: All objects that its results depend on, arguments apart.
        function: Function.
    """

    key: Hashable
    function: Callable[..., Any] = field(compare=False)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        return self.function(*arguments)


@singledispatch
def repeat_on(_: Any, step: Step, state: Values, constants: Values, limit: int) -> Values:
    """Run `repeat` on NumPy arrays."""
    final_state = _repeat_step(step, _ravel_all(state), _ravel_all(constants), limit)
    return _reshape_all(final_state, state[0].shape)


def _repeat_step(step: Step, state: Values, constants: Values, limit: int) -> Values:
    # Samples that are done keep their state. Once they are half of all, the others continue without them.
    result = state
    finished: BoolArray = np.zeros(state[0].size, dtype=bool)
    while limit and 2 * np.count_nonzero(finished) < finished.size:
        state, done = step(state, constants)
        result = _keep_finished(finished, result, state)
        finished = finished | done
        limit -= 1
    unfinished = np.flatnonzero(~finished)
    if not limit or not unfinished.size:
        return result
    continued = _repeat_step(step, _samples_at(result, unfinished), _samples_at(constants, unfinished), limit)
    return _replace_samples(result, unfinished, continued)


def _keep_finished(finished: BoolArray, result: Values, latest: Values) -> Values:
    if not finished.any():
        return latest
    return tuple(np.where(finished, *pair) for pair in zip(result, latest, strict=True))


@singledispatch
def where_needed_on(mask: Any, function: Function, arguments: Values, otherwise: Values) -> Values:
    """Run `where_needed` on NumPy arrays."""
    indices = np.flatnonzero(mask)
    if not indices.size:
        return otherwise
    if indices.size == mask.size:
        return function(*arguments)
    results = _replace_samples(
        _ravel_all(otherwise), indices, function(*_samples_at(_ravel_all(arguments), indices))
    )
    return _reshape_all(results, mask.shape)


@singledispatch
def call_on(_: Any, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """Run `call` on everything but rows of symbols."""
    return function(*arguments)


@singledispatch
def subroutine_on(_: Any, function: Function, arguments: Values) -> Values:
    """Run `subroutine` on NumPy arrays."""
    return function(*arguments)


@singledispatch
def look_up_on(index: Any, tables: Sequence[FloatArray]) -> Values:
    """Run `look_up` on NumPy arrays."""
    return tuple(table[index] for table in tables)


@singledispatch
def cell_on(position: Any, count: int) -> IndexArray:
    """Run `cell_of` on NumPy arrays."""
    cell: IndexArray = np.fmin(np.fmax(position, 0), count - 1).astype(np.intp)
    return cell


def _ravel_all(arrays: Values) -> Values:
    return tuple(values.ravel() for values in arrays)


def _reshape_all(arrays: Values, shape: tuple[int, ...]) -> Values:
    return tuple(values.reshape(shape) for values in arrays)


def _samples_at(arrays: Values, samples: IndexArray) -> Values:
    return tuple(values[samples] for values in arrays)


def _replace_samples(arrays: Values, samples: IndexArray, replacement: Values) -> Values:
    result = tuple(np.array(values) for values in arrays)
    for values, replaced in zip(result, replacement, strict=True):
        values[samples] = replaced
    return result
