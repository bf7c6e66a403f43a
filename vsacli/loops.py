"""Loops and branches over samples, each of which runs as if it were alone.

Everything else in the solvers is elementwise: NumPy functions, comparisons, `np.where`, and lookups in
constant arrays with `np.searchsorted` and `look_up`. So one text computes blocks of samples, or is recorded
as a program for a single one, for which the three functions here have another text.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from typing import Any

import numpy as np

from vsacli.arrays import BoolArray, FloatArray, IndexArray

Values = tuple[FloatArray, ...]
Step = Callable[[Values, Values], tuple[Values, BoolArray]]
Function = Callable[..., Values]


def repeat(step: Step, state: Values, constants: Values, limit: int) -> Values:
    """The state of each sample after as many steps as it needs, at most `limit`.

    Args:
        step: from a state and the constants to the next state, and whether the sample is done with it.
        state: where to begin; arrays of any one shape.
        constants: what else the step needs of each sample; arrays of that shape.
        limit: largest number of steps.
    """
    result: Values = repeating(state[0], step, state, constants, limit)
    return result


def where_needed(mask: BoolArray, function: Function, arguments: Values, otherwise: Values) -> Values:
    """`function(*arguments)` where the mask holds, computed for those samples only; `otherwise` elsewhere."""
    result: Values = branching(mask, function, arguments, otherwise)
    return result


def look_up(constants: FloatArray, index: IndexArray) -> FloatArray:
    """The constants (count,) at indices of any shape."""
    result: FloatArray = looking_up(index, constants)
    return result


@singledispatch
def repeating(_: Any, step: Step, state: Values, constants: Values, limit: int) -> Values:
    """`repeat` on NumPy arrays: samples that are done keep their state, and are dropped in time."""
    shape = state[0].shape
    result = tuple(values.flatten() for values in state)
    state, constants = result, tuple(values.ravel() for values in constants)
    samples: IndexArray = np.arange(result[0].size)
    over: BoolArray = np.zeros(samples.size, dtype=bool)
    for _ in range(limit):
        if not samples.size:
            break
        state, done = step(state, constants)
        ending = done & ~over
        _put(result, samples, state, ending)
        over |= done
        if 2 * np.count_nonzero(over) >= over.size:
            going = np.flatnonzero(~over)
            state, constants = _take(state, going), _take(constants, going)
            samples, over = samples[going], over[going]
    _put(result, samples, state, ~over)
    return tuple(values.reshape(shape) for values in result)


@singledispatch
def branching(mask: Any, function: Function, arguments: Values, otherwise: Values) -> Values:
    """`where_needed` on NumPy arrays."""
    if not mask.any():
        return otherwise
    result = tuple(np.array(values) for values in otherwise)
    for values, computed in zip(result, function(*(each[mask] for each in arguments)), strict=True):
        values[mask] = computed
    return result


@singledispatch
def looking_up(index: Any, constants: FloatArray) -> FloatArray:
    """`look_up` on NumPy arrays."""
    found: FloatArray = constants[index]
    return found


def _put(result: Values, samples: IndexArray, state: Values, chosen: BoolArray) -> None:
    if not chosen.any():
        return
    for values, latest in zip(result, state, strict=True):
        values[samples[chosen]] = latest[chosen]


def _take(arrays: Values, samples: IndexArray) -> Values:
    return tuple(values[samples] for values in arrays)
