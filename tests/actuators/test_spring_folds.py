"""The map of folds of a pair: pieces of hardening, boxes that hold the outermost fold, and nothing missed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from samples.springs import SPRINGS, measured, on_side_2, stiffness_under
from scipy.optimize import brentq

from vsacli import laws
from vsacli.actuators.laws.tendons import Mirrored
from vsacli.actuators.pairs.balance import Balance
from vsacli.actuators.pairs.critical_points import sample_hardening
from vsacli.actuators.pairs.folds import FoldMap, map_folds, outermost_fold

EPS = float(np.finfo(float).eps)

LAWS: dict[str, laws.SpringLaw] = {
    **{f"{name} {number}": side[0] for name, both in SPRINGS.items() for number, side in enumerate(both)},
    **{f"ratio {ratio}": laws.FourBar(k=1, ratio=ratio) for ratio in (1.0001, 1.03, 1.1, 2, 10, 1000)},
    "one term": laws.Polynomial(c1=1e-3, c9=9e5),
    "two humps": laws.Polynomial(c1=1, c3=100, c9=1e4),
    "linear": laws.Polynomial(c1=7),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_hardening_is_monotone_between_its_peaks(law: laws.SpringLaw):
    hardening = sample_hardening(law)
    assert hardening is not None
    np.testing.assert_array_equal(hardening.rho, law.hardening(hardening.phi))
    for piece in hardening.pieces():
        low, high = hardening.phi[piece][[0, -1]]
        # All features of these laws lie below.
        phi = np.linspace(low, min(high, 10), 5000)
        rho = law.hardening(phi)
        rising = 1 if hardening.rises(piece) else -1
        # Rounding of three derivatives; a measured curve's are sums over its knots.
        slack = 1e-11 * np.abs(rho[1:])
        assert np.all(rising * np.diff(rho) >= -slack)


@pytest.mark.parametrize(("k", "k_c"), [(400, 2000), (1e-3, 1e9), (1e6, 1e-3)])
def test_hardening_of_a_cubic_spring_peaks_where_its_formula_does(k: float, k_c: float):
    hardening = sample_hardening(laws.Cubic(k=k, k_c=k_c))
    assert hardening is not None
    # d/dphi of 6 Kc phi/(K + 3 Kc phi^2) is zero there; a slope below 1e-13 counts as none.
    assert hardening.phi[hardening.peaks] == pytest.approx([math.sqrt(k / (3 * k_c))], rel=1e-12)


def test_two_humps_have_three_turns():
    hardening = sample_hardening(LAWS["two humps"])
    assert hardening is not None
    assert len(hardening.peaks) == 3


@pytest.mark.slow
@pytest.mark.parametrize("low", [-1e-6, -1e-7])
def test_a_measured_curve_that_rounds_at_its_end_has_no_peak_there(low: float):
    deflection = np.linspace(low, 0.5, 30)
    law = Mirrored(law=measured(deflection, 100 * deflection**3))
    hardening = sample_hardening(law)
    assert hardening is not None
    assert np.all((hardening.peaks > 0) & (hardening.peaks < len(hardening.phi) - 1))
    assert np.all(np.diff(map_folds(law.law, law.law).tau_e) >= 0)


def test_a_tendon_that_pulls_the_other_way_has_no_positive_torque():
    law, _ = on_side_2(SPRINGS["quadratic"][0])
    assert sample_hardening(law) is None


def springs_of(name: str) -> tuple[laws.SpringLaw, laws.SpringLaw]:
    (first, _), (second, _) = SPRINGS[name][0], on_side_2(SPRINGS[name][1])
    return first, second


@pytest.mark.parametrize("name", SPRINGS)
def test_nodes_of_the_map_are_folds(name: str):
    first, second = springs_of(name)
    folds = map_folds(first, second)
    assert np.all(np.diff(folds.tau_e) >= 0)
    assert folds.tau_e[-1] == math.inf
    known = np.isfinite(folds.phi_1) & (np.abs(folds.tau_e) < 1e3) & (np.abs(folds.tau_e) > 1e-6)
    tau_e, phi_1, phi_2 = folds.tau_e[known], folds.phi_1[known], folds.phi_2[known]
    np.testing.assert_allclose(first.torque(phi_1) + second.torque(phi_2), tau_e, rtol=4 * EPS)
    rho_1, rho_2 = first.hardening(phi_1), second.hardening(phi_2)
    # One of the two deflections is a root for the hardening of the other.
    np.testing.assert_allclose(rho_1, rho_2, rtol=1e-10)


def torques_of(folds: FoldMap) -> np.ndarray:
    """Torques in every cell up to 100 N m: next to its ends, since two folds are born there, and anywhere."""
    low, high = folds.tau_e[:-1], folds.tau_e[1:]
    cells = np.isfinite(folds.phi_1[:-1] + folds.phi_1[1:]) & (high - low > 1e-9 * np.abs(high))
    cells &= (np.abs(low) < 100) & (np.abs(high) < 100) & (np.abs(low) + np.abs(high) > 1e-3)
    shares = np.concatenate((np.geomspace(1e-9, 0.1, 5), np.random.default_rng(20).uniform(0, 1, 8)))
    shares = np.concatenate((shares, 1 - shares[:5]))[:, None]
    return (low[cells] + shares * (high - low)[cells]).ravel()


@pytest.mark.parametrize("name", ["cubic", "polynomial", "sinh", "four_bar", "table"])
def test_the_outermost_fold_is_where_a_scalar_solver_finds_it(name: str):
    first, second = springs_of(name)
    folds, balance = map_folds(first, second), Balance(first, second)
    tau_e = torques_of(folds)
    exists, found = outermost_fold(balance, folds, tau_e)
    assert exists.all()
    # The balance of the torques is met but for rounding of the two.
    scale = np.abs(found.one.tau) + np.abs(found.two.tau)
    assert np.all(np.abs(found.torque - tau_e) <= 8 * EPS * scale)
    for torque, phi_1, phi_2, stiffness in zip(
        tau_e[::7], found.phi_1[::7], found.phi_2[::7], found.stiffness[::7], strict=True
    ):
        exact = scalar_fold(balance, torque, phi_1, phi_2)
        # Tables are sums of seven terms, and a four-bar linkage loses digits next to its end.
        assert stiffness == pytest.approx(exact, rel=3e-14)


def scalar_fold(balance: Balance, tau_e: float, phi_1: float, phi_2: float) -> float:
    """Stiffness at the fold that Brent's method finds next to deflections, along the curve of equal tau_e."""

    def deflections(t: float) -> tuple[np.ndarray, np.ndarray]:
        return balance.deflections_at(np.array(tau_e), np.array(t))

    def slope(t: float) -> float:
        return float(balance.stiffness_slope(*deflections(t)))

    middle = float(balance.first.torque(np.array(phi_1)) - balance.second.torque(np.array(phi_2))) / 2
    least, largest = balance.preload_range(np.array(tau_e))
    for share in np.geomspace(1e-9, 1, 40):
        width = share * (abs(middle) + abs(tau_e))
        low, high = max(middle - width, float(least)), min(middle + width, float(largest))
        if slope(low) * slope(high) < 0:
            t = brentq(slope, low, high, xtol=1e-300, rtol=4 * EPS)
            return float(balance.state(*deflections(t)).stiffness)
    raise AssertionError("there is no fold next to these deflections")


def test_tendons_against_each_other_have_no_fold():
    (first, _), (second, _) = SPRINGS["exponential"][0], on_side_2(SPRINGS["exponential"][1])
    assert np.all(np.isnan(map_folds(first, second).phi_1))


def folds_of(springs: tuple[laws.Cubic, laws.Cubic], tau_e: float) -> int:
    """How often the stiffness turns around over the torque of side 1, by a dense scan."""
    share = np.linspace(0, 1, 20_001)
    torques = zip(springs, (share * tau_e, (1 - share) * tau_e), strict=True)
    stiffness = sum((stiffness_under(spring, torque) for spring, torque in torques), start=np.zeros(20_001))
    return int(np.count_nonzero(np.diff(np.sign(np.diff(stiffness)))))


def test_two_folds_are_born_at_the_cusp_where_the_outermost_fold_jumps():
    springs = laws.Cubic(k=400, k_c=2000), laws.Cubic(k=440, k_c=2000)
    folds = map_folds(*springs)
    # Where the outermost fold jumps there are two nodes of one torque.
    jump = np.abs(np.diff(folds.phi_1)) > 1e-3 * np.abs(folds.phi_1[1:])
    jumps = folds.tau_e[1:][jump & (np.diff(folds.tau_e) == 0)]
    (cusp,) = jumps[np.abs(jumps) < 1e6]
    # Right after the cusp they are apart by the root of the relative distance, and so seen by the scan.
    assert folds_of(springs, cusp * (1 - 1e-4)) == 1
    assert folds_of(springs, cusp * (1 + 1e-4)) == 3
