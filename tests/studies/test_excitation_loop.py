"""From a plan to the numbers found: planned, moved in a simulation, recorded with noise, identified."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import Outcome
from samples.excitations import shorten_searches
from samples.robot_files import write_robot
from samples.shipped import shipped_robot

from vsacli import identify, plan_excitation
from vsacli.robot.parameters import parameters
from vsacli.studies.identification.excitation import Noise
from vsacli.studies.identification.excitation.fisher import executed, noisy_record
from vsacli.studies.identification.identification import WORDS, solutions
from vsacli.studies.identification.identification_report import numbers_of
from vsacli.studies.identification.motor_equations import with_friction

POSITION_NOISE, TORQUE_SHARE = 2e-5, 0.003
"""Rad (m), and over the largest torque of a case, below."""

UNLIKE = {
    "joints.arm.actuator.spring": [
        {"type": "cubic", "k": 380, "k_c": 2300},
        {"type": "cubic", "k": 450, "k_c": 1800},
    ],
    "joints.*.actuator.motor.friction": {"coulomb": 0.5, "width": 0.02},
}

CASES: Mapping[str, tuple[str, Mapping[str, Any], Mapping[str, float], float]] = {
    "3R": ("vsa_3r", {}, {"joints.*.actuator.spring.k": 380, "joints.*.actuator.motor.inertia": 3.0}, 170),
    "RP": (
        "rp_2",
        {},
        {"joints.arm.actuator.spring.k_c": 2100, "joints.slide.actuator.motor.inertia": 12.5},
        170,
    ),
    "unlike springs, friction": (
        "rp_2",
        UNLIKE,
        {"joints.arm.actuator.spring.0.k": 400, "joints.arm.actuator.spring.1.k_c": 1900},
        170,
    ),
    "serial": ("awas_1r", {}, {"joints.elbow.actuator.motor.0.inertia": 0.33}, 14),
}
"""Robot; what its file says otherwise; the truth where it is otherwise; about the largest torque, N m (N)."""

WITHIN = 0.01
"""Of springs and inertias of motors; three hundred times the standard errors of most of them."""

LOOSE = ("damping", "friction", "mechanism", "coupled_inertia")
"""Words of paths to numbers that are small, or of which springs tell products alone."""


@pytest.fixture(autouse=True)
def _short_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_searches(monkeypatch, steps=40)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_what_is_planned_moved_and_recorded_tells_springs_and_motors(
    case: str, vsacli: Callable[..., Outcome]
) -> None:
    name, changes, truth, torque = CASES[case]
    known = shipped_robot(name).replace(changes)
    write_robot(known, Path("robot.yaml"))
    write_robot(known.replace(truth), Path("true.yaml"))
    noise = f"{POSITION_NOISE},{TORQUE_SHARE * torque}"
    for line in (
        f"identify --plan robot.yaml --duration 6 --sensor-noise {noise} -o excitation.yaml",
        f"simulate true.yaml excitation.yaml --set rate=250 --controller feedback-linearization "
        f"--sensor-noise {noise} -o moved.h5",
        "export moved.h5 --variables q_measured,theta_measured,tau_motor_measured -o record.csv",
    ):
        done = vsacli(*line.split())
        assert done.code == 0, done.err
    found = identify(known, "record.csv", fit=["springs", "motors", "friction"])
    actual = {str(each): each.value for each in parameters(known.replace(truth))}
    for number in found.numbers:
        if not any(word in number.path for word in LOOSE):
            assert number.value == pytest.approx(actual[number.path], rel=WITHIN), number.path


SEEDS = 20


@pytest.mark.exhaustive
@pytest.mark.slow
def test_numbers_scatter_by_what_was_predicted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty records with noise of their own. Numbers that are held at zero half of the time do not count."""
    shorten_searches(monkeypatch, steps=40, records=3)
    robot, noise, random = shipped_robot("rp_2"), Noise(2e-5, 0.5), np.random.default_rng(1)
    planned = plan_excitation(robot, duration=8, noise=noise)
    joints, block = range(len(robot.joints)), executed(robot, planned.trajectory)
    sought = with_friction(robot, joints)
    values = []
    for _ in range(SEEDS):
        record = noisy_record(robot, block, noise, random)
        systems = solutions(sought, joints, WORDS, [record])
        values.append([number.value for system in systems for number in numbers_of(system)])
    free = [not any(word in each.path for word in ("damping", "coulomb")) for each in planned.planned.numbers]
    scatter = np.std(values, axis=0, ddof=1)[free]
    predicted = np.array([each.standard_error for each in planned.planned.numbers])[free]
    ratios = scatter / predicted
    assert np.sqrt(np.mean(ratios**2)) == pytest.approx(1, abs=0.3)
    assert ratios.max() < 2.2  # of one number in twenty draws the deviation itself is uncertain by 16 %
