"""Expressions with names and functions: what they stand for, and why other texts are refused."""

import math
import re

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from vsacli.documents.expression import MAX_NESTING, ExpressionError, Grammar, parse

FUNCTIONS = {"sin": math.sin, "sqrt": math.sqrt}
GRAMMAR = Grammar(("x", "stretch", "pi"), tuple(FUNCTIONS), powers=True, max_length=2000)
VALUES = {"x": 0.75, "stretch": -1.25, "pi": math.pi}


def value(text):
    return parse(text, GRAMMAR).value(VALUES, FUNCTIONS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x", 0.75),
        ("2*x - 3/4", 0.75),
        ("x - stretch - 1", 1.0),
        ("x / 2 / 3", 0.125),
        ("-x^2", -0.5625),
        ("(-x)^2", 0.5625),
        ("x**2", 0.5625),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("2^-x^2", 2 ** -(0.75**2)),
        ("- -x", 0.75),
        ("-+-+x", 0.75),
        ("2*-x", -1.5),
        ("sin(x)^2", math.sin(0.75) ** 2),
        ("-sqrt(2 + x) * sin(-pi/2)", math.sqrt(2.75)),
        ("1e2*x + .5", 75.5),
    ],
)
def test_operators_bind_as_in_mathematics(text, expected):
    assert value(text) == expected  # the same operations on the same doubles


PARTS = st.deferred(
    lambda: (
        st.sampled_from(["x", "stretch", "2.0", "0.5", "3.0"])  # Python's integers have no end, doubles have
        | st.tuples(PARTS, st.sampled_from("+-*"), PARTS).map("".join)
        | PARTS.map(lambda part: f"({part})")
        | PARTS.map(lambda part: f"-{part}")
        | PARTS.map(lambda part: f"sin({part})")
        | PARTS.map(lambda part: f"({part})^2")
    )
)


@settings(max_examples=50)
@given(PARTS.filter(lambda text: len(text) < 60 and text.count("^") < 6))  # far below the largest double
def test_any_expression_has_the_value_that_python_finds(text):
    """Python's own parser knows the same precedence, and is never asked by the code under test."""
    expected = eval(text.replace("^", "**"), {**VALUES, **FUNCTIONS})
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("2*strech", "unknown word 'strech' at character 3; did you mean 'stretch'?"),
        ("ln(x)", "unknown word 'ln' at character 1; valid: x, stretch, pi, sin, sqrt"),
        ("sin x", "expected ( behind 'sin', found 'x' at character 5"),
        ("x(2)", "expected an operator, found '(' at character 2"),
        ("2x", "expected an operator, found 'x' at character 2"),
        ("(x + 2", "expected an operator or ), found the end at character 7"),
        ("x + 2)", "expected an operator, found ')' at character 6"),
        ("x + * 2", "expected a number, a word or (, found '*' at character 5"),
        ("x +", "expected a number, a word or (, found the end at character 4"),
        ("", "expected a number, a word or (, found the end at character 1"),
        ("sin()", "expected a number, a word or (, found ')' at character 5"),
        ("x % 2", "unexpected character '%' at character 3"),
        ("x.real", "unexpected character '.' at character 2"),
        ("x + 007", "a leading zero, which would mean an octal number elsewhere at character 5"),
        ("x" * 2001, "longer than 2000 characters"),
        ("__import__(1)", "unknown word '__import__' at character 1"),
    ],
)
def test_what_is_refused_and_where(text, reason):
    with pytest.raises(ExpressionError, match=f"^{re.escape(reason)}"):
        parse(text, GRAMMAR)


@pytest.mark.parametrize("form", ["({})", "sin({})", "-({})", "2^({})", "2^{}"])
def test_nesting_is_bounded_before_python_is_exhausted(form):
    text = "x"
    while len(text) < GRAMMAR.max_length - len(form):
        text = form.format(text)
    with pytest.raises(ExpressionError, match=f"nested deeper than {MAX_NESTING} levels"):
        parse(text, GRAMMAR)


def test_long_sums_and_rows_of_signs_nest_nothing():
    assert value("+".join(["x"] * 1000)) == 750.0
    assert value("-" * 1999 + "x") == -0.75


def test_what_stands_in_a_text_several_times_is_one_step():
    expression = parse("sin(x - stretch)^2 + 3*sin(x - stretch)", GRAMMAR)
    assert [step.operation for step in expression.steps].count("sin") == 1
    assert expression.names == {"x", "stretch"}


def test_values_may_be_anything_that_has_the_operators():
    x, stretch = sympy.symbols("x stretch")
    found = parse("sqrt(x^2 + 1)/(2 - stretch)", GRAMMAR).value(
        {"x": x, "stretch": stretch}, {"sqrt": sympy.sqrt}, sympy.Rational
    )
    assert sympy.simplify(found - sympy.sqrt(x**2 + 1) / (2 - stretch)) == 0
