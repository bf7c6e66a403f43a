"""The cubic spring, and the closed solution of (14) for two alike."""

from __future__ import annotations

import math

import numpy as np
import pytest
from samples.springs import residuals
from scipy.optimize import brentq

from vsacli import InputError, laws
from vsacli.actuators.laws.cubic import CubicTwins
from vsacli.actuators.pairs.solver import IteratedPair

EPS = float(np.finfo(float).eps)
SPRING = laws.Cubic(k=400, k_c=2000)
FOLD_LOAD = 8 / 3 * 400 * math.sqrt(400 / 6000)
"""275.4 N m: beyond it the springs of Table I fold at deflections that differ."""

cubics = pytest.mark.parametrize(
    "spring", [SPRING, laws.Cubic(k=1e-3, k_c=1e9), laws.Cubic(k=1e6, k_c=1e-3)], ids=str
)


def loads_and_demands(count: int, least_margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Loads up to 20 times the fold load, and stiffness from that margin on to 30 times the lowest."""
    rng = np.random.default_rng(4)
    tau_e = rng.choice([-1, 1], count) * FOLD_LOAD * 10 ** rng.uniform(-4, math.log10(20), count)
    lower = lowest_stiffness(tau_e)
    return tau_e, lower / (1 - 10 ** rng.uniform(math.log10(least_margin), math.log10(0.97), count))


def lowest_stiffness(tau_e: np.ndarray) -> np.ndarray:
    """End of the corridor of Table I's springs, the half deflection by bracketing instead of the inverse."""
    k, k_c = SPRING.k, SPRING.k_c

    def end(load: float) -> float:
        if load > FOLD_LOAD:
            return float((3 * math.sqrt(3 * k_c) * load) ** (2 / 3))
        p = float(brentq(lambda p: 2 * k * p + 2 * k_c * p**3 - load, 0, load / (2 * k) + EPS, xtol=1e-300))
        return 2 * k + 6 * k_c * p**2

    return np.array([end(load) for load in np.abs(tau_e)])


# The law


@cubics
def test_derivatives_are_those_of_the_torque(spring: laws.Cubic):
    phi = np.concatenate([-np.geomspace(1e-6, 10, 50), [0], np.geomspace(1e-6, 10, 50)])
    step = 1e-150  # its square vanishes, so that a complex step has no truncation error
    for function, derivative in [
        (spring.torque, spring.stiffness),
        (spring.stiffness, spring.slope),
        (spring.slope, spring.curvature),
        (spring.energy, spring.torque),
    ]:
        by_complex_step = function(phi + 1j * step).imag / step
        # A polynomial of four operations in either way.
        np.testing.assert_allclose(derivative(phi), by_complex_step, rtol=8 * EPS)


@cubics
def test_deflection_inverts_the_torque(spring: laws.Cubic):
    torque = np.concatenate([-np.geomspace(1e-12, 1e9, 43), [0], np.geomspace(1e-12, 1e9, 43)])
    found = spring.deflection(torque)
    expected = [
        brentq(
            lambda phi, load=load: spring.torque(phi) - load,
            -1.1 * abs(load) / spring.k,
            1.1 * abs(load) / spring.k,
            xtol=1e-300,
        )
        if load
        else 0.0
        for load in torque
    ]
    # brentq's own rtol is 4 eps, arcsinh and sinh add a few.
    np.testing.assert_allclose(found, expected, rtol=30 * EPS)


def test_deflection_keeps_its_digits_at_the_smallest_torques():
    torque = np.array([1e-300, 1e-200, 1e-30])
    # Only the linear term is left.
    np.testing.assert_allclose(SPRING.deflection(torque), torque / 400, rtol=4 * EPS)


@pytest.mark.parametrize(("k", "k_c"), [(0, 2000), (-400, 2000), (400, 0), (400, math.inf), (math.nan, 2000)])
def test_constants_must_be_positive(k: float, k_c: float):
    with pytest.raises(InputError, match="must be positive"):
        laws.Cubic(k=k, k_c=k_c)


# Two alike


def test_closed_form_is_chosen_for_twins_only():
    assert isinstance(laws.make_pair(SPRING, laws.Cubic(k=400, k_c=2000)), CubicTwins)
    # The limit plays no part in (14).
    assert isinstance(laws.make_pair(SPRING, laws.Cubic(k=400, k_c=2000, max_deflection=0.3)), CubicTwins)
    assert isinstance(laws.make_pair(SPRING, laws.Cubic(k=400, k_c=2001)), IteratedPair)
    assert isinstance(laws.make_pair(SPRING, laws.Cubic(k=401, k_c=2000)), IteratedPair)


def test_closed_form_is_what_iteration_finds():
    tau_e, stiffness = loads_and_demands(20_000, least_margin=1e-3)
    closed = CubicTwins(SPRING).solve(tau_e, stiffness)
    iterated = IteratedPair(SPRING, SPRING).solve(tau_e, stiffness)
    for name in ("phi_1", "phi_2"):
        # Good to eps/margin = 2e-13 rad; deflections go up to 3 rad.
        np.testing.assert_allclose(getattr(closed, name), getattr(iterated, name), rtol=0, atol=1e-12)
    np.testing.assert_allclose(closed.lower, iterated.lower, rtol=10 * EPS)
    for name in ("upper", "lower_critical", "upper_critical", "slack_below"):
        np.testing.assert_array_equal(getattr(closed, name), getattr(iterated, name))


@pytest.mark.parametrize(
    "kind", [CubicTwins, lambda spring: IteratedPair(spring, spring)], ids=["closed", "iterated"]
)
def test_solution_satisfies_14_down_to_the_smallest_margin(kind):
    tau_e, stiffness = loads_and_demands(20_000, least_margin=1e-9)
    found = kind(SPRING).solve(tau_e, stiffness)
    # 1e-12 is documented; a handful of roundings leave this much.
    assert residuals((SPRING, SPRING), found, tau_e, stiffness) <= 20 * EPS


@pytest.mark.slow
def test_closed_form_lies_on_the_branch():
    tau_e, stiffness = loads_and_demands(100_000, least_margin=1e-9)
    found = CubicTwins(SPRING).solve(tau_e, stiffness)
    assert np.all(found.phi_1 >= found.phi_2)
    # More preload from there on never meets a critical point: the sign of det A is that of far out.
    product = found.phi_1 * found.phi_2
    assert np.all(product <= 400 / 6000 * (1 + 1e-9))


def test_corridor_is_that_of_both_families_of_folds():
    tau_e = np.concatenate([-np.geomspace(1e-300, 1e6, 300), [0], np.linspace(270, 280, 101)])
    found = CubicTwins(SPRING).solve(tau_e, np.full_like(tau_e, 850))
    # A cube root and a square of the load in either way; brentq's rtol is 4 eps.
    np.testing.assert_allclose(found.lower, lowest_stiffness(tau_e), rtol=30 * EPS)
    assert np.all(np.isinf(found.upper))
    assert np.all(found.lower_critical)
    assert not np.any(found.upper_critical | found.slack_below)


def test_families_of_folds_meet_at_the_fold_load():
    assert pytest.approx(275.4, abs=0.05) == FOLD_LOAD
    tau_e = FOLD_LOAD * np.array([1 - 1e-9, 1, 1 + 1e-9])
    lower = CubicTwins(SPRING).solve(tau_e, np.full(3, 2000.0)).lower
    # 4K; its slope over the relative load is of its own size.
    np.testing.assert_allclose(lower, 1600, rtol=2e-9)
    assert np.all(np.diff(lower) > 0)


@pytest.mark.parametrize("stiffness", [801, 850, 1275, 1599, 1601, 3000, 1e6])
def test_largest_load_is_that_of_the_stiffness(stiffness: float):
    half_spread = math.sqrt((stiffness - 800) / 6000)
    if stiffness <= 1600:
        largest = math.sqrt(2) * 400 * half_spread * (1 + (stiffness - 800) / 2400)
    else:
        largest = stiffness**1.5 / (3 * math.sqrt(6000))
    found = CubicTwins(SPRING).solve(np.array([largest, -largest]), np.full(2, stiffness))
    # Relative to the stiffness; the formulas take a dozen roundings.
    np.testing.assert_allclose(found.lower, stiffness, rtol=30 * EPS)


def test_folds_are_where_the_decoupling_matrix_is_singular():
    tau_e = np.array([0.0, 50, 200, 300, 1000, 5000])
    found = CubicTwins(SPRING).solve(tau_e, np.ones_like(tau_e))
    first, second = found.phi_1, found.phi_2
    det_a = SPRING.stiffness(first) * SPRING.slope(second) - SPRING.stiffness(second) * SPRING.slope(first)
    scale = SPRING.stiffness(first) * SPRING.slope(np.abs(first) + np.abs(second))
    # The spread of the deflections is a square root, so that eps in the stiffness shows as 1e-8.
    assert np.all(np.abs(det_a) <= 1e-7 * scale + 1e-300)


def test_load_of_the_other_sign_swaps_and_turns_the_deflections():
    tau_e, stiffness = loads_and_demands(1000, least_margin=1e-6)
    found, turned = (CubicTwins(SPRING).solve(sign * tau_e, stiffness) for sign in (1, -1))
    np.testing.assert_array_equal(found.phi_1, -turned.phi_2)
    np.testing.assert_array_equal(found.lower, turned.lower)
