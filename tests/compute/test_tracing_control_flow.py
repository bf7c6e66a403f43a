"""Loops, branches and tables in recorded programs, against the same text on NumPy's arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from samples.listings import carry_out, recorded

from vsacli.compute.control_flow import cell_of, look_up, repeat, where_needed
from vsacli.compute.tracing import Tape, TracedArray

RNG = np.random.default_rng(3)
X = np.concatenate([RNG.uniform(0.01, 50, 40), [1.0, 0.25, np.inf, np.nan]])
TABLE = np.array([3.0, -1.0, 0.5, np.inf, 8.0])
NODES = np.array([-1.0, 0.0, 0.5, 2.0])


def square_root(x: Any) -> Any:
    """Newton's method from above; samples need different numbers of steps."""

    def step(state: Any, constants: Any) -> Any:
        (root, count), (x,) = state, constants
        following = 0.5 * (root + x / root)
        return (following, count + 1), np.abs(following - root) <= 1e-15 * following

    return list(repeat(step, (np.maximum(x, 1.0), np.zeros_like(x)), (x,), 12))


def swapped(x: Any) -> Any:
    """Every step reads both old values before either is replaced."""

    def step(state: Any, _constants: Any) -> Any:
        a, b = state
        return (b, a + b), b > 30

    return list(repeat(step, (x, 2 * x), (), 9))


def handed_down(x: Any) -> Any:
    """Only the first entry of the state is looked at, which gets the last one's values two steps later."""

    def step(state: Any, constants: Any) -> Any:
        (first, second, third, idle), (x,) = state, constants
        return (second, third, 2 * third + x, idle + first), first > 40

    first, *_ = repeat(step, (x, x + 1, x + 2, x), (x,), 8)
    return first


def half_used(x: Any) -> Any:
    """The first of two results is not looked at."""
    _, second = where_needed(x > 1, lambda y, z: (np.sqrt(y), y * z), (x, x + 3), (x, -x))
    return second


def guarded(x: Any) -> Any:
    """A function that is only called where it has a value."""
    return list(where_needed(x > 1, lambda y: (np.log(y), y * y), (x,), (-x, np.full_like(x, 7.0))))


def nested(x: Any) -> Any:
    """A branch in a loop in a branch."""

    def step(state: Any, constants: Any) -> Any:
        (value,), (x,) = state, constants
        (halved,) = where_needed(value > 3, lambda v: (v / 2,), (value,), (value + 0.25,))
        return (halved,), halved > x

    def function(y: Any) -> Any:
        return repeat(step, (y + 1,), (y,), 6)

    return list(where_needed(np.isfinite(x), function, (x,), (np.full_like(x, np.nan),)))


def partly_used(x: Any) -> Any:
    """Of the three results of a loop in a branch one is not looked at inside of it, and one not outside."""

    def step(state: Any, constants: Any) -> Any:
        (halved, idle, total), (x,) = state, constants
        return (halved / 2, idle - x, total + halved), halved < 1

    def function(y: Any) -> Any:
        halved, _, total = repeat(step, (y, y, y + 1), (y,), 9)
        return halved, total

    _, total = where_needed(np.isfinite(x), function, (x,), (x, x))
    return total


def counted(x: Any) -> Any:
    """Cells of one width."""
    (found,) = look_up((TABLE,), cell_of(np.where(np.isnan(x), 0.0, x), len(TABLE)))
    return found


def interpolated(x: Any) -> Any:
    """A table whose place is searched for, and clipped."""
    index = np.clip(np.searchsorted(NODES, x, side="right") - 1, 0, len(NODES) - 2)
    value, node = look_up((TABLE, NODES), index)
    (following,) = look_up((TABLE,), index + 1)
    return value + following * (x - node)


FUNCTIONS = (
    square_root,
    swapped,
    handed_down,
    half_used,
    guarded,
    nested,
    partly_used,
    counted,
    interpolated,
)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_program_does_for_each_sample_what_numpy_does_for_all(function: Any) -> None:
    with np.errstate(all="ignore"):
        expected = function(X)
    found = carry_out(recorded(function, 1), [X])
    np.testing.assert_array_equal(np.array(found).reshape(-1, len(X)), np.array(expected).reshape(-1, len(X)))


def test_a_position_lies_in_the_cell_that_begins_before_it() -> None:
    positions = np.array([-np.inf, -0.1, 0.0, 0.9, 1.0, 3.5, 4.0, 7.0, np.inf])
    np.testing.assert_array_equal(cell_of(positions, 5), [0, 0, 0, 0, 1, 3, 4, 4, 4])


def test_the_loop_is_the_square_root() -> None:
    (root, steps) = carry_out(recorded(square_root, 1), [X[:42]])
    np.testing.assert_allclose(root, np.sqrt(X[:42]), rtol=1e-15)  # the last step's change is below this
    assert 1 <= steps.min() < steps.max() <= 12


def test_a_loop_is_recorded_once() -> None:
    nested_operations = [symbol.operation for symbol in recorded(square_root, 1).operations]
    assert nested_operations.count("loop") == 1
    assert "divide" not in nested_operations


def test_what_is_known_while_recording_leaves_no_branch() -> None:
    tape = Tape()
    row = TracedArray(tape, tape.inputs(1))
    (result,) = where_needed(
        np.ones_like(row, dtype=bool) & (row != row) & False, lambda y: (y,), (row,), (-row,)
    )
    assert [symbol.operation for symbol in tape.listing(result.cells).operations] == ["negative"]


def test_a_body_does_not_reach_outside() -> None:
    tape = Tape()
    row = TracedArray(tape, tape.inputs(1))
    with pytest.raises(ValueError, match="pass it as an argument"):
        where_needed(row > 0, lambda y: (y + row,), (row,), (row,))
