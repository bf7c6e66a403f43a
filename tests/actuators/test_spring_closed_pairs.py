"""Closed solutions of (14) for sinh springs and tendons, against the formulas and against iteration."""

from __future__ import annotations

import numpy as np
import pytest
from samples.springs import residuals

from vsacli import laws
from vsacli.actuators.laws.sinh import SinhPair
from vsacli.actuators.laws.tendons import ExponentialPair, QuadraticTwins
from vsacli.actuators.pairs.solver import IteratedPair

EPS = float(np.finfo(float).eps)

PAIRS: dict[str, tuple[laws.SpringLaw, laws.SpringLaw]] = {
    "sinh, alike": (laws.Sinh(k=1.5, a=8), laws.Sinh(k=1.5, a=8)),
    "sinh, qbmove": (laws.Sinh(k=0.0026, a=9), laws.Sinh(k=0.0011, a=9)),
    "sinh, far apart": (laws.Sinh(k=1e-3, a=8), laws.Sinh(k=1e5, a=8)),
    "exponential, alike": (laws.Exponential(c=2, a=7), laws.Exponential(c=2, a=7)),
    "exponential, unlike": (laws.Exponential(c=2, a=7), laws.Exponential(c=0.3, a=7)),
    "quadratic": (laws.Quadratic(k=90), laws.Quadratic(k=90)),
}
every_pair = pytest.mark.parametrize(("first", "second"), PAIRS.values(), ids=PAIRS)


def scale(law: laws.SpringLaw) -> float:
    """Torque at a deflection of 0.1."""
    return float(law.torque(np.array([0.1]))[0])


def demands(
    first: laws.SpringLaw, second: laws.SpringLaw, least_margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """Loads over ten decades and stiffness from that margin above the least on."""
    rng = np.random.default_rng(7)
    tau_e = rng.choice([-1, 1], 4000) * scale(first) * 10 ** rng.uniform(-6, 4, 4000)
    tau_e[::100] = 0
    lower = laws.make_pair(first, second.as_second()).solve(tau_e, np.ones_like(tau_e)).lower
    margin = 10 ** rng.uniform(np.log10(least_margin), np.log10(0.999), 4000)
    return tau_e, np.maximum(lower / (1 - margin), scale(first))


def solved(
    first: laws.SpringLaw, second: laws.SpringLaw, tau_e: np.ndarray, stiffness: np.ndarray
) -> laws.PairSolution:
    return laws.make_pair(first, second.as_second()).solve(tau_e, stiffness)


@every_pair
def test_solution_satisfies_14_down_to_the_smallest_margin(first: laws.SpringLaw, second: laws.SpringLaw):
    tau_e, stiffness = demands(first, second, least_margin=1e-9)
    found = solved(first, second, tau_e, stiffness)
    # 1e-12 is asked for; a handful of roundings, times exponents up to 20, leave this much.
    assert residuals((first, second.as_second()), found, tau_e, stiffness) <= 100 * EPS


@every_pair
def test_closed_form_is_what_iteration_finds(first: laws.SpringLaw, second: laws.SpringLaw):
    tau_e, stiffness = demands(first, second, least_margin=1e-3)
    closed = solved(first, second, tau_e, stiffness)
    iterated = IteratedPair(first, second.as_second()).solve(tau_e, stiffness)
    # Deflections are of the order 0.1 to 1, good to eps/margin = 2e-13 times a few roundings.
    np.testing.assert_allclose(closed.phi_1, iterated.phi_1, rtol=0, atol=5e-12)
    np.testing.assert_allclose(closed.phi_2, iterated.phi_2, rtol=0, atol=5e-12)
    np.testing.assert_allclose(closed.lower, iterated.lower, rtol=20 * EPS)
    for name in ("upper", "lower_critical", "upper_critical", "slack_below"):
        np.testing.assert_array_equal(getattr(closed, name), getattr(iterated, name))


def test_closed_forms_are_chosen_where_they_hold_only():
    assert isinstance(laws.make_pair(laws.Sinh(k=1, a=8), laws.Sinh(k=2, a=8)), SinhPair)
    assert isinstance(laws.make_pair(laws.Sinh(k=1, a=8), laws.Sinh(k=1, a=7)), IteratedPair)
    exponential, quadratic = laws.Exponential(c=2, a=7), laws.Quadratic(k=90)
    assert isinstance(laws.make_pair(exponential, laws.Exponential(c=1, a=7).as_second()), ExponentialPair)
    assert isinstance(laws.make_pair(exponential, laws.Exponential(c=2, a=6).as_second()), IteratedPair)
    assert isinstance(laws.make_pair(quadratic, laws.Quadratic(k=90).as_second()), QuadraticTwins)
    assert isinstance(laws.make_pair(quadratic, laws.Quadratic(k=91).as_second()), IteratedPair)
    assert isinstance(laws.make_pair(exponential, quadratic.as_second()), IteratedPair)


# The published formulas


def test_alike_sinh_springs():
    k, a = 1.5, 8.0
    tau_e, stiffness = demands(laws.Sinh(k=k, a=a), laws.Sinh(k=k, a=a), least_margin=1e-3)
    found = solved(laws.Sinh(k=k, a=a), laws.Sinh(k=k, a=a), tau_e, stiffness)
    mean, half_spread = (found.phi_1 + found.phi_2) / 2, (found.phi_1 - found.phi_2) / 2
    # tanh saturates at heavy loads, where it is compared instead of the mean.
    np.testing.assert_allclose(np.tanh(a * mean), a * tau_e / stiffness, rtol=1e-12, atol=1e-14)
    expected = stiffness / (2 * a * k * np.cosh(a * mean))
    np.testing.assert_allclose(np.cosh(a * half_spread), expected, rtol=1e-12)
    np.testing.assert_allclose(found.lower**2 - (a * tau_e) ** 2, (2 * a * k) ** 2, rtol=1e-8)


def test_unlike_sinh_springs():
    (k_1, k_2), a = (0.0026, 0.0011), 9.0
    tau_e, stiffness = demands(laws.Sinh(k=k_1, a=a), laws.Sinh(k=k_2, a=a), least_margin=1e-3)
    tau_e /= 100
    found = solved(laws.Sinh(k=k_1, a=a), laws.Sinh(k=k_2, a=a), tau_e, stiffness)
    right = k_1**2 + k_2**2 + 2 * k_1 * k_2 * np.cosh(a * (found.phi_1 - found.phi_2))
    np.testing.assert_allclose((stiffness / a) ** 2 - tau_e**2, right, rtol=1e-11)
    np.testing.assert_allclose(found.lower, a * np.hypot(tau_e, k_1 + k_2), rtol=4 * EPS)


def test_exponential_tendons():
    (c, a), tau_e = (2.0, 7.0), np.linspace(-50, 50, 101)
    found = solved(laws.Exponential(c=c, a=a), laws.Exponential(c=c, a=a), tau_e, np.full_like(tau_e, 500.0))
    pull = tau_e / 2 + 500 / (2 * a) - c
    np.testing.assert_allclose(found.phi_1, np.log(1 + pull / c) / a, rtol=1e-13)
    np.testing.assert_allclose(found.phi_2, -np.log((500 / a - tau_e) / (2 * c)) / a, rtol=1e-13)
    np.testing.assert_allclose(found.lower, a * np.abs(tau_e) + 2 * a * c, rtol=4 * EPS)
    assert np.all(found.slack_below)
    assert not np.any(found.lower_critical)


def test_quadratic_tendons():
    k, tau_e = 90.0, np.linspace(-50, 50, 101)
    found = solved(laws.Quadratic(k=k), laws.Quadratic(k=k), tau_e, np.full_like(tau_e, 200.0))
    np.testing.assert_allclose(found.phi_1, 200 / (4 * k) + tau_e / 200, rtol=1e-13)
    np.testing.assert_allclose(found.phi_2, tau_e / 200 - 200 / (4 * k), rtol=1e-13)
    np.testing.assert_allclose(found.lower, 2 * np.sqrt(k * np.abs(tau_e)), rtol=4 * EPS)
    assert np.all(found.slack_below)


@every_pair
def test_at_the_end_of_the_corridor_a_tendon_is_slack_and_never_pushes(
    first: laws.SpringLaw, second: laws.SpringLaw
):
    tau_e, _ = demands(first, second, least_margin=1e-3)
    found = solved(first, second, tau_e, np.full_like(tau_e, 1e-9))
    if first.pulls_only:
        assert np.all((found.phi_1 >= 0) & (found.phi_2 <= 0))
        least = np.minimum(first.torque(found.phi_1), second.torque(-found.phi_2))
        # Rounding of the sum of the torques.
        assert np.all(least <= 20 * EPS * (np.abs(tau_e) + scale(first)))
    else:
        assert np.all(found.lower_critical)
        # At the fold of springs with one a the deflections are equal.
        np.testing.assert_allclose(found.phi_1, found.phi_2, rtol=1e-12, atol=1e-12)


@every_pair
def test_absurd_demands_give_numbers(first: laws.SpringLaw, second: laws.SpringLaw):
    sizes = np.concatenate(([0.0, 1e-300], 10.0 ** np.arange(-100, 101, 20)))
    tau_e, stiffness = np.meshgrid(np.concatenate((sizes, -sizes)), 10.0 ** np.arange(-100, 101, 20))
    found = solved(first, second, tau_e.ravel(), stiffness.ravel())
    assert np.all(np.isfinite([found.lower, found.phi_1, found.phi_2]))
