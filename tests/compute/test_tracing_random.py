"""Random expressions: recording, folding and sharing never change a value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from samples.programs import carry_out, traced

Expression = Callable[[Any, Any], Any]

VALUES = [0.0, -0.0, 1.0, -1.0, 2.5, -0.3, 1e200, 1e-200, np.inf, -np.inf, np.nan]
UNARY = (np.negative, np.absolute, np.sqrt, np.sin, np.exp, np.log, np.arcsin, np.square, np.isnan)
BINARY = (np.add, np.subtract, np.multiply, np.divide, np.maximum, np.minimum, np.hypot, np.copysign)
COMPARISONS = (np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal)


def rows() -> tuple[np.ndarray, np.ndarray]:
    x, y = (grid.ravel() for grid in np.meshgrid(VALUES, VALUES))
    return x, y


def leaves(constants: list[float]) -> st.SearchStrategy[Expression]:
    numbers = st.sampled_from(constants).map(lambda number: lambda x, _y: np.full_like(x, number))
    return st.sampled_from([lambda x, _y: x, lambda _x, y: y]) | numbers


def larger(parts: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    def unary(ufunc: np.ufunc, a: Expression) -> Expression:
        return (
            (lambda x, y: np.where(ufunc(a(x, y)), x, y))
            if ufunc is np.isnan
            else lambda x, y: ufunc(a(x, y))
        )

    def binary(ufunc: np.ufunc, a: Expression, b: Expression) -> Expression:
        return lambda x, y: ufunc(a(x, y), b(x, y))

    def choice(
        ufunc: np.ufunc, negated: bool, a: Expression, b: Expression, c: Expression, d: Expression
    ) -> Expression:
        def chosen(x: Any, y: Any) -> Any:
            truth = ufunc(a(x, y), b(x, y))
            return np.where((~truth if negated else truth) | (c(x, y) < 0), c(x, y), d(x, y))

        return chosen

    return (
        st.builds(unary, st.sampled_from(UNARY), parts)
        | st.builds(binary, st.sampled_from(BINARY), parts, parts)
        | st.builds(choice, st.sampled_from(COMPARISONS), st.booleans(), parts, parts, parts, parts)
    )


def check(expression: Expression) -> None:
    x, y = rows()
    with np.errstate(all="ignore"):
        (found,) = carry_out(traced(expression, 2), [x, y])
        expected = expression(x, y)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.recursive(leaves([1.0, -1.0, 2.0, np.inf, np.nan, -3.5, -0.0]), larger, max_leaves=12))
def test_random_expressions_keep_their_values(expression: Expression) -> None:
    check(expression)


KEEPING = (np.add, np.subtract, np.multiply, np.maximum, np.minimum)
"""Functions in whose results the sign of a zero is no more than that."""


def polynomials(parts: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    return st.builds(
        lambda ufunc, a, b: lambda x, y: ufunc(a(x, y), b(x, y)), st.sampled_from(KEEPING), parts, parts
    )


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.recursive(leaves([0.0, 1.0, -1.0, 2.0, np.inf, np.nan]), polynomials, max_leaves=12))
def test_adding_zero_is_left_out_and_multiplying_by_it_is_not(expression: Expression) -> None:
    """x + 0 is traced as x: they differ where x is -0, in the sign of the zero alone."""
    check(expression)


def test_zero_times_a_value_is_not_zero() -> None:
    (found,) = carry_out(traced(lambda x: 0 * x, 1), [np.array([np.inf, np.nan, -1.0])])
    np.testing.assert_array_equal(found, [np.nan, np.nan, 0])
