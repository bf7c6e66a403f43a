"""Figures of what an optimization changes."""

from __future__ import annotations

import numpy as np
from samples.command_line import REPOSITORY
from samples.figure_inputs import PLACE as TIME
from samples.figure_inputs import joint

from vsacli import Optimum, load_robot, load_trajectory
from vsacli.cli.optimize_plots import optimum_sheets
from vsacli.results.charts.chart import ATTAINABLE
from vsacli.results.charts.optimum import change_sheet, pace_sheet
from vsacli.results.plots import draw_sheet


def texts(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_a_joint_without_stiffness_has_torques_alone():
    figure = draw_sheet(
        change_sheet([joint("soft", limit=92.0), joint("stiff", np.nan)], "arm", along_path=True)
    )
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    motors = [f"{name}, motor {motor}" for name in ("soft", "stiff") for motor in (1, 2)]
    assert titles == ["soft", *motors]
    assert texts(figure) == ["as commanded", "optimum", ATTAINABLE, "limit"]
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels == ["place on the path [s]", "", "", "place on the path [s]", "place on the path [s]"]


def test_without_any_stiffness_there_are_torques_alone():
    figure = draw_sheet(change_sheet([joint("stiff", np.nan)], "arm", along_path=False))
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["stiff, motor 1", "stiff, motor 2"]
    assert figure.axes[0].get_xlabel() == "time [s]"


def test_each_motor_has_a_panel_with_its_torque_before_and_after():
    """Curves of both motors in one panel would have the same look."""
    figure = draw_sheet(change_sheet([joint("soft")], "arm", along_path=False))
    for axes, sign in zip(figure.axes[1:], (1, -1), strict=True):
        before, after = axes.lines
        assert before.get_linestyle() != after.get_linestyle()
        assert (before.get_ydata() == sign * 90.0).all()
        assert (after.get_ydata() == sign * 81.0).all()


def test_a_joint_with_one_motor_has_one_panel_of_torques():
    one = joint("stiff", np.nan)
    single = one._replace(
        before=one.before._replace(torques=one.before.torques[:1]),
        after=one.after._replace(torques=one.after.torques[:1]),
    )
    figure = draw_sheet(change_sheet([joint("soft"), single], "arm", along_path=False))
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["soft", "soft, motor 1", "soft, motor 2", "stiff, motor 1"]


def test_the_fastest_motion_as_a_whole_is_drawn_where_there_is_one():
    assert texts(draw_sheet(pace_sheet(TIME, 1 + TIME, np.nan, "arm"))) == ["optimum", "as commanded"]
    assert texts(draw_sheet(pace_sheet(TIME, 1 + TIME, 1.5, "arm")))[-1] == "fastest uniform scaling"


def test_each_panel_has_the_limits_of_its_own_motor():
    """Both had those of the weaker one, as two equal motors may be draw_sheet."""
    robot = load_robot(REPOSITORY / "robots" / "devices" / "fsj.yaml")
    motion = load_trajectory(REPOSITORY / "trajectories" / "devices" / "fsj.yaml", robot)
    sheets = optimum_sheets(Optimum(robot, "fsj", "torque", "torque", "stiffness", 0.01), motion, motion)
    (panels,) = sheets["optimum"].blocks[0].rows
    limits = [sorted(limit.value for limit in chart.limits) for chart in panels[1:]]
    assert limits == [[-100.0, 100.0], [-50.0, 50.0]]
