"""Truncated power series against derivatives that sympy finds."""

import functools
from itertools import product

import mpmath
import numpy as np
import pytest
import sympy
from samples.marks import slow_but

from vsacli.compute.jets import FUNCTIONS, Jet, Truncation
from vsacli.compute.tracing import Kind, trace
from vsacli.compute.tracing.row_functions import RowFunction
from vsacli.documents.expression import Grammar, parse

X = sympy.symbols("x y z", positive=True)
SYMBOLIC = {name: getattr(sympy, name) for name in FUNCTIONS}

ORDERS = [
    order for order in product(range(5), range(3), range(3)) if order[1] + order[2] <= 2 and sum(order) <= 4
]
SERIES = Truncation(ORDERS)

SAMPLES = 4
DIGITS = 40
"""Of the oracle, so that its own rounding has no part in what is compared."""

RTOL = 1e-12
"""Of the largest term: the tens of roundings of a fourth derivative leave less."""

CASES = {
    "sine": "sin(x*y)*z",
    "cosine": "cos(x - y)^2 + z",
    "tangent": "tan(x*y/2)*z^2",
    "root": "sqrt(x + y*z)",
    "exponential": "exp(x*z - y)",
    "logarithm": "log(1 + x*y*z)",
    "quotient": "(x - z)/(x + y*z)",
    "reciprocal": "3/(x*y + z)",
    "whole powers": "(x - y)^3*z^2 + x^7",
    "negative powers": "(x + y)^-2 + (x*z)^-1.5",
    "real powers": "(x*y + z)^2.7 + (x + z)^0.25",
    "powers of variables": "(x + y)^z + 2^(x*z)",
    "no power at all": "x^0*y^1 + z",
    "compositions": "exp(sin(sqrt(x + log(2 + y*cos(z)))))",
    "rod": "40*(sqrt(1.3 - cos(y - x)) - 0.5 + 0.1*z)^2",
}

GRAMMAR = Grammar("xyz", tuple(FUNCTIONS), powers=True, max_length=200)
EXPRESSIONS = {name: parse(text, GRAMMAR) for name, text in CASES.items()}


@functools.cache
def points() -> np.ndarray:
    return np.random.default_rng(3).uniform(0.2, 1.2, (3, SAMPLES))


def jet_of(case, rows, truncation=SERIES):
    units = [tuple(int(i == j) for j in range(3)) for i in range(3)]
    jets = [truncation.linear(row, unit) for row, unit in zip(rows, units, strict=True)]
    return EXPRESSIONS[case].value(dict(zip("xyz", jets, strict=True)), FUNCTIONS)


def derivatives(case, rows):
    """All that the truncation holds, zeros where they vanish everywhere, (orders, samples)."""
    jet = jet_of(case, rows)
    return [jet.derivative(order) + 0 * rows[0] for order in SERIES.orders]


@pytest.mark.cases(4)
@pytest.mark.parametrize("case", slow_but({"cosine", "negative powers"}, CASES))
def test_every_derivative_is_the_one_that_sympy_finds(case):
    names = dict(zip("xyz", X, strict=True))
    function = sympy.nsimplify(sympy.sympify(CASES[case].replace("^", "**"), locals=names), rational=True)
    found = np.array(derivatives(case, points()))
    for order, row in zip(SERIES.orders, found, strict=True):
        wanted = functools.reduce(
            lambda of, over: sympy.diff(of, *over), zip(X, order, strict=True), function
        )
        terms = wanted.args if wanted.is_Add else (wanted,)
        with mpmath.workdps(DIGITS):
            values = sympy.lambdify(X, terms, "mpmath")
            for sample, point in enumerate(points().T):
                each = [mpmath.mpf(term) for term in values(*map(mpmath.mpf, map(float, point)))]
                size = max(map(abs, each))
                assert abs(row[sample] - mpmath.fsum(each)) <= RTOL * size, (case, order)


@pytest.mark.parametrize("case", CASES)
def test_the_same_text_leaves_a_program(case):
    program = trace(lambda rows: derivatives(case, rows), [Kind.REAL] * 3)
    function = RowFunction(program)
    found = np.empty((len(ORDERS), SAMPLES))
    function(points(), found, function.workspace(SAMPLES))
    expected = np.array(derivatives(case, points()))
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-14)  # small powers become products


def test_whole_powers_hold_at_zero_where_others_divide_by_it():
    zero = np.zeros(1)
    jet = jet_of("whole powers", [zero, zero, zero + 1])
    assert jet.derivative((3, 0, 0)) == 6
    assert jet.derivative((1, 2, 0)) == 6
    with np.errstate(all="ignore"):
        assert not np.isfinite(jet_of("root", [zero, zero, zero]).derivative((1, 0, 0)))


def test_powers_beyond_all_sense_take_no_time():
    jet = SERIES.linear(np.full(1, 0.999), (1, 0, 0))
    for exponent in (1000, 1001, 1e300):
        power = jet**exponent
        np.testing.assert_allclose(power.value, 0.999**exponent, rtol=1e-12)
        slope = exponent * 0.999 ** (exponent - 1)
        np.testing.assert_allclose(power.derivative((1, 0, 0)), slope, rtol=1e-12)


def test_what_vanishes_everywhere_costs_nothing():
    x, y = (SERIES.linear(np.ones(2), unit) for unit in ((1, 0, 0), (0, 1, 0)))
    difference = (x - x) * FUNCTIONS["sin"](y)
    assert all(isinstance(difference.derivative(order), int) for order in ORDERS if order[0])
    assert isinstance((y * y).derivative((0, 1, 1)), int)


def test_fewer_derivatives_are_the_same_numbers():
    few = Truncation(order for order in ORDERS if sum(order) <= 1)
    for case in CASES:
        part, whole = jet_of(case, points(), few), jet_of(case, points())
        for order in few.orders:
            np.testing.assert_array_equal(part.derivative(order), whole.derivative(order))


def test_numbers_of_numpy_leave_the_operators_to_jets():
    jet = SERIES.linear(np.full(2, 3.0), (1, 0, 0))
    for found in (np.float64(2) * jet, np.float64(2) + jet, np.float64(2) - jet, np.float64(2) / jet, 2**jet):
        assert isinstance(found, Jet)
