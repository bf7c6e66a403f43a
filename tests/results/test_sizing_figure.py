"""Figures of torque over speed."""

from __future__ import annotations

from samples.figure_inputs import FREE, LIMITED, motor

from vsacli.results.plots import torque_speed_figure


def test_trajectories_differ_without_colors() -> None:
    figure = torque_speed_figure([motor(LIMITED)], "sizing of motors: arm")
    handles = {line.get_label(): line for line in figure.legends[0].get_lines()}
    assert handles["fast"].get_linestyle() != handles["slow"].get_linestyle()
    dashes = {
        line.get_linestyle()
        for line in figure.axes[0].lines
        if line.get_color() == handles["slow"].get_color()
    }
    assert dashes == {handles["slow"].get_linestyle()}


def test_the_legend_has_what_is_drawn() -> None:
    texts = [
        [text.get_text() for text in torque_speed_figure([motor(bounds)], "arm").legends[0].get_texts()]
        for bounds in (LIMITED, FREE)
    ]
    always = ["root mean square", "pale: while it brakes"]
    assert texts[0] == ["fast", "slow", "within the peak limits", "within the continuous limits", *always]
    assert texts[1] == ["fast", "slow", *always]


def test_axes_show_magnitudes() -> None:
    (axes,) = torque_speed_figure([motor(LIMITED)], "arm").axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("|speed| [rad/s]", "|torque| [N m]")
    assert axes.get_title(loc="left") == "elbow, motor 1\njoint side"
