"""Numbers in documents: what is read, and why other texts are refused."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import evaluate

FORCE_OR_MOMENT = "N (forces), N m (moments)"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", 0.0),
        ("-7", -7.0),
        ("+7", 7.0),
        ("1e-5", 1e-5),
        ("1e3", 1000.0),
        ("1E+3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("1e-05", 1e-5),
        ("0e5", 0.0),
        (" 2 ", 2.0),
        ("pi", math.pi),
        ("-pi/2", -math.pi / 2),
        ("1 + 2*3 - 4/8", 6.5),
        ("-(pi/2 + 0.5) * -2", math.pi + 1),
        ("2 - -3", 5.0),
    ],
)
def test_numbers_and_expressions(text, value):
    assert evaluate(text, "m") == value  # the same operations on the same doubles


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("90 deg", 90),
        ("-45 deg", -45),
        ("+30deg", 30),
        ("(90/2) deg", 45),
        ("-(30+15) deg", -45),
        ("1e2 deg", 100),
    ],
)
@pytest.mark.parametrize("unit", ["rad", "rad/s"])
def test_degrees_where_the_unit_is_an_angle(text, degrees, unit):
    assert evaluate(text, unit) == math.radians(degrees)


def test_a_right_angle_is_half_of_pi():
    assert evaluate("90 deg", "rad") == math.pi / 2


@pytest.mark.parametrize("unit", ["m", "N m/rad", "1", "kg m^2"])
def test_degrees_elsewhere_are_refused(unit):
    expected = (
        "has a unit; write the number alone" if unit == "1" else f"is an angle; expected a number in {unit}"
    )
    with pytest.raises(ExpressionError, match=f"^'90 deg' {re.escape(expected)}$"):
        evaluate("90 deg", unit)


@pytest.mark.parametrize(
    ("text", "unit", "problem"),
    [
        ("9.0478 kg", "kg", "has a unit; write the number alone, in kg: 9.0478"),
        ("5e3 g", "kg", "has a unit; write the number alone, in kg: 5"),
        ("50mm", "m", "has a unit; write the number alone, in m: 0.05"),
        ("1 kHz", "1/s", "has a unit; write the number alone, in 1/s: 1000"),
        ("1 rev", "rad", "has a unit; write the number alone, in rad: 6.283185307"),
        ("3 s", "kg", "is a time; expected a number in kg"),
        ("-2e3 g", "N", "is a mass; expected a number in N; 2 kg weigh 19.6 N"),
        ("2 kg", FORCE_OR_MOMENT, f"is a mass; expected a number in {FORCE_OR_MOMENT}; 2 kg weigh 19.6 N"),
        ("2 kN", FORCE_OR_MOMENT, f"has a unit; write the number alone, in {FORCE_OR_MOMENT}"),
        ("3 N/V", "kg", "is in another unit; expected a number in kg"),
        ("3 kg", "SI units", "has a unit; write the number alone, in SI units"),
        (
            "3 N",
            "N (forces), N m (moments)",
            "has a unit; write the number alone, in N (forces), N m (moments)",
        ),
    ],
)
def test_a_unit_behind_a_number_is_named_and_converted(text, unit, problem):
    with pytest.raises(ExpressionError, match=f"^'{text}' {re.escape(problem)}$"):
        evaluate(text, unit)


@pytest.mark.parametrize("text", ["deg", "90/2 deg", "1 + 2 deg", "pi deg", "90 deg deg", "90 deg + 1 deg"])
def test_degrees_of_an_ambiguous_expression_are_refused(text):
    with pytest.raises(ExpressionError, match=r"before `deg`, write one number, or .* `\(90/2\) deg`"):
        evaluate(text, "rad")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("on", "reads this word as a boolean"),
        ("Yes", "reads this word as a boolean"),
        ("n", "reads this word as a boolean"),
        ("false", "reads this word as a boolean"),
        ("1:30", "base 60"),
        ("-1:30:15.5", "base 60"),
        ("010", "leading zero"),
        ("1 + 007", "leading zero"),
        ("0x1F", "in decimal"),
        ("0o17", "in decimal"),
        ("0b11", "in decimal"),
        ("1_000", "without underscores"),
        ("1,5", "decimal point"),
        (".nan", "only finite numbers"),
        ("nan", "only finite numbers"),
        (".inf", "only finite numbers"),
        ("-.Inf", "only finite numbers"),
        ("infinity", "only finite numbers"),
        ("1/0", "division by zero"),
        ("1/(1-1)", "division by zero"),
        ("1e400", "too large"),
        ("1e308*10", "too large"),
        ("1e308*10 - 1e308*10", "too large"),
        ("", "an expression may have [+] - [*] /, parentheses and pi .error at character"),
        ("2 +", "ends after an operator; write e.g. pi/2"),
        ("1 2", "an expression may have [+] - [*] /, parentheses and pi .error at character"),
        ("(1", "an expression may have [+] - [*] /, parentheses and pi .error at character"),
        ("1)+(2", "an expression may have [+] - [*] /, parentheses and pi .error at character"),
        ("2pi", "an expression may have [+] - [*] /, parentheses and pi .error at character"),
        ("2**3", "an expression may have [+] - [*] /, parentheses and pi"),
        ("7//2", "an expression may have [+] - [*] /, parentheses and pi"),
        ("pi(2)", "an expression may have [+] - [*] /, parentheses and pi"),
        ("ten", "^expected a number in rad, found 'ten'$"),
        ("1j", "error at character 2"),
        ("1 if 2 else 3", "error at character 3"),
        ("__import__('os')", "error at character 12"),
        ("5 # comment", "error at character 3"),
        ("1; 2", "error at character 2"),
        ("90°", "degrees are written as in `90 deg`"),
        ("٣", "error at character 1"),
        ("1" * 201, "longer than 200 characters"),
    ],
)
def test_what_is_refused_and_why(text, reason):
    with pytest.raises(ExpressionError, match=reason):
        evaluate(text, "rad")


def test_nesting_as_deep_as_the_length_admits():
    assert evaluate("(" * 99 + "1" + ")" * 99, "1") == 1.0
    assert evaluate("-" * 199 + "1", "1") == -1.0


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_python_prints_of_a_float_reads_back(value):
    assert evaluate(repr(value), "1") == value


@pytest.mark.slow
@given(st.text(alphabet="0123456789.eE+-*/()pi deg_:,xnaf", max_size=40) | st.text(max_size=40))
def test_any_text_is_a_finite_number_or_refused(text):
    try:
        value = evaluate(text, "rad")
    except ExpressionError:
        return
    assert math.isfinite(value)
