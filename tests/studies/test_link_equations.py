"""Equations of links: they hold on what inverse dynamics computes, and give back its numbers."""

from __future__ import annotations

import numpy as np
import pytest
from samples.base_parameters import base_parameters
from samples.computed_signals import computed_signals
from samples.marks import slow_but

from vsacli.studies.identification.estimation import least_squares
from vsacli.studies.identification.link_equations import LinkSystem, link_system
from vsacli.studies.identification.motor_equations import FRICTION, MOTORS, SPRINGS, unknowns

RUNS = {
    "coupled_1r": "coupled_1r",
    "maccepa_1r": "maccepa_1r",
    "mixed_3r": "mixed_3r",
    "puma_560": "puma_560",
    "qbmove_arm_manual": "qbmove_arm",
    "rp_2": "rp_2",
    "vsa_3r": "vsa_3r_excitation",
}
"""Trajectories by robot: rigid, elastic, antagonistic and serial drives, a slide, friction of links."""


@pytest.mark.cases(1)
@pytest.mark.parametrize("robot", slow_but(("mixed_3r", "rp_2"), RUNS))
def test_equations_of_links_hold_and_their_slopes_are_derivatives(robot: str) -> None:
    loaded, signals = computed_signals(robot, RUNS[robot])
    system = link_system(loaded, (MOTORS, FRICTION))
    found = system.of_record(system.before, signals)
    assert set(found.group) == {f"link of {joint.name}" for joint in loaded.joints}
    assert found.predicted == pytest.approx(found.measured, abs=1e-12 * np.abs(found.measured).max())
    for place in range(system.bodies, len(system.names)):
        step = 0.1 * system.before[place] or 1.0  # they are linear, so that it may be large
        other = system.of_record(system.before + step * np.eye(len(system.before))[place], signals)
        slope = (other.predicted - found.predicted) / step
        size = np.abs(found.predicted).max() / step
        assert slope == pytest.approx(found.slopes[:, place], abs=1e-11 * size)  # rounding


def test_a_periodic_excitation_tells_all_base_parameters_of_the_papers_arm() -> None:
    robot, signals = computed_signals("vsa_3r", "vsa_3r_excitation")
    system = link_system(robot, ())
    elsewhere = system.before + 0.1
    found = system.of_record(system.before, signals)
    fit = least_squares([found._replace(predicted=found.slopes @ elsewhere)], elsewhere)
    assert not fit.inseparable
    assert fit.values == pytest.approx(system.before, abs=1e-9)  # condition 33


@pytest.mark.slow
def test_what_springs_carry_changes_with_their_numbers() -> None:
    robot, signals = computed_signals("vsa_3r", "vsa_3r_excitation")
    base = base_parameters(robot)
    given = [each for index in range(3) for each in unknowns(robot, index, (SPRINGS,))]
    errors = np.diag(np.arange(1.0, len(given) + 1))
    system = LinkSystem(robot, base, (), given, errors)
    slopes = system.of_record(system.before, signals).errors
    assert slopes is not None
    for place, each in enumerate(given):
        step = 1e-3 * each.value
        moved = (robot.replace(str(each), each.value + sign * step) for sign in (1, -1))
        ahead, behind = (
            LinkSystem(one, base, ()).of_record(system.before, signals).measured for one in moved
        )
        assert (ahead - behind) / (2 * step) == pytest.approx(
            slopes[:, place] / (place + 1), rel=1e-9, abs=1e-12
        )


def test_a_motion_from_rest_to_rest_leaves_combinations() -> None:
    robot, signals = computed_signals("vsa_3r", "rest_to_rest")
    system = link_system(robot, ())
    fit = least_squares([system.of_record(system.before, signals)], system.before)
    words = [each.words(system.names) for each in fit.inseparable]
    assert any("elbow.Iyz" in each and "elbow.Izz*" in each for each in words)
