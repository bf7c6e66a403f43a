"""Mechanisms of one's own: their potential, their branch, and what is refused when a file is read."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
from oracles import potential_scan
from samples.marks import slow_but

from vsacli.actuators.laws import Cubic
from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.mechanisms.potentials.potential import Potential, Ranges, Start
from vsacli.actuators.mechanisms.preloaded_cams.maccepa import Maccepa
from vsacli.actuators.mechanisms.ratios.awas import Awas
from vsacli.actuators.pairs import make_pair
from vsacli.actuators.reach import reach_flags

AWAS = Potential(
    energy="k*(r*theta_2)^2*sin(theta_1 - q)^2",
    constants=(("k", 50000.0), ("r", 0.01)),
    start=Start(theta_1=0, theta_2=8),
    range=Ranges(phi=(-0.9, 0.9), theta_2=(5, 12)),
)
MACCEPA = Potential(
    energy="k/2*(sqrt(B^2 + C^2 - 2*B*C*cos(phi)) - (C - B) + r*theta_2)^2",
    constants=(("k", 394.0), ("B", 0.036), ("C", 0.135), ("r", 0.015)),
    start=Start(theta_1=0.05, theta_2=3),
    range=Ranges(phi=(-3.1, 3.1), theta_2=(0, 6)),
)
TWO_SPRINGS = Potential(
    energy="k/2*((theta_1 - q)^2 + (theta_2 - q)^2) + k_c/4*((theta_1 - q)^4 + (theta_2 - q)^4)",
    constants=(("k", 400.0), ("k_c", 2000.0)),
    start=Start(theta_1=0.2, theta_2=-0.2),
    range=Ranges(phi=(-2, 2), theta_2=(-9, 9)),
)
BOWED = Potential(
    energy="k/2*(r*theta_2)^2*(phi - bow*sin(2*q))^2 + k_c*phi^4/(1 + theta_2/5)",
    constants=(("k", 50000.0), ("k_c", 500.0), ("r", 0.01), ("bow", 0.1)),
    start=Start(theta_1=0, theta_2=10),
    range=Ranges(phi=(-0.8, 0.8), theta_2=(4, 20)),
)
WAVY = Potential(
    energy="a*phi^2*(2 + sin(theta_2))*(1 + c*phi^2) + b*phi*sin(3*theta_2)",
    constants=(("a", 5.0), ("b", 0.6), ("c", 1.5)),
    start=Start(theta_1=0.1, theta_2=0.3),
    range=Ranges(phi=(-1, 1), theta_2=(-3, 3)),
)
"""Level curves that wind, and several pieces on most of them."""

STIFFNESS_RTOL = 1e-9
"""Of the peak, as flags know it; what is found agrees to 1e-11."""

PHI_RTOL = 1e-9
"""Of the peak; the error of phi is that of the stiffness over the margin, which is 0.01 or more here."""


@dataclass(frozen=True)
class Demand:
    """Torques, stiffnesses and positions that are drawn at random."""

    tau_e: float
    stiffness: tuple[float, float]
    q: float = 3.0
    samples: int = 1000

    @cached_property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        draw = np.random.default_rng(7).uniform
        tau_e, q = draw(-self.tau_e, self.tau_e, self.samples), draw(-self.q, self.q, self.samples)
        return tau_e, draw(*self.stiffness, self.samples), q


def awas(demand: Demand) -> PairSolution:
    tau_e, stiffness, q = demand.arrays
    return Awas(k=50000, arm=(0.05, 0.12), lead=0.01).solve(tau_e, stiffness, q)


def maccepa(demand: Demand) -> PairSolution:
    tau_e, stiffness, q = demand.arrays
    return Maccepa(k=394, b=0.036, c=0.135, r=0.015, pretension=(0, 0.09)).solve(tau_e, stiffness, q)


def two_springs(demand: Demand) -> PairSolution:
    tau_e, stiffness, q = demand.arrays
    solution = make_pair(*(Cubic(k=400, k_c=2000),) * 2).solve(tau_e, stiffness)
    return solution._replace(phi_2=solution.phi_2 + q)


BUILT_IN = {
    "awas": (AWAS, awas, Demand(800, (5, 1500))),
    "maccepa": (MACCEPA, maccepa, Demand(2, (0.02, 5))),
    "two springs": (TWO_SPRINGS, two_springs, Demand(300, (700, 3000))),
}


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_potential_is_the_mechanism_that_it_describes(name: str) -> None:
    """Built-in mechanisms know their solutions in other ways: closed, by bracketing, or by a map of folds."""
    potential, of_built_in, demand = BUILT_IN[name]
    found, expected = potential.solve(*demand.arrays), of_built_in(demand)
    np.testing.assert_array_equal(np.isnan(found.lower), np.isnan(expected.lower))
    stiffness = demand.arrays[1]
    np.testing.assert_array_equal(reach_flags(stiffness, found), reach_flags(stiffness, expected))
    peak = np.nanmax(expected.lower)
    np.testing.assert_allclose(found.lower, expected.lower, rtol=STIFFNESS_RTOL, atol=STIFFNESS_RTOL * peak)
    bounded = np.isfinite(expected.upper)
    np.testing.assert_allclose(found.upper[bounded], expected.upper[bounded], rtol=STIFFNESS_RTOL)
    inside = (stiffness > 1.01 * expected.lower) & (stiffness < 0.99 * expected.upper)
    assert inside.sum() > 200
    for mine, theirs in ((found.phi_1, expected.phi_1), (found.phi_2, expected.phi_2)):
        size = np.abs(theirs[inside]).max()
        np.testing.assert_allclose(mine[inside], theirs[inside], rtol=0, atol=PHI_RTOL * size)


SCANNED = {
    "maccepa": (MACCEPA, (0.0,), 2.0),
    "wavy": (WAVY, (0.0,), 12.0),
    "bowed": (BOWED, (0.0, 0.7, -1.3), 600.0),
}


@pytest.mark.parametrize("name", slow_but({"wavy"}, SCANNED))
def test_the_corridor_is_what_a_dense_scan_of_the_branch_reaches(name: str) -> None:
    potential, positions, largest = SCANNED[name]
    oracle = potential_scan.Potential(potential.energy, dict(potential.constants))
    torques = np.random.default_rng(1).uniform(-largest, largest, 60)
    for q in positions:
        scan = potential_scan.Scan(oracle, q, potential.range.phi, potential.range.theta_2)
        branch = scan.branch(potential.start.theta_1, potential.start.theta_2)
        solution = potential.solve(torques, np.ones(60), np.full(60, q))
        crossings = [scan.reached(torque, branch) for torque in torques]
        for end, extreme in ((solution.lower, np.argmin), (solution.upper, np.argmax)):
            assert_ends(end, crossings, extreme)
        there = oracle.at(q, solution.phi_1, solution.phi_2)
        carried = np.isfinite(solution.lower)
        np.testing.assert_allclose(there.tau_e[carried], torques[carried], rtol=0, atol=1e-9 * largest)


Extreme = Callable[[np.ndarray], np.intp]


def assert_ends(ends: np.ndarray, crossings: list[potential_scan.Crossings], extreme: Extreme) -> None:
    """The ends of the corridor are the extremes of the scan, but for what happens within a few cells."""
    assert sum(crossing.stiffness.size > 0 for crossing in crossings) > 30
    for end, (stiffness, resolution) in zip(ends, crossings, strict=True):
        if stiffness.size:
            last = extreme(stiffness)
            assert abs(end - stiffness[last]) <= 3 * resolution[last]
        else:
            assert math.isnan(end)
