"""(14) for every ordered pair of spring laws: there and back on the branch, and nothing infeasible missed.

The judge of the branch is a dense scan that shares no code with the solver.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pytest
from oracles.spring_scan import Curve, Springs
from samples.drives import springs
from samples.marks import slow
from samples.springs import SPRINGS, Spring, measured, on_side_2, residuals

from vsacli import Flag, laws
from vsacli.actuators.reach import margin, reach_flags
from vsacli.base.flags import SINGULAR_MARGIN, has_flag

DRAWS = 400
"""Points on the two curves for each pair; about half of them lie on the branch."""

LOADS = 6
"""Loads for each pair at which the reachable stiffness is scanned for."""

LARGEST_TORQUE = 100.0
"""N m; ten times what the springs carry in use, so that the loads are heavy for all of them."""


def pairs() -> Iterator[tuple[str, Spring, Spring]]:
    """Every law with itself, with itself of other constants, and with every other law, on either side."""
    for first, (one, other) in SPRINGS.items():
        yield f"{first}, alike", one, on_side_2(one)
        yield f"{first}, unlike", one, on_side_2(other)
        yield f"{first}, unlike, swapped", other, on_side_2(one)
        for second in SPRINGS.keys() - {first}:
            for number in (0, 1):
                name = f"{first} and {second} {number}"
                yield name, SPRINGS[first][number], on_side_2(SPRINGS[second][number])


PAIRS = {name: pair for name, *pair in sorted(pairs(), key=lambda named: named[0])}
MIXED = [name for name in PAIRS if " and " in name and not name.startswith("cubic and ")]
"""Two laws other than the paper's."""
REPEATED = (", unlike, swapped", " 1")
"""Ends of the names of pairs whose laws are those of others, with sides exchanged or other constants."""

every_pair = pytest.mark.parametrize(
    ("first", "second"),
    [slow(*pair) if name in MIXED or name.endswith(REPEATED) else pair for name, pair in PAIRS.items()],
    ids=PAIRS,
)


def draw(rng: np.random.Generator, curve: Curve, count: int) -> np.ndarray:
    """Deflections on either side of zero, half of them with torques spread over six decades."""
    low, high = np.clip(curve.torque_ends, -LARGEST_TORQUE, LARGEST_TORQUE)
    share = np.where(rng.random(count) < 0.5, 10 ** rng.uniform(-6, 0, count), rng.random(count))
    end = np.where(rng.random(count) < 0.5, low or high, high or low)
    return curve.deflection(end * share)


class RoundTrip(NamedTuple):
    """What is left of draws on the branch after (tau_e, sigma) and back.

    Attributes:
        draws: how many lie on the branch.
        residual: largest scaled residual of (14).
        phi: largest error of a deflection where the margin exceeds 1e-3, rad.
        refused: how many were called infeasible.
        elsewhere: how many came back as another point.
    """

    draws: int
    residual: float
    phi: float
    refused: int
    elsewhere: int


def round_trip(first: Spring, second: Spring, count: int, seed: int = 0) -> RoundTrip:
    rng = np.random.default_rng(seed)
    (law_1, curve_1), (law_2, curve_2) = first, second
    oracle = Springs(curve_1, curve_2)
    phi = np.stack((draw(rng, curve_1, count), draw(rng, curve_2, count)))
    tau_1, tau_2 = curve_1.torque(phi[0]), curve_2.torque(phi[1])
    on_branch = oracle.on_branch(tau_1, tau_1 + tau_2, nodes=60)
    phi, tau_1, tau_2 = phi[:, on_branch], tau_1[on_branch], tau_2[on_branch]
    tau_e, stiffness = tau_1 + tau_2, curve_1.stiffness(phi[0]) + curve_2.stiffness(phi[1])

    found = laws.make_pair(law_1, law_2).solve(tau_e, stiffness)
    gap = margin(stiffness, found.lower, found.upper)
    error = np.abs(np.stack((found.phi_1, found.phi_2)) - phi).max(axis=0)
    refused = ~(gap >= -SINGULAR_MARGIN)
    elsewhere = (gap > 1e-3) & ~(error < 1e-6)
    # A finer scan knows better where the coarse one saw no turn.
    for unclear in (refused, elsewhere):
        for index in np.flatnonzero(unclear):
            cut = slice(index, index + 1)
            unclear[index] = oracle.on_branch(tau_1[cut], tau_e[cut], nodes=20_000)[0]
    sure = (gap > 1e-3) & (error < 1e-6)
    return RoundTrip(
        draws=tau_e.size,
        residual=residuals((law_1, law_2), found, tau_e, np.clip(stiffness, found.lower, found.upper)),
        phi=float(error[sure].max()),
        refused=int(refused.sum()),
        elsewhere=int(elsewhere.sum()),
    )


@pytest.mark.cases(16)
@every_pair
def test_there_and_back_on_the_branch(first: Spring, second: Spring):
    trip = round_trip(first, second, DRAWS)
    assert trip.draws > DRAWS / 4
    # 1e-12 relative, as documented.
    assert trip.residual <= 1e-12
    assert trip.phi <= 1e-10
    assert trip.refused == trip.elsewhere == 0


def loads(rng: np.random.Generator, first: Curve, second: Curve) -> np.ndarray:
    """From what both springs together can carry, and a little beyond, down to next to nothing."""
    ends = [sum(pair) for pair in zip(first.torque_ends, second.torque_ends, strict=True)]
    low, high = np.clip(ends, -2 * LARGEST_TORQUE, 2 * LARGEST_TORQUE) * 1.02
    small = rng.choice([-1, 1], LOADS // 2) * LARGEST_TORQUE * 10 ** rng.uniform(-5, 0, LOADS // 2)
    return np.concatenate((rng.uniform(low, high, LOADS - LOADS // 2), small))


def demands_about(rng: np.random.Generator, end: float) -> np.ndarray:
    """Stiffness within a share of 1e-8 to 1 of an end of the corridor, on either side of it."""
    return end * (1 + rng.choice([-1, 1], 20) * 10 ** rng.uniform(-8, -0.01, 20))


@pytest.mark.cases(25)
@every_pair
def test_every_infeasible_demand_is_flagged_and_no_other(first: Spring, second: Spring):
    rng = np.random.default_rng(5)
    (law_1, curve_1), (law_2, curve_2) = first, second
    for tau_e in loads(rng, curve_1, curve_2).tolist():
        lower, upper = Springs(curve_1, curve_2).corridor(tau_e)
        stiffness = np.concatenate(
            [demands_about(rng, end) for end in (lower, upper) if np.isfinite(end)] or [[1.0]]
        )
        found = laws.make_pair(law_1, law_2).solve(np.full_like(stiffness, tau_e), stiffness)
        feasible = (lower <= stiffness) & (stiffness <= upper)
        np.testing.assert_array_equal(has_flag(reach_flags(stiffness, found), Flag.INFEASIBLE), ~feasible)
        # The scan's cells are a 1e-7 of the load at last, and the stiffness is of second order there; at
        # the end of a four-bar neighboring doubles differ by 1e-10.
        np.testing.assert_allclose(found.lower, lower, rtol=1e-9)
        np.testing.assert_allclose(found.upper, upper, rtol=1e-9)


# Next to the ends


@pytest.mark.cases(25)
@every_pair
def test_solution_next_to_the_end_of_the_corridor(first: Spring, second: Spring):
    (law_1, curve_1), (law_2, curve_2) = first, second
    tau_e = np.repeat(loads(np.random.default_rng(2), curve_1, curve_2), 3)
    lower = laws.make_pair(law_1, law_2).solve(tau_e, np.ones_like(tau_e)).lower
    carried = lower > 0
    tau_e, stiffness = tau_e[carried], (lower * (1 + np.tile([1e-9, 1e-7, 1e-4], LOADS)))[carried]
    found = laws.make_pair(law_1, law_2).solve(tau_e, stiffness)
    within = stiffness <= found.upper
    of_those = found._replace(phi_1=found.phi_1[within], phi_2=found.phi_2[within])
    # Folds and slack alike: where a spring is nearly slack its stiffness is a root of its torque.
    assert residuals((law_1, law_2), of_those, tau_e[within], stiffness[within]) <= 1e-12


@pytest.mark.cases(25)
@every_pair
def test_demand_at_an_end_of_the_corridor_is_met_there(first: Spring, second: Spring):
    (law_1, curve_1), (law_2, curve_2) = first, second
    tau_e = loads(np.random.default_rng(3), curve_1, curve_2)
    pair = laws.make_pair(law_1, law_2)
    ends = pair.solve(tau_e, np.ones_like(tau_e))
    for end in (ends.lower, ends.upper):
        reachable = np.isfinite(end) & (end > 0)
        found = pair.solve(tau_e[reachable], end[reachable])
        sigma = law_1.stiffness(found.phi_1) + law_2.stiffness(found.phi_2)
        # At the end of a four-bar the rounding of the deflection shows, 1e-10.
        np.testing.assert_allclose(sigma, end[reachable], rtol=1e-9)


@pytest.mark.cases(25)
@every_pair
def test_demand_below_the_corridor_is_answered_by_its_lower_end(first: Spring, second: Spring):
    (law_1, curve_1), (law_2, curve_2) = first, second
    tau_e = loads(np.random.default_rng(6), curve_1, curve_2)
    found = laws.make_pair(law_1, law_2).solve(tau_e, np.full_like(tau_e, 1e-9))
    carried = found.lower > 1e-9
    assert carried.any()
    sigma = law_1.stiffness(found.phi_1[carried]) + law_2.stiffness(found.phi_2[carried])
    np.testing.assert_allclose(sigma, found.lower[carried], rtol=1e-9)


@pytest.mark.cases(25)
@every_pair
def test_a_sample_knows_nothing_of_its_neighbors(first: Spring, second: Spring):
    (law_1, curve_1), (law_2, curve_2) = first, second
    pair, tau_e = laws.make_pair(law_1, law_2), loads(np.random.default_rng(4), curve_1, curve_2)
    stiffness = np.linspace(50, 500, tau_e.size)
    whole = pair.solve(tau_e, stiffness)
    for index in range(tau_e.size):
        alone = pair.solve(tau_e[index : index + 1], stiffness[index : index + 1])
        assert [array[index] for array in whole] == pytest.approx(
            [array[0] for array in alone], rel=0, nan_ok=True
        )


@pytest.mark.cases(25)
@every_pair
def test_absurd_demands_are_answered(first: Spring, second: Spring):
    sizes = 10.0 ** np.arange(-20, 101, 40)
    tau_e, stiffness = (axis.ravel() for axis in np.meshgrid(np.concatenate((sizes, [0.0], -sizes)), sizes))
    found = laws.make_pair(first[0], second[0]).solve(tau_e, stiffness)
    carried = ~np.isnan(found.lower)
    assert np.all(np.isfinite([found.phi_1[carried], found.phi_2[carried]]))
    assert np.all(np.isnan([found.phi_1[~carried], found.phi_2[~carried]]))


# The other branch


TWO_SIDED = [
    (name, pair) for name, pair in PAIRS.items() if not any(law.pulls_only for law, _ in pair) and "0" in name
]


@pytest.mark.parametrize(
    ("first", "second"), [pair for _, pair in TWO_SIDED], ids=[name for name, _ in TWO_SIDED]
)
def test_negative_branch_is_the_branch_with_the_sides_exchanged(first: Spring, second: Spring):
    rng = np.random.default_rng(1)
    (law_1, curve_1), (law_2, curve_2) = first, second
    # Torques of opposite signs lie on the branch whatever the laws are.
    phi_1, phi_2 = (sign * np.abs(draw(rng, curve, 50)) for sign, curve in ((-1, curve_1), (1, curve_2)))
    tau_e = curve_1.torque(phi_1) + curve_2.torque(phi_2)
    stiffness = curve_1.stiffness(phi_1) + curve_2.stiffness(phi_2)
    found = springs(law_1, law_2, branch="negative").solve(tau_e, stiffness, tau_e)
    regular = margin(stiffness, found.lower, found.upper) > 1e-3
    # As for the positive branch.
    np.testing.assert_allclose(found.phi_1[regular], phi_1[regular], rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.phi_2[regular], phi_2[regular], rtol=0, atol=1e-10)
    assert not np.any(has_flag(reach_flags(stiffness, found), Flag.INFEASIBLE))


# A measured curve with noise


@dataclass(frozen=True)
class FittedCurve(Curve):
    """A table as it was fitted, whose fit is not in question here."""

    law: laws.SpringLaw = field(kw_only=True)

    def stiffness(self, phi: np.ndarray) -> np.ndarray:
        return self.law.stiffness(phi)


def noisy_table(rng: np.random.Generator) -> tuple[laws.SpringLaw, Curve]:
    """Sixty torques with an error of 0.2 %, which makes the hardening go up and down."""
    deflection = np.linspace(-0.6, 0.6, 61)
    torque = 18 * deflection + 200 * deflection**3 + 500 * deflection**5
    law = measured(deflection, torque * (1 + 2e-3 * rng.uniform(-1, 1, 61)))
    return law, FittedCurve(lambda phi: law.torque(np.asarray(phi, dtype=float)), law.domain, law=law)


@pytest.mark.parametrize("seed", range(4))
def test_branch_of_noisy_tables(seed: int):
    rng = np.random.default_rng(seed)
    (first, curve_1), (second, curve_2) = (noisy_table(rng) for _ in range(2))
    tau_e = rng.uniform(-120, 120, 20)
    found = laws.make_pair(first, second).solve(tau_e, np.full_like(tau_e, 100.0))
    scanned = [Springs(curve_1, curve_2).corridor(load) for load in tau_e.tolist()]
    # As above.
    np.testing.assert_allclose(found.lower, [corridor.lower for corridor in scanned], rtol=1e-9)
    np.testing.assert_allclose(found.upper, [corridor.upper for corridor in scanned], rtol=1e-9)
