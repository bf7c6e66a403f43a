"""Every term of the actuators, friction, dampers and windings that is 1 % off fails the self-check."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from samples.marks import needs_compiler, slow_but
from samples.term_mutations import MUTATIONS, Mutation, mutated_run
from samples.valid_runs import valid_run

from vsacli import inverse_dynamics
from vsacli.analysis.self_check import LADDER_BOUND, SHAFT_BOUND, SelfCheck
from vsacli.compute.engine.compiled_engine import kernel_code

THEORY = Path(__file__).parents[2] / "docs" / "theory.md"

QUICK = [each for each in MUTATIONS if each.term in ("B_12 theta_k''", "D_m,k theta_k' (73)-(74)")]

COMPILED = [
    each
    for each in MUTATIONS
    if each.term in ("B_12 theta_k''", "motor friction, sign", "voltage, R i", "sigma q'' in (70)")
]

STIFF = 2014
"""Seed of a valid run with a potential of 1e8 N m/rad."""


def answer(check: SelfCheck) -> str:
    """By which parts of the self-check a run fails."""
    parts = {
        "springs": check.spring_residual <= check.spring_bound,
        "shafts": check.shaft_residual <= SHAFT_BOUND,
        "derivatives": check.ladder <= check.ladder_bound,
    }
    return ", ".join(name for name, passed in parts.items() if not passed)


@pytest.mark.parametrize("run", ["pair", "serial", "spring", "damped"])
def test_the_runs_pass_as_they_are(run: str) -> None:
    assert inverse_dynamics(*mutated_run(run)).report.verdict == "ok"


def fails(mutation: Mutation, monkeypatch: pytest.MonkeyPatch, engine: str = "numpy") -> str:
    """The answer to a mutation."""
    robot, trajectory = mutated_run(mutation.run)
    mutation.apply(monkeypatch)
    kernel_code.cache_clear()  # equal kernels are recorded once, and tests before recorded the right code
    report = inverse_dynamics(robot, trajectory, engine=engine).report
    kernel_code.cache_clear()
    assert report.verdict == "self_check_failed"
    return answer(report.self_check)


def terms_noticed_by(parts: str) -> list[str]:
    """The terms in the row of the page for these parts of the self-check."""
    row = re.search(rf"^\| {parts} \| (.*) \|$", THEORY.read_text(encoding="utf-8"), re.MULTILINE)
    return row[1].split("; ") if row else []


@pytest.mark.cases(12)
@pytest.mark.parametrize("mutation", slow_but(QUICK, MUTATIONS), ids=lambda each: each.term)
def test_a_wrong_term_fails(mutation: Mutation, monkeypatch: pytest.MonkeyPatch) -> None:
    assert mutation.term in terms_noticed_by(fails(mutation, monkeypatch))


@needs_compiler
@pytest.mark.parametrize("mutation", slow_but([], COMPILED), ids=lambda each: each.term)
def test_a_wrong_term_fails_in_compiled_code(mutation: Mutation, monkeypatch: pytest.MonkeyPatch) -> None:
    assert mutation.term in terms_noticed_by(fails(mutation, monkeypatch, "c"))


@pytest.mark.slow
@pytest.mark.cases(4)
@pytest.mark.parametrize("seed", range(60))
def test_a_valid_run_is_not_refused(seed: int) -> None:
    """Infeasible steps are possible where a mechanism cannot carry its load."""
    check = inverse_dynamics(*valid_run(seed)).report.self_check
    assert check.passed
    # The noise of the stiffest formulas is 1e-6; it must leave room to notice 1 %.
    assert check.ladder_bound < 1e-2


@pytest.mark.slow
def test_the_noise_of_stiff_springs_hides_no_wrong_term(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a potential of 1e8 N m/rad that computes its deflection as a difference."""
    robot, trajectory = valid_run(STIFF)
    check = inverse_dynamics(robot, trajectory).report.self_check
    assert check.passed
    assert check.ladder > LADDER_BOUND  # which it exceeds without cause
    rates = "actuators.mechanisms.potentials.potential_energy:PotentialState.rates"
    Mutation("tau_e'", "", rates, "dtau_e + u", "1.01 * dtau_e + u").apply(monkeypatch)
    assert not inverse_dynamics(robot, trajectory).report.self_check.passed
