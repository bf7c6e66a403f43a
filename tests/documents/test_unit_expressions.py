"""Units in headers, against sizes worked out by hand."""

import math

import pytest

from vsacli import InputError
from vsacli.base.variables import VARIABLES
from vsacli.documents.expression import BASES, conversion_factor

DEG = math.pi / 180


@pytest.mark.parametrize(
    ("text", "expected", "factor"),
    [
        ("rad", "rad", 1),
        ("deg", "rad", DEG),
        ("°", "rad", DEG),
        ("deg/s^2", "rad/s^2", DEG),
        ("deg/s²", "rad/s^2", DEG),
        ("deg/s2", "rad/s^2", DEG),
        ("deg/s/s", "rad/s^2", DEG),
        ("rev/min", "rad/s", 2 * math.pi / 60),
        ("rpm", "rad/s", 2 * math.pi / 60),
        ("g cm^2", "kg m^2", 1e-7),
        ("g·cm²", "kg m^2", 1e-7),
        ("N m s^2", "kg m^2", 1),
        ("mNm/A", "N m/A", 1e-3),
        ("mΩ", "ohm", 1e-3),
        ("Ω", "ohm", 1),
        ("V/A", "ohm", 1),
        ("ms", "s", 1e-3),
        ("mm", "m", 1e-3),
        ("mm/ms^2", "m/s^2", 1e3),
        ("N m/rad", "N m/rad", 1),
        ("Nm/rad", "N m/rad", 1),
        ("N.m/rad", "N m/rad", 1),
        ("N*m/rad", "N m/rad", 1),
        ("N·m/(rad·s)", "N m/(rad s)", 1),
        ("N m/rad/s", "N m/(rad s)", 1),
        ("N m/deg", "N m/rad", 1 / DEG),
        ("Nmm/deg", "N m/rad", 1e-3 / DEG),
        ("N/mm", "N/m", 1e3),
        ("(N m)/(rad s^2)", "N m/(rad s^2)", 1),
    ],
)
def test_factor(text, expected, factor):
    assert conversion_factor(text, expected) == pytest.approx(factor, rel=1e-15)


SYMBOLS = {
    "rad": {"rad": 1, "deg": DEG, "rev": 2 * math.pi},
    "rad/s": {"rpm": math.pi / 30},
    "m": {"m": 1, "cm": 0.01, "mm": 0.001, "um": 1e-6},
    "s": {"s": 1, "ms": 0.001, "us": 1e-6, "ns": 1e-9, "min": 60},
    "1/s": {"Hz": 1, "kHz": 1000},
    "N": {"N": 1, "mN": 0.001, "kN": 1000},
    "N m": {"Nm": 1, "mNm": 0.001, "Nmm": 0.001, "J": 1},
    "N m/s": {"W": 1},
    "kg": {"kg": 1, "g": 0.001},
    "A": {"A": 1, "mA": 0.001},
    "V": {"V": 1, "mV": 0.001},
    "V/A": {"ohm": 1, "mohm": 0.001},
}
"""Size of every symbol, by the unit that has its dimensions."""


def test_every_symbol_has_its_size_and_dimensions():
    sizes = {(symbol, unit): size for unit, symbols in SYMBOLS.items() for symbol, size in symbols.items()}
    assert {symbol for symbol, _ in sizes} == BASES.keys()
    for (symbol, unit), size in sizes.items():
        per_second = unit == "1/s"  # no unit begins with a number
        text, expected = (f"rad {symbol}", "rad/s") if per_second else (symbol, unit)
        assert conversion_factor(text, expected) == pytest.approx(size, rel=1e-15), symbol


@pytest.mark.parametrize("name", ["time", "q", "d4q", "stiffness", "ddstiffness", "wrench", "ddwrench"])
@pytest.mark.parametrize("joint", ["revolute", "prismatic"])
def test_every_unit_of_the_tool_is_understood(name, joint):
    quantity = VARIABLES[name].quantity
    unit = quantity.revolute if joint == "revolute" else quantity.prismatic
    assert conversion_factor(unit, unit) == 1


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", "-", "grad", "rad/", "/rad", "(rad", "rad)", "rad^", "rad^-1", "rad^9", "rad**2"),
        *("N m/rad s", "2 rad", "(" * 1000 + "rad", "rad rad " * 10000),
    ],
)
def test_what_is_no_unit_is_refused_with_those_that_are(text):
    with pytest.raises(InputError) as caught:
        conversion_factor(text, "rad")
    shown = f"unknown unit [{text[:40]}]"
    assert str(caught.value) in (
        f"{shown}; expected an angle in rad, deg or rev",
        f"{shown}; did you mean [rad]?",
    )


@pytest.mark.parametrize(("text", "near"), [("degrees", "deg"), ("radd", "rad")])
def test_a_misspelled_unit(text, near):
    with pytest.raises(InputError, match=rf"^unknown unit \[{text}\]; did you mean \[{near}\]\?$"):
        conversion_factor(text, "rad")


@pytest.mark.parametrize(
    ("text", "expected", "message"),
    [
        ("m", "rad", "[m] is a length, expected an angle in rad, deg or rev"),
        ("N m", "N m/rad", "[N m] is a torque, expected a rotational stiffness in N m/rad"),
        ("rad/s", "rad", "[rad/s] is an angular velocity, expected an angle in rad, deg or rev"),
        ("s", "rad", "[s] is a time, expected an angle in rad, deg or rev"),
        ("N/V", "m", "[N/V] does not fit; expected a length in m, cm, mm or um"),
        ("m", "N m/(rad s)", "[m] is a length, expected N m/(rad s)"),
        ("g/cm^2", "kg m^2", "[g/cm^2] is not a moment of inertia; did you mean [g cm^2]?"),
    ],
)
def test_another_kind_of_unit_is_refused(text, expected, message):
    with pytest.raises(InputError) as caught:
        conversion_factor(text, expected)
    assert str(caught.value) == message
