"""Motor torques along records with noise of many colors: right, or unreliable."""

import numpy as np
import pytest
from samples.noisy_records import COLORS, MOTIONS, record
from samples.recorded_torques import ARMS, outcomes

from vsacli import Trajectory, simulate

RATE = 250

QUICK = "12 bits, zero-phase 20 Hz"
"""The color that is tried at every run of the tests."""


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("color", COLORS)
def test_torques_from_rest_to_rest_are_right_and_as_uncertain_as_stated(color):
    covered = []
    for seed in (20, 21, 22):
        for each in outcomes("rest to rest, pauses", color, seed, RATE):
            if each.arm == "softest":  # its torque is d4q, of which a record says no more than it can
                assert each.verdict == "unreliable" or each.torque.size < 0.1, each
            else:  # of 36 records errors were up to 1.4 %; of other draws than the first some are unreliable
                assert each.verdict == "ok" or seed > 20, each
                assert each.torque.size < 0.02, each
            covered += [] if np.isnan(each.torque.covered) else [each.torque.covered]
    # errors of one record go together: of single ones 0.82 to 1; of a color 0.935 to 0.975 were seen
    assert not covered or 0.9 < np.mean(covered) < 0.99


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("color", COLORS)
def test_torques_of_steps_of_velocity_are_right_or_unreliable(color):
    for each in outcomes("velocity steps, 50 ms", color, 20, RATE):
        assert each.verdict == "unreliable" or each.torque.size < 0.1, each
        if each.arm == "elastic":
            assert each.verdict == "unreliable"


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("color", COLORS)
def test_torques_of_minimum_jerk_are_right_or_unreliable(color):
    for each in outcomes("minimum jerk", color, 20, RATE):
        assert each.verdict == "unreliable" or each.torque.size < 0.1, each


@pytest.mark.slow
def test_a_simulation_along_an_unreliable_record_says_so():
    of = record(MOTIONS["velocity steps, 50 ms"], QUICK, 20, RATE)
    trajectory = Trajectory.from_samples(of.time, of.values[:, None])
    warnings = simulate(ARMS["elastic"], trajectory).report.warnings
    assert any(each.startswith("elbow: tau_motor is not determined by the recording: ") for each in warnings)
