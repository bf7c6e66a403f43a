"""Mechanisms of one's own: their potential, their branch, and what is refused when a file is read."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from oracles import potential_scan
from samples.marks import slow_but

from vsacli import Flag, InputError, inverse_dynamics, laws, load_robot, load_trajectory, mechanisms
from vsacli.actuators.reach import reach_flags

ROBOT = """
format: vsacli-robot/1
name: own
joints:
  - name: elbow
    type: revolute
    dh: {{a: 0.3, alpha: 0, d: 0, theta: 0}}
    link: {{mass: 1, com: [0, 0, 0], inertia: {{xx: 0.01, yy: 0.01, zz: 0.01, xy: 0, xz: 0, yz: 0}}}}
    actuator:
      type: serial
      motor: {{inertia: 0.1}}
      mechanism: {{type: potential, constants: {{k: 5e4, r: 0.5 deg}}, start: {{theta_1: 0, theta_2: 8}},
        energy: "{}",
        range: {{phi: 0.8, theta_2: [5, 12]}}}}
"""

AWAS = mechanisms.Potential(
    energy="k*(r*theta_2)^2*sin(theta_1 - q)^2",
    constants=(("k", 50000.0), ("r", 0.01)),
    start=mechanisms.BranchStart(theta_1=0, theta_2=8),
    range=mechanisms.PotentialRange(phi=(-0.9, 0.9), theta_2=(5, 12)),
)
MACCEPA = mechanisms.Potential(
    energy="k/2*(sqrt(B^2 + C^2 - 2*B*C*cos(phi)) - (C - B) + r*theta_2)^2",
    constants=(("k", 394.0), ("B", 0.036), ("C", 0.135), ("r", 0.015)),
    start=mechanisms.BranchStart(theta_1=0.05, theta_2=3),
    range=mechanisms.PotentialRange(phi=(-3.1, 3.1), theta_2=(0, 6)),
)
TWO_SPRINGS = mechanisms.Potential(
    energy="k/2*((theta_1 - q)^2 + (theta_2 - q)^2) + k_c/4*((theta_1 - q)^4 + (theta_2 - q)^4)",
    constants=(("k", 400.0), ("k_c", 2000.0)),
    start=mechanisms.BranchStart(theta_1=0.2, theta_2=-0.2),
    range=mechanisms.PotentialRange(phi=(-2, 2), theta_2=(-9, 9)),
)
BOWED = mechanisms.Potential(
    energy="k/2*(r*theta_2)^2*(phi - bow*sin(2*q))^2 + k_c*phi^4/(1 + theta_2/5)",
    constants=(("k", 50000.0), ("k_c", 500.0), ("r", 0.01), ("bow", 0.1)),
    start=mechanisms.BranchStart(theta_1=0, theta_2=10),
    range=mechanisms.PotentialRange(phi=(-0.8, 0.8), theta_2=(4, 20)),
)
WAVY = mechanisms.Potential(
    energy="a*phi^2*(2 + sin(theta_2))*(1 + c*phi^2) + b*phi*sin(3*theta_2)",
    constants=(("a", 5.0), ("b", 0.6), ("c", 1.5)),
    start=mechanisms.BranchStart(theta_1=0.1, theta_2=0.3),
    range=mechanisms.PotentialRange(phi=(-1, 1), theta_2=(-3, 3)),
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


def awas(demand: Demand) -> laws.PairSolution:
    tau_e, stiffness, q = demand.arrays
    return mechanisms.Awas(k=50000, arm=(0.05, 0.12), lead=0.01).solve(tau_e, stiffness, q)


def maccepa(demand: Demand) -> laws.PairSolution:
    tau_e, stiffness, q = demand.arrays
    return mechanisms.Maccepa(k=394, b=0.036, c=0.135, r=0.015, pretension=(0, 0.09)).solve(
        tau_e, stiffness, q
    )


def two_springs(demand: Demand) -> laws.PairSolution:
    tau_e, stiffness, q = demand.arrays
    solution = laws.make_pair(*(laws.Cubic(k=400, k_c=2000),) * 2).solve(tau_e, stiffness)
    return solution._replace(phi_2=solution.phi_2 + q)


BUILT_IN = {
    "awas": (AWAS, awas, Demand(800, (5, 1500))),
    "maccepa": (MACCEPA, maccepa, Demand(2, (0.02, 5))),
    "two springs": (TWO_SPRINGS, two_springs, Demand(300, (700, 3000))),
}


@pytest.mark.parametrize("name", slow_but({"awas", "two springs"}, BUILT_IN))
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


@pytest.mark.cases(1)
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


def random_potential(number: int) -> mechanisms.Potential:
    """Level curves that wind and fold, and a start somewhere on them."""
    draw = np.random.default_rng(number).uniform
    constants = tuple((f"c{index}", float(each)) for index, each in enumerate(draw(-1, 1, 8)))
    energy = (
        "10*(2 + c0*sin(2*theta_2) + c1*cos(theta_2))*phi^2*(1 + c2*phi + 2*c3*phi^2)"
        "+ 3*c4*phi*sin(2*theta_2 + c5) + 2*c6*sin(3*phi + theta_2) + c7*exp(phi*theta_2)"
    )
    for _ in range(20):
        try:
            return mechanisms.Potential(
                energy=energy,
                constants=constants,
                start=mechanisms.BranchStart(theta_1=float(draw(-0.6, 0.6)), theta_2=float(draw(-1.5, 1.5))),
                range=mechanisms.PotentialRange(phi=(-1, 1), theta_2=(-2, 2)),
            )
        except InputError:
            continue
    raise AssertionError("no state of this potential can be the start")


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("number", range(3))
def test_no_corridor_reaches_beyond_its_branch(number: int) -> None:
    """Where a torque has several pieces on the branch it is one of them."""
    potential = random_potential(number)
    oracle = potential_scan.Potential(potential.energy, dict(potential.constants))
    scan = potential_scan.Scan(oracle, 0.0, potential.range.phi, potential.range.theta_2, nodes=400)
    branch = scan.branch(potential.start.theta_1, potential.start.theta_2)
    carried = scan.point.tau_e[branch]
    torques = np.random.default_rng(number).uniform(carried.min(), carried.max(), 60)
    solution = potential.solve(torques, np.ones(60), np.zeros(60))
    reached = np.isfinite(solution.lower)
    assert reached.sum() > 20
    for index in np.flatnonzero(reached):
        stiffness, resolution = scan.reached(torques[index], branch)
        if stiffness.size:
            assert solution.lower[index] >= stiffness.min() - 3 * resolution[stiffness.argmin()]
            assert solution.upper[index] <= stiffness.max() + 3 * resolution[stiffness.argmax()]
        for end, critical in (
            (solution.lower, solution.lower_critical),
            (solution.upper, solution.upper_critical),
        ):
            assert (
                critical[index]
                or end[index] == 0
                or at_an_end_of_a_range(potential, torques[index], end[index])
            )


def at_an_end_of_a_range(potential: mechanisms.Potential, torque: float, stiffness: float) -> bool:
    """Whether the branch has this stiffness where phi or theta_2 is at an end of its range."""
    found = potential.solve(np.array([torque]), np.array([stiffness]), np.zeros(1))
    ends = zip((found.phi_1[0], found.phi_2[0]), (potential.range.phi, potential.range.theta_2), strict=True)
    return any(min(abs(at - low), abs(high - at)) < 1e-9 * (high - low) for at, (low, high) in ends)


def test_a_sample_is_solved_as_if_it_were_alone() -> None:
    demand = Demand(2, (0.02, 5), samples=60)
    together = MACCEPA.solve(*demand.arrays)
    for part in (slice(0, 1), slice(17, 30)):
        alone = MACCEPA.solve(*(array[part] for array in demand.arrays))
        for mine, theirs in zip(alone, together, strict=True):
            np.testing.assert_array_equal(mine, theirs[part])


@pytest.mark.slow
def test_the_last_torques_are_kept_and_no_others() -> None:
    tau_e, stiffness, q = Demand(2, (0.02, 5), samples=50).arrays
    fresh = [replace(MACCEPA).solve(torques, stiffness, q) for torques in (tau_e, -tau_e)]
    shared = replace(MACCEPA)
    changed = tau_e.copy()
    first = shared.solve(changed, stiffness, q)
    changed *= -1
    for found, expected in zip((first, shared.solve(changed, stiffness, q)), fresh, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_equal_potentials_are_one_mechanism() -> None:
    assert replace(AWAS) == AWAS
    assert hash(replace(AWAS)) == hash(AWAS)
    assert replace(AWAS, constants=(("k", 50000.0), ("r", 0.02))) != AWAS


REFUSED = {
    "a mistyped word": (
        {"energy": "k*(r*thta_2)^2*sin(phi)^2"},
        "energy: unknown word 'thta_2' at character 6; did you mean 'theta_2'?",
    ),
    "no closing parenthesis": (
        {"energy": "k*(r*theta_2)^2*sin(phi"},
        "energy: expected an operator or ), found the end at character 24",
    ),
    "nested without end": ({"energy": "(" * 500}, "energy: nested deeper than 200 levels at character 201"),
    "endless": ({"energy": "k+r+" * 1000}, "energy: longer than 2000 characters"),
    "an idle constant": (
        {"constants": (("k", 5.0), ("r", 0.01), ("b", 1.0))},
        "constants.b: does not occur in the energy",
    ),
    "a constant called q": (
        {"constants": (("k", 5.0), ("r", 0.01), ("q", 1.0))},
        "constants.q: has a meaning of its own in the energy; choose another name",
    ),
    "a constant that is no word": (
        {"constants": (("k", 5.0), ("r", 0.01), ("b-c", 1.0))},
        "constants.b-c: is not a name: expected letters, digits and _, beginning with a letter or _",
    ),
    "an infinite constant": ({"constants": (("k", math.inf), ("r", 0.01))}, "constants.k: must be finite"),
    "no second motor": ({"energy": "k*r*phi^2"}, "energy: does not depend on theta_2"),
    "no link": ({"energy": "k*r*theta_1*theta_2"}, "energy: does not depend on q"),
    "a range without width": (
        {"range": mechanisms.PotentialRange(phi=(0, 0), theta_2=(5, 12))},
        "range.phi: must have two finite ends, the lower one first",
    ),
    "a start outside": (
        {"start": mechanisms.BranchStart(theta_1=0, theta_2=13)},
        "start.theta_2: must lie within the range of theta_2, 5 to 12, not at 13",
    ),
    "a negative stiffness": (
        {"energy": "-k*(r*theta_2)^2*phi^2"},
        "start: the stiffness, the second derivative over q, must be positive here, not -640; choose",
    ),
    "a constant stiffness": (
        {"energy": "k*phi^2 + r*theta_2*phi"},
        "start: the matrix A is singular here: motors that keep the torque cannot change the stiffness; ",
    ),
    "a kink at the start": (
        {"energy": "k*r*theta_2^2*(phi^2)^1.5"},
        "start: the energy or one of its first four derivatives is not finite here; choose",
    ),
    "a division by zero": (
        {"energy": "k*(r*theta_2)^2*phi^2/0"},
        "start: the energy or one of its first four derivatives is not finite here; choose",
    ),
    "a root of a negative number": (
        {"energy": "(-2)^0.5*k*(r*theta_2)^2*phi^2"},
        "start: the energy or one of its first four derivatives is not finite here; choose",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_and_why(case: str) -> None:
    changes, message = REFUSED[case]
    with pytest.raises(InputError) as refused:
        replace(AWAS, **changes)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("k*(r*thta_2)^2*phi^2", "13: mechanism: energy: unknown word 'thta_2' at character 6; did you mean"),
        ("k*(r*theta_2)^2*phi^", "13: mechanism: energy: expected a number, a word or (, found the end"),
    ],
)
def test_messages_say_file_and_line(written: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(ROBOT.format(written))
    with pytest.raises(InputError) as refused:
        load_robot(tmp_path / "own.yaml")
    assert f"own.yaml:{message}" in str(refused.value)


def test_constants_may_be_expressions_and_angles(tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(ROBOT.format("k*(r*theta_2)^2*phi^2"))
    mechanism = load_robot(tmp_path / "own.yaml").joints[0].actuator.mechanism
    assert mechanism.constants == (("k", 50000.0), ("r", math.radians(0.5)))
    changed = load_robot(tmp_path / "own.yaml").replace(
        "joints.0.actuator.mechanism.constants", {"k": 40000, "r": 0.01}
    )
    assert changed.joints[0].actuator.mechanism.constants == (("k", 40000.0), ("r", 0.01))


def test_a_run_without_a_single_feasible_step_says_so(tmp_path: Path) -> None:
    robot, trajectory = tmp_path / "robot.yaml", tmp_path / "trajectory.yaml"
    robot.write_text(ROBOT.format("k/2*(r*theta_2)^2*sin(phi)^2"))
    trajectory.write_text(
        "format: vsacli-trajectory/1\nname: too-stiff\nduration: 1\nrate: 10\n"
        "position: {type: constant, value: 0}\nstiffness: {type: constant, value: 1e5}\n"
    )
    own = load_robot(robot)
    result = inverse_dynamics(own, load_trajectory(trajectory, own))
    assert (result.flags == Flag.INFEASIBLE).all()
    assert np.isnan(result.tau_motor).all()


@pytest.mark.parametrize(
    ("energy", "warning"),
    [
        ("k*(r*theta_2)^2*phi^2*log(theta_2-6)", r"not finite at phi = .*, theta_2 = 5\.\d+; narrow"),
        ("k*(r*theta_2)^2*phi^2 + sqrt(theta_2-7.5)", r"not finite at phi = .*, theta_2 = 7\.\d+; n"),
        (
            "k*(r*theta_2)^2*phi^2/(theta_2-6)",
            r"not finite at phi = 0, theta_2 = 6, where",
        ),
    ],
)
def test_gaps_and_poles_of_the_energy_are_told_with_their_place(tmp_path, energy, warning):
    (tmp_path / "own.yaml").write_text(ROBOT.format(energy))
    (told,) = load_robot(tmp_path / "own.yaml").joints[0].actuator.warnings
    assert re.search(warning, told), told


@pytest.mark.parametrize("potential", [AWAS, MACCEPA, TWO_SPRINGS])
def test_energies_that_hold_have_no_warning(potential):
    assert potential.warnings == ()


def test_constants_are_not_called_unused_where_the_energy_lacks_something(tmp_path):
    (tmp_path / "own.yaml").write_text(ROBOT.format("k*sin(phi)^2"))
    with pytest.raises(InputError) as raised:
        load_robot(tmp_path / "own.yaml")
    (problem,) = raised.value.problems
    assert problem.message.endswith("energy: does not depend on theta_2")
