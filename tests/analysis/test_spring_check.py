"""Residuals of (14): at every step by the program, and apart from it, which may be wrong itself."""

from __future__ import annotations

import numpy as np
import pytest
from samples.shipped import shipped_run
from samples.spoiled import spoil_drive

from vsacli import inverse_dynamics
from vsacli.analysis.run_dynamics import RunDynamics
from vsacli.analysis.self_check import RunCheck
from vsacli.dynamics.variants import Variants

RUN = "vsa_3r", "rest_to_rest"


@pytest.mark.parametrize("first", [0, 1234, 3980])
def test_a_program_that_is_wrong_in_a_stretch_is_found_apart_from_it(first: int):
    """A 199th of the 4001 steps, which are in one block, without a trace in the residuals of the program."""
    robot, trajectory = shipped_run(*RUN)
    dynamics = RunDynamics(Variants.of_one(robot), [trajectory])
    check, block = RunCheck(dynamics), dynamics.compute(trajectory.block(0, trajectory.samples))
    block.phi[first : first + 21] += 1e-9
    check.add(block)
    (outcome,) = check.outcomes()
    assert outcome.spring_residual > 1e-11
    assert not outcome.passed


def test_the_residual_of_every_step_counts(monkeypatch):
    """Also of one that is not among those whose laws are evaluated apart."""

    def shift_one_sample(phi: np.ndarray) -> np.ndarray:
        return phi + 1e-9 * (np.arange(phi.shape[1]) == phi.shape[1] // 3 + 1)

    spoil_drive(monkeypatch, "phi", shift_one_sample)
    assert inverse_dynamics(*shipped_run(*RUN)).report.self_check.spring_residual > 1e-11
