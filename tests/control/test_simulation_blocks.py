"""A simulation in blocks: equal to the last bit for any division, in memory that does not grow."""

from __future__ import annotations

import tracemalloc
from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from samples.marks import slow_but
from samples.robots import vsa_3r
from samples.simulated import short_motion

from vsacli import Gains, InitialError, InputError, Sensors, perturbed, simulate
from vsacli.control.simulation import SimulationRun, history, sensors

GAINS = Gains.from_poles([-20] * 4, [-20] * 2)
FAST = Gains.from_poles([-200] * 4, [-200] * 2)

CASES = {
    "feedforward": {},
    "off target": {"model": perturbed(vsa_3r(), 0.3, seed=1)},
    "linearized": {"gains": GAINS, "initial_error": InitialError(0.02, 20)},
    "measured": {"gains": GAINS, "feedback": "positions", "sensors": Sensors(2e-5, 0.5, 14)},
    "sensors alone": {"sensors": Sensors(2e-5, 0.5)},
    "another method": {"gains": FAST, "budget": 2000},
    "budget used up": {"gains": FAST, "budget": 800},
    "budget for nothing": {"gains": FAST, "budget": 1},
}


@pytest.fixture
def divide(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Set the samples of a block; their noise is drawn for some fewer at a time."""

    def into(samples: int) -> None:
        for module, name, size in (
            (history, "BLOCK_SAMPLES", samples),
            (sensors, "NOISE_BLOCK", samples - 2),
        ):
            monkeypatch.setattr(module, name, size)

    return into


@pytest.mark.parametrize("case", slow_but({"feedforward", "budget for nothing"}, CASES))
def test_results_do_not_depend_on_the_division_into_blocks(divide, case):
    conditions = CASES[case]
    whole = simulate(vsa_3r(), short_motion(3), engine="numpy", **conditions)
    divide(7)
    run = SimulationRun(vsa_3r(), short_motion(3), engine="numpy", **conditions)
    blocks = list(run)
    assert len(blocks) == len(whole.history.time) == 1 or len(blocks) >= 5
    assert run.report().as_json() == whole.report.as_json()
    for name, values in whole.history.arrays().items():
        divided = np.concatenate([block.arrays()[name] for block in blocks])
        np.testing.assert_array_equal(divided, values, err_msg=name)


def test_an_early_end_is_in_the_last_block_alone(divide):
    divide(7)
    stiff = short_motion(3, stiffness=(1100, 200))  # below what the load allows, from a time on
    run = SimulationRun(vsa_3r(), stiff, engine="numpy")
    *others, last = list(run)
    assert run.report().verdict == "infeasible"
    assert last.flags[-1].any()
    assert not any(block.flags.any() for block in others)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_duration(divide):
    divide(512)

    def peak(duration: float) -> int:
        motion = short_motion(3, duration=duration, rate=4000)
        run = SimulationRun(vsa_3r(), motion, engine="numpy")
        tracemalloc.start()
        try:
            deque(run, maxlen=0)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(0.05)  # what is loaded once
    short, long = peak(0.2), peak(0.6)
    stored = 3.6e3  # bytes of a sample of this robot
    assert long - short < 0.02 * stored * 0.4 * 4000


def test_a_wrong_condition_is_found_before_the_first_block():
    with pytest.raises(InputError, match="budget must be at least 1"):
        SimulationRun(vsa_3r(), short_motion(3), budget=0)
