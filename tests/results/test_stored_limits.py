"""The bounds that are drawn beside a variable are those that its steps are checked against."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow_but
from samples.results import PlannedTrajectory, writing

from vsacli import load_robot
from vsacli.base.simulation_variables import SIMULATED_NAMES
from vsacli.dynamics.limits import limit_checks
from vsacli.results.store.reader import StoredResult

ROBOTS = sorted((REPOSITORY / "robots").rglob("*.yaml"))
NOT_STORED = ("tau_e",)
"""What a spring carries at most, which follows from its law."""


QUICK = [path for path in ROBOTS if path.stem in ("scara_4", "compact_1r", "coupled_1r", "hardening_1r")]
"""Joints of both types, one motor and two, dampers, springs with and without limits."""


@pytest.mark.cases(8)
@pytest.mark.parametrize("path", slow_but(QUICK, ROBOTS), ids=lambda path: path.stem)
def test_bounds_of_a_file_are_those_that_steps_are_checked_against(path: Path, tmp_path: Path) -> None:
    robot = load_robot(path)
    with writing(tmp_path / "r.h5", robot, PlannedTrajectory(1)) as writer:
        writer.finish({"verdict": "ok", "complete": True, "samples": 0})
    with StoredResult.open(tmp_path / "r.h5") as result:
        for index, joint in enumerate(robot.joints):
            for check in limit_checks(joint):
                if check.variable not in NOT_STORED:
                    bounds = result.limits(check.variable)[index, (check.motor or 1) - 1]
                    np.testing.assert_array_equal(bounds, check.range)
        checked = {check.variable for joint in robot.joints for check in limit_checks(joint)}
        unbounded = set(result.declared) - checked
        assert not any(np.isfinite(result.limits(name)).any() for name in unbounded)


def test_what_a_simulation_achieves_is_bounded_as_what_it_was_asked_for() -> None:
    assert SIMULATED_NAMES["tau_motor_cmd"] == SIMULATED_NAMES["tau_motor_measured"] == "tau_motor"
