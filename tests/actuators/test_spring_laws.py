"""Spring laws one by one: derivatives, energy, inverse, ends, hardening, and how tendons act on side 2."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from oracles.spring_scan import turned
from samples.springs import SPRINGS, measured

from vsacli import laws
from vsacli.actuators.laws.four_bar import STRETCH_MARGIN

EPS = float(np.finfo(float).eps)

mpmath.mp.dps = 60
"""Digits in which the formulas are differentiated."""

Formula = Callable[[Any], Any]


def four_bar_torque(k: float, ratio: float) -> Formula:
    def torque(phi: Any) -> Any:
        half = phi / 2
        beta = mpmath.asin(ratio * mpmath.sin(half)) - half
        return k * beta * (ratio * mpmath.cos(half) / (2 * mpmath.cos(beta + half)) - mpmath.mpf(1) / 2)

    return torque


FORMULAS: dict[str, tuple[laws.SpringLaw, Formula]] = {
    "cubic": (laws.Cubic(k=20, k_c=300), lambda phi: 20 * phi + 300 * phi**3),
    "polynomial": (
        laws.Polynomial(c1=15, c3=100, c5=900, c7=2, c9=5),
        lambda phi: 15 * phi + 100 * phi**3 + 900 * phi**5 + 2 * phi**7 + 5 * phi**9,
    ),
    "sinh": (laws.Sinh(k=1.5, a=8), lambda phi: mpmath.mpf(1.5) * mpmath.sinh(8 * phi)),
    "exponential": (laws.Exponential(c=2, a=7), lambda phi: 2 * mpmath.expm1(7 * phi)),
    "quadratic": (laws.Quadratic(k=90), lambda phi: 90 * phi**2),
    **{
        f"four_bar {ratio}": (laws.FourBar(k=40, ratio=ratio), four_bar_torque(40, ratio))
        for ratio in (1.0001, 1.01, 2.2, 10.0)
    },
}
"""Laws that are formulas, in numbers that doubles hold exactly."""

formulas = pytest.mark.parametrize(("law", "formula"), FORMULAS.values(), ids=FORMULAS)

EVERY = {
    f"{name} {number}": spring[0] for name, both in SPRINGS.items() for number, spring in enumerate(both)
}
every_law = pytest.mark.parametrize("law", EVERY.values(), ids=EVERY)


def deflections(law: laws.SpringLaw, reach: float = 1.2) -> np.ndarray:
    """From tiny ones up to the end of the domain or a reach, on every side where the law holds."""
    low, high = (min(max(end, -reach), reach) for end in law.domain)
    shares = np.concatenate((np.geomspace(1e-9, 0.1, 9), np.linspace(0.2, 1, 9)))
    return np.concatenate((low * shares[::-1], high * shares)) if low else high * shares


def conditioning(law: laws.SpringLaw, phi: np.ndarray) -> np.ndarray:
    """How much the rounding of the deflection itself weighs: next to the stretched linkage a lot."""
    if isinstance(law, laws.FourBar):
        return 1 / (1 - (law.ratio * np.sin(phi / 2)) ** 2)
    return np.ones_like(phi)


# Derivatives


def test_every_law_of_the_file_format_is_tested():
    assert {type(law) for law in EVERY.values()} == set(laws.LAWS.values())


def test_every_name_that_laws_offers_is_there():
    offered = {name: getattr(laws, name) for name in dir(laws)}
    assert set(laws.__all__) <= set(offered)
    assert all(law in offered.values() for law in laws.LAWS.values())
    with pytest.raises(AttributeError, match="has no attribute 'Cubik'"):
        laws.Cubik  # noqa: B018  (looked up, not used)


@formulas
def test_derivatives_are_those_of_the_formula(law: laws.SpringLaw, formula: Formula):
    phi = deflections(law)
    for order, method in enumerate([law.torque, law.stiffness, law.slope, law.curvature]):
        steps = [mpmath.mpf(abs(each)) * mpmath.mpf(10) ** -12 for each in phi.tolist()]
        exact = [
            float(mpmath.diff(formula, mpmath.mpf(each), order, h=step))
            for each, step in zip(phi.tolist(), steps, strict=True)
        ]
        # A few roundings; the differences in 60 digits are good to 1e-12 of the step's square.
        tolerance = 20 * EPS * conditioning(law, phi)
        error = np.abs(method(phi) - exact)
        assert np.all(error <= tolerance * np.abs(exact) + 1e-300), order


@formulas
def test_energy_is_the_work_of_the_torque(law: laws.SpringLaw, formula: Formula):
    for phi in deflections(law)[::4].tolist():
        work = float(mpmath.quad(formula, [0, mpmath.mpf(phi) / 2, mpmath.mpf(phi)]))
        # Exponential: tau/a - c phi cancels for small phi, eps c phi beside c a phi^2/2.
        rounding = EPS * abs(phi) * 4 if isinstance(law, laws.Exponential) else 0
        # The quadrature sees the torque rise steeply at the stretched four-bar.
        assert law.energy(np.array([phi]))[0] == pytest.approx(
            work, rel=1e-6 if abs(phi) > 0.1 else 1e-13, abs=rounding
        )


@pytest.mark.parametrize("name", ["table", "table, pulling"])
@pytest.mark.parametrize("number", [0, 1])
def test_table_of_a_polynomial_gives_the_polynomial(name: str, number: int):
    law, curve = SPRINGS[name][number]
    low, high = law.domain
    phi = np.linspace(low, high, 201)
    # Least squares leave rounding, which each derivative multiplies by the knots per range, about 24.
    np.testing.assert_allclose(law.torque(phi), curve.torque(phi), rtol=0, atol=1e-11)
    np.testing.assert_allclose(law.stiffness(phi), curve.stiffness(phi), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["table", "table, pulling"])
@pytest.mark.parametrize("number", [0, 1])
def test_derivatives_of_a_table_are_those_of_its_torque(name: str, number: int):
    law, _ = SPRINGS[name][number]
    low, high = law.domain
    phi, step = np.linspace(low * 0.99, high * 0.99, 101), 1e-5
    for function, derivative in [
        (law.energy, law.torque),
        (law.torque, law.stiffness),
        (law.stiffness, law.slope),
        (law.slope, law.curvature),
    ]:
        inside = phi if low else phi[1:]
        difference = (function(inside + step) - function(inside - step)) / (2 * step)
        peak = np.abs(derivative(inside)).max()
        # Second order of the step times derivatives over ranges of 0.1, and rounding over the step.
        np.testing.assert_allclose(derivative(inside), difference, rtol=0, atol=1e-6 * peak)


def test_a_table_has_a_continuous_curvature():
    law, _ = SPRINGS["table"][1]
    phi = np.linspace(*law.domain, 20_001)
    jumps = np.abs(np.diff(law.curvature(phi)))
    # A jump would stand out from the steps of a smooth curve, 3e-5 of the range each.
    assert jumps.max() < 1e-3 * np.ptp(law.curvature(phi))


# What (14) needs of a law


@every_law
def test_a_law_hardens_away_from_zero(law: laws.SpringLaw):
    phi = deflections(law)
    assert np.all(np.diff(law.torque(phi)) > 0)
    assert np.all(law.stiffness(phi) > 0)
    assert np.all(np.sign(law.slope(phi)) == np.sign(phi))
    assert law.torque(np.zeros(1))[0] == law.energy(np.zeros(1))[0] == 0


@every_law
def test_derivatives_are_the_four_functions(law: laws.SpringLaw):
    phi = deflections(law)
    for side, deflection in ((law, phi), (law.as_second(), -phi if law.pulls_only else phi)):
        functions = (side.torque, side.stiffness, side.slope, side.curvature)
        for order in range(4):
            together = side.derivatives(deflection, order)
            alone = [function(deflection) for function in functions[: order + 1]]
            np.testing.assert_array_equal(together, alone)


@every_law
def test_deflection_inverts_the_torque(law: laws.SpringLaw):
    phi = deflections(law)
    # The torque's own rounding, over stiffness and deflection: at most the degree of the law, 9.
    np.testing.assert_allclose(law.deflection(law.torque(phi)), phi, rtol=50 * EPS)
    assert law.deflection(np.zeros(1))[0] == 0
    assert np.isnan(law.deflection(np.array([math.nan]))[0])


@every_law
def test_inverse_does_not_depend_on_the_other_samples_or_the_shape(law: laws.SpringLaw):
    torque = law.torque(deflections(law))
    whole = law.deflection(torque)
    np.testing.assert_array_equal(law.deflection(torque.reshape(2, -1)), whole.reshape(2, -1))
    np.testing.assert_array_equal([law.deflection(np.array([each]))[0] for each in torque], whole)


@every_law
def test_torque_range_is_that_of_the_domain(law: laws.SpringLaw):
    for end, torque in zip(law.domain, law.torque_range, strict=True):
        if math.isinf(end):
            assert torque == end
        else:
            assert torque == pytest.approx(law.torque(np.array([end]))[0], rel=4 * EPS)
            # Beyond, the deflection stays at the end.
            assert law.deflection(np.array([torque + np.sign(end - 1e-9) * 1])) == pytest.approx(
                end, abs=1e-15
            )


@every_law
def test_hardening_is_slope_over_stiffness(law: laws.SpringLaw):
    phi = deflections(law)
    np.testing.assert_allclose(law.hardening(phi), law.slope(phi) / law.stiffness(phi), rtol=4 * EPS)


# Ends


def test_four_bar_ends_just_before_the_linkage_is_stretched():
    law = laws.FourBar(k=40, ratio=2.2)
    assert 2.2 * math.sin(law.domain[1] / 2) == pytest.approx(1 - STRETCH_MARGIN, abs=4 * EPS)
    assert law.domain[0] == -law.domain[1]


def test_table_holds_where_it_was_measured():
    law = measured(np.linspace(-0.4, 0.6, 21), np.sinh(np.linspace(-0.4, 0.6, 21)))
    assert law.domain == (-0.4, 0.6)
    assert not law.pulls_only
    assert measured(np.linspace(0, 0.6, 21), np.sinh(np.linspace(0, 0.6, 21))).pulls_only


def test_misfit_of_a_table_is_told():
    deflection = np.linspace(-0.5, 0.5, 41)
    torque = 10 * np.sinh(5 * deflection)
    torque[30] += 0.05
    law = measured(deflection, torque)
    misfit = np.abs(law.torque(deflection) - torque).max()
    assert 0.01 < misfit < 0.05
    amount = f"{misfit:.2g} ({100 * misfit / np.ptp(torque):.2g} % of its range)"
    assert law.warnings == (f"the curve through spring.csv misses a measured torque by up to {amount}",)


def test_misfit_that_is_rounding_is_not_told_and_a_kink_is_with_its_place():
    deflection = np.linspace(-0.5, 0.5, 41)
    assert measured(deflection, 100 * deflection).warnings == ()
    size = np.abs(deflection)
    (warning,) = measured(
        deflection, np.sign(deflection) * np.where(size < 0.25, 100 * size, 25 + 400 * (size - 0.25))
    ).warnings
    assert "(1.1 % of its range), at the deflection " in warning
    assert ": near a kink or an outlier" in warning


def test_table_that_pushes_and_pulls_is_stiff_at_rest():
    deflection = np.linspace(-0.5, 0.5, 41)
    law = measured(deflection, 80 * deflection**3)
    # A thousandth of the mean stiffness, 20 N m/rad.
    assert law.stiffness(np.zeros(1))[0] == pytest.approx(0.02)
    # What that adds at the ends, 0.01 N m, is all that is missed.
    assert np.abs(law.torque(deflection) - 80 * deflection**3).max() < 0.01


# Side 2


@every_law
def test_a_tendon_pulls_the_other_way_on_side_2(law: laws.SpringLaw):
    second = law.as_second()
    if not law.pulls_only:
        assert second is law
        return
    phi = deflections(law)
    np.testing.assert_array_equal(second.torque(-phi), -law.torque(phi))
    np.testing.assert_array_equal(second.stiffness(-phi), law.stiffness(phi))
    np.testing.assert_array_equal(second.slope(-phi), -law.slope(phi))
    np.testing.assert_array_equal(second.curvature(-phi), law.curvature(phi))
    np.testing.assert_array_equal(second.energy(-phi), law.energy(phi))
    np.testing.assert_array_equal(second.hardening(-phi), -law.hardening(phi))
    np.testing.assert_array_equal(second.deflection(-law.torque(phi)), -law.deflection(law.torque(phi)))
    assert second.pulls_only
    assert second.domain == (-law.domain[1], 0)
    assert second.torque_range == (-law.torque_range[1], 0)


def test_oracle_turns_a_spring_as_well():
    _, curve = SPRINGS["exponential"][0]
    assert turned(curve).torque(-0.3) == -curve.torque(0.3)


# Absurd torques


@every_law
def test_any_torque_has_a_deflection(law: laws.SpringLaw):
    sizes = np.concatenate(([0.0, 5e-324, 1e-300], 10.0 ** np.arange(-200, 101, 25)))
    torque = np.concatenate((-sizes, sizes))
    found = law.deflection(torque)
    low, high = law.domain
    assert np.all((found >= low) & (found <= high))
    carried = np.clip(torque, *law.torque_range)
    # Neighboring doubles at the end of a four-bar; tiny torques of a spring without stiffness at rest.
    np.testing.assert_allclose(
        law.torque(found), carried, rtol=1e-9 if high < math.inf else 1e-12, atol=1e-90
    )
