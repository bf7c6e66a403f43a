"""Roots of variable ratios in single precision: they stop where rounding begins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from samples.mechanisms import DEVICES

from vsacli import mechanisms
from vsacli.actuators.mechanisms.ratios.scales import MAX_STEPS, increasing_root
from vsacli.compute.tracing import Kind, trace
from vsacli.compute.tracing.single_precision import run_in_single_precision

SAMPLES = 500


def solved(mechanism: mechanisms.VariableRatio, ratio: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The deflections with some g/g', and how many steps each of them takes."""
    low, high = np.zeros(SAMPLES), np.full(SAMPLES, mechanism._limits[1].phi)
    program = trace(
        lambda rows: [increasing_root(mechanism._torque_over_stiffness, *rows, (rows[2],))],
        [Kind.REAL] * 3,
    )
    body = next(symbol.operands[0] for symbol in program.operations if symbol.operation == "loop").body
    start: Any = np.where(ratio < high, ratio, high / 2)
    state, steps, going = [start, low, high], np.zeros(SAMPLES), np.ones(SAMPLES, dtype=bool)
    for _ in range(MAX_STEPS):
        *following, done = run_in_single_precision(body, [*state, ratio])
        state = [np.where(going, *pair) for pair in zip(following, state, strict=True)]
        steps += going
        going &= ~done
    np.testing.assert_array_equal(state[0], run_in_single_precision(program, [low, high, ratio])[0])
    return state[0], steps


@pytest.mark.parametrize("name", ["variable_ratio, torque that turns", "variable_ratio, four bar"])
def test_steps_end_at_the_rounding_of_single_precision(name: str) -> None:
    """With the tolerances of double precision they took 15 on average, to find the same."""
    mechanism = DEVICES[name].mechanism
    assert isinstance(mechanism, mechanisms.VariableRatio)
    short = 10 ** np.random.default_rng(0).uniform(-8, 0, SAMPLES)  # of the fold, in parts of its deflection
    phi = mechanism._limits[1].phi * (1 - short)
    state = mechanism.torque.state(phi)
    found, steps = solved(mechanism, state.tau / state.sigma)
    assert steps.mean() < 11
    # A deflection that is 1e-8 short of a fold differs from it by the root of a rounding, times the bend.
    np.testing.assert_allclose(found, phi, rtol=1e-3)
