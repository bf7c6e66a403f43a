"""Fixes are confirmed by runs: each once, and those that fell short again after another search."""

from __future__ import annotations

from dataclasses import replace

import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli import fixes, inverse_dynamics, load_robot, load_trajectory
from vsacli.studies.search import Fix, fix_search
from vsacli.studies.search.fix_report import in_order


def test_every_fix_is_confirmed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In 0.2 s, profiles of the 3R fall short between the samples several times."""
    confirmed, short = [], []
    verify_fix = fix_search.verify_fix

    def noted(acceptance, candidate):
        fix, refused = verify_fix(acceptance, candidate)
        (confirmed if refused is None else short).append(fix)
        return fix, refused

    robot = load_robot(ROBOT)
    motion = load_trajectory(REST_TO_REST, robot, {"duration": 0.2})
    monkeypatch.setattr(fix_search, "verify_fix", noted)
    chosen = fixes(robot, motion).fixes
    assert len(short) > 1
    assert {id(each) for each in chosen} == {id(each) for each in confirmed}
    assert len(confirmed) == len(chosen)


def test_the_gentlest_of_about_the_same_size_comes_first() -> None:
    robot = load_robot(ROBOT)
    motion = load_trajectory(REST_TO_REST, robot, {"rate": 10})
    base, *others = inverse_dynamics(robot, motion).report.joints
    candidates = [
        Fix(size, robot, motion, joints=[replace(base, peak_tau_motor=(peak, 0.0)), *others])
        for size, peak in ((0.1, 300.0), (0.104, 200.0), (0.106, 100.0), (0.2, 250.0))
    ]
    assert [fix.size for fix in in_order(candidates)] == [0.104, 0.1, 0.106, 0.2]
    assert candidates[0].torques.startswith("peak motor torque 300 N m (base), initial torque discontinuity ")
    assert candidates[0].as_json()["motors"]["base"]["peak_tau_motor"] == [300.0, 0.0]
