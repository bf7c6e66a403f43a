"""Equations of motors: they hold on what inverse dynamics computes, and their slopes are derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from samples.computed_signals import computed_signals
from samples.marks import slow_but

from vsacli.studies.identification.motor_equations import MotorSystem, motor_names, unknowns

RUNS = {
    "vsa_3r": "rest_to_rest",
    "coupled_1r": "coupled_1r",
    "hardening_1r": "hardening_1r",
    "maccepa_1r": "maccepa_1r",
    "mixed_3r": "mixed_3r",
    "puma_560": "puma_560",
    "qbmove_arm_manual": "qbmove_arm",
    "tendon_1r": "tendon_1r",
    **{name: name for name in ("awas_1r", "cam_1r", "shifted_cams_1r")},
}
"""Trajectories by robot: every law and kind of actuator whose numbers stand in the file, and friction."""


@pytest.mark.parametrize(
    "robot", slow_but(("coupled_1r", "maccepa_1r", "mixed_3r", "puma_560", "tendon_1r"), RUNS)
)
def test_equations_of_motors_hold_and_their_slopes_are_derivatives(robot: str) -> None:
    loaded, signals = computed_signals(robot, RUNS[robot])
    for index, joint in enumerate(loaded.joints):
        if not joint.actuator.sprung:
            continue
        chosen = unknowns(loaded, index, ("springs", "motors", "friction"))
        system = MotorSystem(loaded, index, chosen)
        values = system.before
        found = system.of_record(values, signals)
        size = np.max(np.abs(found.measured))
        assert set(found.group) == set(motor_names(loaded, index))
        assert np.max(np.abs(found.predicted - found.measured)) < 1e-9 * size  # rounding of filters
        for place, value in enumerate(values):
            step = 1e-4 * (abs(value) or 1.0)
            ahead, behind = (
                system.of_record(values + sign * step * np.eye(len(values))[place], signals)
                for sign in (1, -1)
            )
            slope = (ahead.predicted - behind.predicted) / (2 * step)
            # third derivatives times 1e-8, and rounding of torques over 1e-4
            assert slope == pytest.approx(
                found.slopes[:, place], abs=1e-6 * np.max(np.abs(slope)) + 1e-11 * size / step
            )
