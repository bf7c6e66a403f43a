"""The branch of (14) for springs that differ: its end, its solution, and whatever may be thrown at it."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.scalar_vsa import Curve, Side
from samples.drives import Stopped
from samples.marks import exhaustive
from samples.springs import residuals, stiffness_under

from vsacli import laws

EPS = float(np.finfo(float).eps)
K_440 = (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=440, k_c=2000))
"""A pair whose sides differ by a tenth."""

Springs = tuple[laws.Cubic, laws.Cubic]


def fold_load(spring: laws.Cubic) -> float:
    """Load beyond which two such springs fold at deflections that differ, (8/3) K sqrt(K/(3 Kc))."""
    return float(8 / 3 * spring.k * np.sqrt(spring.k / (3 * spring.k_c)))


def solve(springs: Springs, tau_e: float, stiffness: float) -> laws.PairSolution:
    return laws.make_pair(*springs).solve(np.array([tau_e]), np.array([stiffness]))


def random_springs(rng: np.random.Generator, decades: float) -> Springs:
    """Constants about those of Table I, spread over that many decades to either side."""
    constants = np.array([[400, 2000], [400, 2000]]) * 10 ** rng.uniform(-decades, decades, (2, 2))
    first, second = (laws.Cubic(k=float(k), k_c=float(k_c)) for k, k_c in constants)
    return first, second


def dense_scan(springs: Springs, tau_e: float) -> float:
    """Least stiffness before it first rises, over 8000 preloads from large to small, dense at both ends.

    Deflections by Cardano's formula from shares of the torque that are free of cancellation.
    """
    small = np.geomspace(1e-14, 0.5, 4000)
    growing, falling = np.concatenate([small, 1 - small[::-1]]), np.concatenate([1 - small, small[::-1]])
    shares = (falling, growing) if tau_e > 0 else (growing, falling)
    stiffness = sum(
        (stiffness_under(spring, share * tau_e) for spring, share in zip(springs, shares, strict=True)),
        start=np.zeros(8000),
    )
    # Steps smaller than rounding are none.
    rising = np.flatnonzero(np.diff(stiffness) > 4 * EPS * stiffness[1:])
    return float(stiffness[rising[0] if rising.size else -1])


# The branch that is meant


def test_end_of_the_branch_is_not_where_the_deflections_are_equal():
    end = solve(K_440, 250.0, 1.0)
    # The digits that are published.
    assert end.phi_1[0] == pytest.approx(0.189, abs=5e-4)
    assert end.phi_2[0] == pytest.approx(0.273, abs=5e-4)
    assert end.lower[0] == pytest.approx(1501.8, abs=0.05)
    # 1503 is below the stiffness at equal deflections, 1505.3, and within reach.
    found = solve(K_440, 250.0, 1503.0)
    assert found.phi_1[0] < found.phi_2[0]
    assert residuals(K_440, found, np.array([250.0]), np.array([1503.0])) <= 20 * EPS


def test_outermost_of_two_solutions_with_the_same_sign_of_the_determinant():
    found = solve(K_440, 400.0, 2070.0)
    assert found.phi_1[0] == pytest.approx(0.4234, abs=5e-5)
    assert found.phi_2[0] == pytest.approx(0.1604, abs=5e-5)
    inner = (0.3254, 0.3148)
    for phi_1, phi_2 in (inner, (found.phi_1[0], found.phi_2[0])):
        first, second = Side(400, 2000), Side(440, 2000)
        assert first.tau(phi_1) + second.tau(phi_2) == pytest.approx(400, rel=1e-3)
        assert first.sigma(phi_1) + second.sigma(phi_2) == pytest.approx(2070, rel=1e-3)
        assert first.sigma(phi_1) * second.zeta(phi_2) - second.sigma(phi_2) * first.zeta(phi_1) < 0


def test_lower_end_jumps_where_the_outermost_piece_splits():
    tau_e = np.linspace(250, 450, 2001)
    lower = laws.make_pair(*K_440).solve(tau_e, np.full_like(tau_e, 3000.0)).lower
    jump = np.diff(lower).argmax()
    others = np.delete(np.diff(lower), jump)
    assert np.diff(lower)[jump] > 20 * others.max()
    # Where it does, the walk along the curve says so too.
    for index in (jump, jump + 1):
        curve = Curve((Side(400, 2000), Side(440, 2000)), tau_e[index])
        # A fold that has just been born is as flat as rounding allows.
        assert lower[index] == pytest.approx(curve.stiffness(curve.fold(nodes=3000)), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("pairs", [6, exhaustive(150)])
@pytest.mark.parametrize("decades", [1e-8, 1e-3, 0.05, 0.5, 2, 4])
def test_corridor_ends_where_a_dense_scan_says(decades: float, pairs: int):
    rng = np.random.default_rng(round(1e9 * decades))
    for _ in range(pairs):
        springs = random_springs(rng, decades)
        share = 20 * 10 ** rng.uniform(-4, 0) * rng.choice([-1, 1])
        tau_e = float(share * fold_load(springs[rng.integers(2)]))
        lower, scanned = solve(springs, tau_e, 1.0).lower[0], dense_scan(springs, tau_e)
        # A minimum is missed by half a cell, 0.4 % of the share at most: 5e-6 of the stiffness.
        assert scanned * (1 - 1e-5) <= lower <= scanned * (1 + 20 * EPS), (springs, tau_e)


@pytest.mark.parametrize("pairs", [8, exhaustive(25)])
@pytest.mark.parametrize("decades", [1e-3, 0.05, 0.3])
def test_solution_is_that_of_the_walk(decades: float, pairs: int):
    rng = np.random.default_rng(round(1e9 * decades))
    for _ in range(pairs):
        springs = random_springs(rng, decades)
        tau_e = float(rng.uniform(-3, 3) * fold_load(springs[0]))
        sides = tuple(Side(spring.k, spring.k_c) for spring in springs)
        curve = Curve((sides[0], sides[1]), tau_e)
        fold = curve.fold(nodes=600)
        stiffness = curve.stiffness(fold) * rng.uniform(1.01, 4)
        found, phi_1 = solve(springs, tau_e, stiffness), curve.solve(stiffness, fold)
        # eps over the margin of 1 %, and the rounding of nested root finding.
        assert found.phi_1[0] == pytest.approx(phi_1, rel=1e-12, abs=1e-13)
        assert found.phi_2[0] == pytest.approx(curve.other(phi_1), rel=1e-12, abs=1e-13)
        assert found.lower[0] == pytest.approx(curve.stiffness(fold), rel=1e-13)


# Springs that end somewhere


@pytest.mark.parametrize("tau_e", [-50.0, -20.0, 0.0, 20.0, 50.0])
@pytest.mark.parametrize("hardening", [2, 2000, 2e6])
def test_piece_may_end_at_a_stop(tau_e: float, hardening: float):
    """Both springs end at 30 N m; under heavy load that is before the fold, on either side of it."""
    springs = (Stopped(k=4000, k_c=hardening), Stopped(k=400, k_c=2000))
    preload = np.linspace(max(-30 - tau_e / 2, tau_e / 2 - 30), min(30 - tau_e / 2, 30 + tau_e / 2), 20_001)
    stiffness = sum(
        stiffness_under(spring, torque)
        for spring, torque in zip(springs, (tau_e / 2 + preload, tau_e / 2 - preload), strict=True)
    )
    outermost = stiffness[::-1]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(outermost))))
    inner = turns[0] + 1 if turns.size else -1
    ends = sorted([outermost[0], outermost[inner]])
    found = solve(springs, tau_e, 1.0)
    # The turn is missed by half a cell, 1e-4 of the preload.
    assert [found.lower[0], found.upper[0]] == pytest.approx(ends, rel=1e-6)
    falling = outermost[0] < outermost[inner]
    assert (found.lower_critical[0], found.upper_critical[0]) == (
        bool(turns.size) and not falling,
        bool(turns.size) and falling,
    )


# Samples one by one


def samples_of(springs: Springs, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Loads of any size, zero among them, and stiffness within and below reach."""
    rng = np.random.default_rng(8)
    tau_e = rng.uniform(-20, 20, count) * fold_load(springs[0]) * 10 ** rng.uniform(-6, 0, count)
    tau_e[::50] = 0
    lower = laws.make_pair(*springs).solve(tau_e, np.ones_like(tau_e)).lower
    return tau_e, lower * (1 + rng.uniform(-0.2, 1, count))


@pytest.mark.parametrize(
    "second", [laws.Cubic(k=400, k_c=2000), laws.Cubic(k=440, k_c=2000), laws.Cubic(k=90, k_c=9000)], ids=str
)
def test_a_sample_knows_nothing_of_its_neighbors(second: laws.Cubic):
    pair = laws.make_pair(laws.Cubic(k=400, k_c=2000), second)
    tau_e, stiffness = samples_of((laws.Cubic(k=400, k_c=2000), second), 600)
    whole = pair.solve(tau_e, stiffness)
    order = np.random.default_rng(0).permutation(600)
    shuffled = pair.solve(tau_e[order], stiffness[order])
    parts = [pair.solve(tau_e[cut], stiffness[cut]) for cut in (slice(0, 1), slice(1, 8), slice(8, 600))]
    for name in laws.PairSolution._fields:
        expected = getattr(whole, name)
        np.testing.assert_array_equal(getattr(shuffled, name), expected[order])
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), expected)


def test_no_samples_are_no_problem():
    for springs in (K_440, (K_440[0], K_440[0])):
        assert all(array.shape == (0,) for array in laws.make_pair(*springs).solve(np.empty(0), np.empty(0)))


def test_below_reach_the_deflections_are_those_of_the_end():
    low, end = solve(K_440, 100.0, 500.0), solve(K_440, 100.0, 1.0)
    assert low == end


# Anything goes


@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("decades", [0.05, 1, 2])
def test_any_load_and_stiffness_is_solved_to_rounding(decades: float):
    rng = np.random.default_rng(3)
    for _ in range(25):
        springs = random_springs(rng, decades)
        signs, sizes = rng.choice([-1, 1], 100), 10 ** rng.uniform(-6, 2, 100)
        tau_e = signs * sizes * fold_load(springs[0])
        pair = laws.make_pair(*springs)
        lower = pair.solve(tau_e, np.ones_like(tau_e)).lower
        stiffness = lower * (1 + 10 ** rng.uniform(-6, 3, 100))
        # 1e-12, as documented; constants a hundred times off use up two or three digits of it.
        assert residuals(springs, pair.solve(tau_e, stiffness), tau_e, stiffness) <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("pairs", [10, exhaustive(50)])
def test_absurd_springs_and_loads_give_numbers(pairs: int):
    rng = np.random.default_rng(1)
    sizes = np.concatenate([10 ** rng.uniform(-3, 6, 30), [1e-300, 1e-200, 1e-100, 1e-30, 1e-15, 0]])
    for _ in range(pairs):
        first, second = (
            laws.Cubic(k=10 ** rng.uniform(-3, 6), k_c=10 ** rng.uniform(-3, 9)) for _ in range(2)
        )
        tau_e = rng.choice([-1, 1], sizes.size) * sizes
        stiffness = (first.k + second.k) * 10 ** rng.uniform(-6, 6, sizes.size)
        for springs in ((first, first), (first, second)):
            found = laws.make_pair(*springs).solve(tau_e, stiffness)
            assert np.all(np.isfinite([found.lower, found.phi_1, found.phi_2]))
            # Rounding of the smaller stiffness in the sum.
            assert np.all(found.lower >= (springs[0].k + springs[1].k) * (1 - 4 * EPS))


def test_unloaded_springs_are_softest_without_deflection():
    found = laws.make_pair(*K_440).solve(np.array([0.0, -0.0, 1e-300, -1e-300]), np.full(4, 1000.0))
    np.testing.assert_array_equal(found.lower, 840)
    assert np.all(found.lower_critical)
    assert np.all(found.phi_1 > 0)
    assert np.all(found.phi_2 < 0)
