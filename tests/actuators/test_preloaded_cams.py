"""Preloaded cams: the branch against dense scans, there and back, digits next to rest, what is infeasible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
from oracles import cam_scan
from samples.marks import slow_but
from samples.mechanisms import profile

from vsacli import laws, mechanisms
from vsacli.actuators.mechanisms.preloaded_cams.preloaded_cam import PreloadedCam
from vsacli.actuators.reach import classify_stiffness

EPS = float(np.finfo(float).eps)
DRAWS = 10_000
TINY = 1e-100
"""A stiffness; where the torque has its peak the least is zero, and what lies below is negative."""


@dataclass(frozen=True)
class Case:
    """A cam, and the same for the oracle.

    Attributes:
        cam: as vsacli has it.
        scan: for the oracle, over deflections from rest.
        rest: deflection at which the lift has its minimum.
    """

    cam: PreloadedCam
    scan: cam_scan.Cam
    rest: float = 0.0

    def solve(self, tau_e: np.ndarray, stiffness: np.ndarray) -> laws.PairSolution:
        return self.cam.solve(tau_e, stiffness, tau_e)

    def largest_torques(self) -> tuple[float, float]:
        """The first peaks of what the largest pretension carries, on either side of rest."""
        low, high = (self._peak(np.linspace(0, end, 20_001)) for end in self.scan.domain)
        return low, high

    def _peak(self, phi: np.ndarray) -> float:
        torque, _ = self.scan.springs(phi, np.full_like(phi, self.scan.pretension[1]))
        falls = np.diff(np.abs(torque)) < 0
        return float(torque[falls.argmax() if falls.any() else -1])


def maccepa(k: float, b: float, c: float, pretension: tuple[float, float]) -> Case:
    def lift(phi: Any) -> Any:
        growth = 4 * b * c * sympy.sin(phi / 2) ** 2  # of the squared distance; nothing cancels at rest
        return growth / (sympy.sqrt((c - b) ** 2 + growth) + abs(c - b))

    scan = cam_scan.Cam(lift, (-np.pi, np.pi), k, pretension)
    return Case(mechanisms.Maccepa(k=k, b=b, c=c, r=0.015, pretension=pretension), scan)


def polynomial(
    coefficients: tuple[float, ...],
    ends: tuple[float, float],
    pretension: tuple[float, float],
    rest: float = 0.0,
) -> Case:
    """Exact lifts, from the second power on: up to the sixth they lie in the span of the fit."""

    def lift(phi: Any) -> Any:
        return sum(each * phi**power for power, each in enumerate(coefficients, 2))

    phi = np.linspace(*ends, 61)
    table = profile(phi, 0.01 + lift(phi - rest))
    scan = cam_scan.Cam(lift, (ends[0] - rest, ends[1] - rest), 4e4, pretension)
    return Case(mechanisms.Cam(k=4e4, r=0.005, pretension=pretension, profile=table), scan, rest)


BUILT = 0.036, 0.135
"""Levers of the MACCEPA that comes along."""

S_SHAPED = 0.03, 0, -0.025, 0, 0.01
"""Its curvature is negative from 0.53 to 0.85 rad."""

CASES = {
    "maccepa": maccepa(394, *BUILT, (0, 0.03)),
    "maccepa, always preloaded": maccepa(231, *BUILT, (0.002, 0.03)),
    "maccepa, hardly preloaded": maccepa(394, *BUILT, (0, 0.004)),
    "maccepa, always tight": maccepa(394, *BUILT, (0.03, 0.031)),
    "maccepa, levers nearly alike": maccepa(5e3, 0.0495, 0.05, (1e-5, 0.02)),
    "maccepa, short lever": maccepa(5e3, 0.001, 0.2, (0, 1.0)),
    "parabola": polynomial((0.02,), (-0.6, 0.6), (0, 0.02)),
    "progressive": polynomial((0.02, 0, 0.1), (-0.5, 0.5), (0.001, 0.02)),
    "progressive, hardly preloaded": polynomial((0.02, 0, 0.1), (-0.5, 0.5), (0, 0.001)),
    "not symmetric": polynomial((0.03, 0.02, 0.1, -0.05, 0.1), (-0.5, 0.6), (0, 0.02), rest=0.08),
    "s-shaped": polynomial(S_SHAPED, (-1, 1), (0, 0.02)),
    "s-shaped, always preloaded": polynomial(S_SHAPED, (-1, 1), (0.01, 0.02)),
    "s-shaped, hardly preloaded": polynomial(S_SHAPED, (-1, 1), (0, 0.001)),
}
QUICK = ("not symmetric",)


@pytest.fixture(params=slow_but(QUICK, CASES))
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


def torques(case: Case, count: int, rng: np.random.Generator, beyond: float = 1.0) -> np.ndarray:
    """Over decades in either direction, up to the largest that can be carried, or beyond."""
    low, high = case.largest_torques()
    share = np.concatenate((rng.uniform(-1, 1, count - count // 3), 10 ** rng.uniform(-9, 0, count // 3)))
    share[::2] *= -1
    drawn: np.ndarray = beyond * np.where(share > 0, share * high, -share * low)
    return drawn


@pytest.mark.cases(3)
def test_the_branch_is_that_of_a_dense_scan(case: Case):
    tau_e = torques(case, 30, np.random.default_rng(1), beyond=1.1)
    found = case.solve(tau_e, np.ones_like(tau_e))
    scanned = [case.scan.reach(each) for each in tau_e.tolist()]
    lower, upper, turns = (np.array(each) for each in zip(*scanned, strict=True))
    # the scan is fine to 1e-9 of the deflection at the ends, and to the square of that where it turns around
    scale = np.nanmax(upper)
    np.testing.assert_allclose(found.lower, lower, rtol=1e-7, atol=1e-7 * scale)
    np.testing.assert_allclose(found.upper, upper, rtol=1e-7, atol=1e-7 * scale)
    np.testing.assert_array_equal(found.lower_critical | found.upper_critical, turns)
    assert not found.slack_below.any()


@pytest.mark.slow
def test_a_fold_of_the_built_device():
    """At 0.02 N m it is the least stiffness, 0.1313 N m/rad, at 0.2286 rad."""
    found = CASES["maccepa"].solve(np.array([0.02]), np.array([0.1]))
    assert (found.lower[0], found.phi_1[0]) == pytest.approx((0.1313, 0.2286), rel=5e-4)  # four digits
    assert found.lower_critical[0]
    # the other state of the same torque and a stiffness above has less pretension
    above = CASES["maccepa"].solve(np.array([0.02]), np.array([0.14]))
    assert above.phi_1[0] < found.phi_1[0]
    assert above.phi_2[0] > found.phi_2[0]


@pytest.mark.cases(1)
def test_there_and_back(case: Case):
    """Deflections and pretensions come back but for rounding over the root of the margin to a fold."""
    rng = np.random.default_rng(2)
    low, high = case.scan.pretension
    phi = rng.uniform(*case.scan.domain, DRAWS)
    pretension = rng.uniform(low, high, DRAWS)
    tau_e, stiffness = case.scan.springs(phi, pretension)
    phi, pretension, tau_e, stiffness = (
        each[on_branch(case, phi, tau_e, stiffness)] for each in (phi, pretension, tau_e, stiffness)
    )
    assert len(phi) > DRAWS / 20
    found = case.solve(tau_e, stiffness)
    margin = np.minimum(stiffness - found.lower, found.upper - stiffness) / stiffness
    assert np.all(margin > -1e-9)
    regular = margin > 1e-4  # nearer to a fold, the scan does not tell its two sides apart
    size = terms(case, found) / stiffness
    allowed = (1e-14 * size / np.sqrt(margin))[regular]
    apart = np.abs(found.phi_1 - case.rest - phi) / np.ptp(case.scan.domain)
    set_apart = np.abs(case.cam.r * found.phi_2 - pretension) / (high + case.cam.lift(phi).l)
    assert np.all((apart[regular] <= allowed) & (set_apart[regular] <= allowed))


def terms(case: Case, found: laws.PairSolution) -> np.ndarray:
    """Size of what the stiffness is the sum of, and of what the deflection's size makes of its rounding."""
    there = case.cam.partials(found.phi_1, found.phi_2)
    l1 = case.cam.lift(found.phi_1 - case.rest).l1
    return there.T_p + case.cam.k * l1 * l1 + np.abs(found.phi_1 * there.T_pp)


def on_branch(case: Case, phi: np.ndarray, tau_e: np.ndarray, stiffness: np.ndarray) -> Any:
    """Whether the stiffness is monotone from the largest pretension on, and positive from rest on."""
    high = np.full_like(phi, case.scan.pretension[1])
    at_rest, start = np.zeros_like(phi), phi
    for _ in range(60):  # bisection, as long as the torque rises with the deflection
        middle = (at_rest + start) / 2
        beyond = np.abs(case.scan.springs(middle, high)[0]) > np.abs(tau_e)
        at_rest, start = np.where(beyond, at_rest, middle), np.where(beyond, middle, start)
    near = np.geomspace(1e-6, 0.5, 60)
    shares = np.concatenate((near, 1 - near[::-1]))[:, None]
    along = case.scan.along(start + shares * (phi - start), tau_e)[1]
    before = case.scan.springs(shares * start, np.broadcast_to(high, (len(shares), len(high))))[1]
    slope = np.sign(np.diff(along, axis=0))
    monotone = np.all(slope >= 0, axis=0) | np.all(slope <= 0, axis=0)
    return monotone & np.all(along > 0, axis=0) & np.all(before > 0, axis=0) & (stiffness > 0)


@pytest.mark.cases(4)
def test_what_is_feasible_has_no_residual(case: Case):
    rng = np.random.default_rng(3)
    tau_e = torques(case, DRAWS, rng)
    ends = case.solve(tau_e, np.ones_like(tau_e))
    share = np.concatenate((rng.uniform(0, 1, DRAWS // 2), 10 ** rng.uniform(-12, 0, DRAWS - DRAWS // 2)))
    stiffness = ends.lower + share * (ends.upper - ends.lower)
    found = case.solve(tau_e, stiffness)
    there = case.cam.partials(found.phi_1, found.phi_2)
    # deflections from a rest that is not zero round to EPS of that
    rounding = EPS * abs(case.rest) * there.T_p
    assert np.all(np.abs(there.T - tau_e) <= 20 * EPS * np.abs(tau_e) + rounding)
    assert np.all(np.abs(there.T_p - stiffness) <= 20 * EPS * terms(case, found))
    least, most = case.cam.pretension
    pretension = case.cam.r * found.phi_2
    assert np.all((pretension >= least * (1 - EPS)) & (pretension <= most * (1 + EPS)))


def test_demands_outside_are_infeasible(case: Case):
    rng = np.random.default_rng(4)
    tau_e = torques(case, DRAWS, rng)
    ends = case.solve(tau_e, np.ones_like(tau_e))
    for stiffness in (
        (ends.lower + TINY) * (1 - 10 ** rng.uniform(-8, 0, DRAWS)) - TINY,
        ends.upper * (1 + 10 ** rng.uniform(-8, 3, DRAWS)),
        -(10 ** rng.uniform(-6, 6, DRAWS)),
    ):
        assert classify_stiffness(stiffness, case.solve(tau_e, stiffness)).infeasible.all()
    low, high = case.largest_torques()
    beyond = np.where(tau_e > 0, high, low) * (1 + 10 ** rng.uniform(-6, 6, DRAWS))
    found = case.solve(beyond, ends.upper)
    assert classify_stiffness(ends.upper, found).infeasible.all()
    assert np.isnan(found.phi_1).all()


def test_through_zero_torque_without_loss_of_digits():
    """Deflection and pretension next to rest against fifty digits."""
    case = CASES["maccepa"]
    mpmath.mp.dps = 50
    k, b, c = mpmath.mpf(394), mpmath.mpf(0.036), mpmath.mpf(0.135)

    def distance(phi: Any) -> Any:
        return mpmath.sqrt(b * b + c * c - 2 * b * c * mpmath.cos(phi))

    def residual(phi: Any, p: Any, tau_e: float, stiffness: float) -> tuple[Any, Any]:
        a, area = distance(phi), b * c
        x, l1 = a - (c - b) + p, area * mpmath.sin(phi) / a
        return k * l1 * x - tau_e, k * (l1**2 + (area * mpmath.cos(phi) - l1**2) / a * x) - stiffness

    tau_e = np.array([sign * 10.0**power for power in (-1.7, -3, -6, -9, -12) for sign in (1, -1)])
    stiffness = np.full_like(tau_e, 0.3)
    found = case.solve(tau_e, stiffness)
    for at, (torque, sigma) in enumerate(zip(tau_e.tolist(), stiffness.tolist(), strict=True)):
        start = mpmath.mpf(found.phi_1[at]), mpmath.mpf(0.015 * found.phi_2[at])
        exact = mpmath.findroot(
            lambda phi, p, torque=torque, sigma=sigma: residual(phi, p, torque, sigma), start, tol=1e-80
        )
        assert abs(found.phi_1[at] / exact[0] - 1) < 8 * EPS
        assert abs(0.015 * found.phi_2[at] / exact[1] - 1) < 8 * EPS
    tiny = case.solve(np.array([1e-200]), np.array([0.3]))
    assert tiny.phi_1[0] == pytest.approx(1e-200 / 0.3, rel=4 * EPS)


@pytest.mark.parametrize("least", [0.0, 0.002])
def test_without_torque_the_stiffness_is_proportional_to_the_pretension(least: float):
    case = maccepa(394, *BUILT, (least, 0.03))
    curvature = 0.036 * 0.135 / (0.135 - 0.036)
    stiffness = np.linspace(0.05, 0.55, 11)
    found = case.solve(np.zeros(11), stiffness)
    np.testing.assert_allclose(found.lower, 394 * curvature * least, rtol=4 * EPS)
    np.testing.assert_allclose(found.upper, 394 * curvature * 0.03, rtol=4 * EPS)
    np.testing.assert_array_equal(found.phi_1, 0)
    np.testing.assert_allclose(0.015 * found.phi_2, stiffness / (394 * curvature), rtol=4 * EPS)


def test_the_peak_of_the_torque_is_no_singularity():
    case = CASES["maccepa"]
    tau_e = 0.9 * np.full(50, case.largest_torques()[1])
    stiffness = np.geomspace(1e-9, 0.1, 50)
    found = case.solve(tau_e, stiffness)
    np.testing.assert_array_equal(found.lower, 0)
    assert not found.lower_critical.any()
    state = case.cam.state(found.phi_1, found.phi_2, found.phi_1)
    assert np.all(np.abs(state.determinant) > 1e-4)
