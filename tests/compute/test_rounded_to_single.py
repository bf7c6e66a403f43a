"""Programs in single precision: each operation rounds as the processor does, tolerances are larger."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vsacli.compute.control_flow import look_up, repeat, subroutine, where_needed
from vsacli.compute.rounding import OfRounding, single_constant
from vsacli.compute.tracing import Kind, trace
from vsacli.compute.tracing.single_precision import run_in_single_precision

X = np.array([0.3, -2.5, 0.75, 1e6, 7.0])


def found(function: Any, *rows: np.ndarray) -> list[Any]:
    """The results of a function of rows of samples."""
    program = trace(lambda given: list(function(*given)), [Kind.REAL] * len(rows), short=True)
    return run_in_single_precision(program, rows)


def test_each_operation_rounds() -> None:
    """Against NumPy's own arithmetic in single precision, whose + - * / and roots are those of IEEE 754."""
    (result,) = found(lambda x: [np.sqrt(np.abs(x * x / 3.0 - 0.1)) + x * 0.7], X)
    x = X.astype(np.float32)
    third, tenth, other = np.float32(3.0), np.float32(0.1), np.float32(0.7)
    expected = np.sqrt(np.abs(x * x / third - tenth)) + x * other
    assert result.dtype == np.float32
    np.testing.assert_array_equal(result, expected)


def test_loops_end_for_each_sample_by_itself() -> None:
    """Halvings until the value is below 1, as many as each takes, at most 10."""

    def step(state: Any, _: Any) -> Any:
        x, count = state
        return (x / 2, count + 1), x / 2 < 1

    value, count = found(lambda x: repeat(step, (np.abs(x), x * 0), (x,), 10), X)
    np.testing.assert_array_equal(count, [1, 2, 1, 10, 3])
    np.testing.assert_array_equal(value, (np.abs(X) / 2.0**count).astype(np.float32))


def test_branches_tables_subroutines_and_choices() -> None:
    nodes, values = np.array([0.0, 1.0, 10.0]), np.array([1.1, 2.2, 3.3, 4.4])

    def long(x: Any) -> Any:
        for _ in range(20):
            x = x * 0.5 + 1
        return (x,)

    def function(x: Any) -> Any:
        (branch,) = where_needed(x > 0.5, lambda x: (-x,), (x,), (x * 2,))
        (taken,) = look_up([values], np.searchsorted(nodes, x, side="right"))
        return [branch, taken, *subroutine(long, (x,)), np.where(x < 0, np.nan, 1.0)]

    branch, taken, sub, choice = found(function, X)
    x = X.astype(np.float32)
    np.testing.assert_array_equal(branch, np.where(X > 0.5, -x, 2 * x))
    np.testing.assert_array_equal(taken, values.astype(np.float32)[[1, 0, 1, 3, 2]])
    np.testing.assert_allclose(sub, X / 2**20 + 2 * (1 - 2.0**-20), rtol=2e-6)  # twenty roundings
    np.testing.assert_array_equal(np.isnan(choice), X < 0)


def test_what_becomes_of_constants() -> None:
    assert single_constant(0.0) == 0
    assert single_constant(-1e-300) == -float(np.finfo(np.float32).tiny)
    assert single_constant(1e300) == np.inf
    assert single_constant(OfRounding(1e-10, power=0.5)) == pytest.approx(1e-10 * 2**14.5)
    tolerance = OfRounding(1e-17)
    (below,) = found(lambda x: [np.where(np.abs(x) < tolerance, 1.0, 0.0)], np.array([1e-9, 1e-8]))
    np.testing.assert_array_equal(below, [1, 0])  # 5.4e-9
