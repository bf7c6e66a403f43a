"""Loops, branches and tables in traced programs, against the same text on NumPy's arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from samples.programs import carry_out, traced
from samples.traced_functions import (
    CONTROL_FLOW,
    square_root,
)

from vsacli.compute.control_flow import cell_of, where_needed
from vsacli.compute.tracing import Tape, TracedArray

RNG = np.random.default_rng(3)
X = np.concatenate([RNG.uniform(0.01, 50, 40), [1.0, 0.25, np.inf, np.nan]])


@pytest.mark.parametrize("function", CONTROL_FLOW)
def test_a_program_does_for_each_sample_what_numpy_does_for_all(function: Any) -> None:
    with np.errstate(all="ignore"):
        expected = function(X)
    found = carry_out(traced(function, 1), [X])
    np.testing.assert_array_equal(np.array(found).reshape(-1, len(X)), np.array(expected).reshape(-1, len(X)))


def test_a_position_lies_in_the_cell_that_begins_before_it() -> None:
    positions = np.array([-np.inf, -0.1, 0.0, 0.9, 1.0, 3.5, 4.0, 7.0, np.inf])
    np.testing.assert_array_equal(cell_of(positions, 5), [0, 0, 0, 0, 1, 3, 4, 4, 4])


def test_the_loop_is_the_square_root() -> None:
    (root, steps) = carry_out(traced(square_root, 1), [X[:42]])
    np.testing.assert_allclose(root, np.sqrt(X[:42]), rtol=1e-15)  # the last step's change is below this
    assert 1 <= steps.min() < steps.max() <= 12


def test_a_loop_is_recorded_once() -> None:
    nested_operations = [symbol.operation for symbol in traced(square_root, 1).operations]
    assert nested_operations.count("loop") == 1
    assert "divide" not in nested_operations


def test_what_is_known_while_recording_leaves_no_branch() -> None:
    tape = Tape()
    row = TracedArray(tape, tape.inputs(1))
    (result,) = where_needed(
        np.ones_like(row, dtype=bool) & (row != row) & False, lambda y: (y,), (row,), (-row,)
    )
    assert [symbol.operation for symbol in tape.program(result.cells).operations] == ["negative"]


def test_a_body_does_not_reach_outside() -> None:
    tape = Tape()
    row = TracedArray(tape, tape.inputs(1))
    with pytest.raises(NotImplementedError, match="pass it as an argument"):
        where_needed(row > 0, lambda y: (y + row,), (row,), (row,))
