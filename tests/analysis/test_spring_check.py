"""Residuals of (14): at every step by the program, and apart from it, which may be wrong itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from samples.shipped import shipped_run

from vsacli import inverse_dynamics
from vsacli.actuators.transmission import JointVariables
from vsacli.analysis.self_check import LADDER_BOUND
from vsacli.base.arrays import FloatArray
from vsacli.compute.engine import NUMPY, ChosenEngine, Kernel
from vsacli.dynamics.balances import BalancedDynamics
from vsacli.dynamics.drive import drive

RUN = "vsa_3r", "rest_to_rest"


class Faulty:
    """An engine whose deflections are wrong in a stretch of steps, but not the residuals that it finds."""

    def __init__(self, first: int, count: int) -> None:
        self._first, self._stop = first, first + count

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        found = NUMPY.run(kernel, rows)
        if isinstance(kernel, BalancedDynamics):
            kernel.results.arrays(found)["phi"][..., self._first : self._stop] += 1e-9
        return found


@pytest.mark.parametrize("first", [0, 1234, 3980])
def test_a_program_that_is_wrong_in_a_stretch_is_found_apart_from_it(first: int, monkeypatch):
    """A 199th of the 4001 steps, which are in one block; finite differences do not show it."""
    choice = ChosenEngine(Faulty(first, 21), "a fault")
    monkeypatch.setattr("vsacli.analysis.batch.choose_engine", lambda *_, **_keywords: choice)
    monkeypatch.setattr(
        "vsacli.analysis.self_check.ladder", lambda _: (np.zeros(1), np.full(1, LADDER_BOUND))
    )
    check = inverse_dynamics(*shipped_run(*RUN)).report.self_check
    assert check.spring_residual > 1e-11
    assert not check.passed


def test_the_residual_of_every_step_counts(monkeypatch):
    """Also of one that is not among those whose laws are evaluated apart."""

    def spoiled(joint, *arguments) -> JointVariables:
        driven = drive(joint, *arguments)
        phi = driven.phi.copy()
        phi[:, phi.shape[1] // 3 + 1 :: 10**6] += 1e-9
        return driven._replace(phi=phi)

    monkeypatch.setattr("vsacli.dynamics.inverse.drive", spoiled)
    assert inverse_dynamics(*shipped_run(*RUN)).report.self_check.spring_residual > 1e-11
