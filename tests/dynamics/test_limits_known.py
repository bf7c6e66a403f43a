"""A limit on a variable that no joint computes is refused instead of skipped."""

from __future__ import annotations

import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli import Flag, inverse_dynamics, load_robot, load_trajectory
from vsacli.actuators.reach import LimitCheck
from vsacli.dynamics import inverse

OF_JERK = LimitCheck(Flag.VELOCITY_LIMIT, "d3q", None, (-1.0, 1.0))


def test_a_limit_on_an_unknown_variable_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot(ROBOT)
    monkeypatch.setattr(inverse, "limit_checks", lambda _: [OF_JERK])
    with pytest.raises(NotImplementedError, match="d3q has a limit, but is neither commanded nor computed"):
        inverse_dynamics(robot, load_trajectory(REST_TO_REST, robot))
