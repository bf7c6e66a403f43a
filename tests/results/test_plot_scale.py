"""What sets the scale of a panel: limits in sight do, peaks of nearly singular steps do not."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from samples.figures import Result, rest_to_rest

from vsacli import Flag
from vsacli.results.plots import compare_files, plot_stored


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def limit_lines(axes: Axes) -> list[float]:
    return sorted(line.get_ydata()[0] for line in axes.lines if len(line.get_xdata()) == 2)


def peaked(peak: float = 1e4, flags: int = Flag.NEAR_SINGULAR) -> Result:
    """A motion with a peak of the base's first motor at 1 s, flagged for a tenth of a second."""
    result = rest_to_rest(401)
    result.read("tau_motor")[95:105, 0, 0] = peak * np.exp(-((np.arange(10) - 5.0) ** 2))
    result.read("flags")[95:105, 0] = flags
    return result


def torques(result: Result) -> Figure:
    return plot_stored(result, ["tau_motor"])["tau_motor"]


def test_a_near_singular_peak_is_cut_off_and_its_height_is_written() -> None:
    figure = torques(peaked())
    first, second = figure.axes
    calm = np.delete(peaked().read("tau_motor")[..., 0], np.s_[95:105], axis=0)
    low, high = first.get_ylim()
    assert low < calm.min() < calm.max() < high < 1.2 * calm.max()
    assert [text.get_text() for text in first.texts] == ["10000"]
    assert not second.texts
    (mark,) = (line for line in first.lines if line.get_marker() == "^")
    assert mark.get_xdata() == [1.0]
    assert legend(figure)[-1] == "cut off, near-singular"


def test_peaks_downwards_are_marked_below() -> None:
    first = torques(peaked(-1e4)).axes[0]
    assert [text.get_text() for text in first.texts] == ["-10000"]
    assert [line.get_marker() for line in first.lines].count("v") == 1


@pytest.mark.parametrize(
    ("peak", "flags"), [(1e4, 0), (1e4, Flag.MOTOR_TORQUE_LIMIT), (90.0, Flag.NEAR_SINGULAR)]
)
def test_other_peaks_are_shown_whole(peak: float, flags: int) -> None:
    figure = torques(peaked(peak, flags))
    assert figure.axes[0].get_ylim()[1] > peak
    assert "cut off, near-singular" not in legend(figure)


def test_a_run_that_is_near_singular_throughout_is_shown_whole() -> None:
    result = peaked()
    result.read("flags")[:] = Flag.NEAR_SINGULAR
    assert torques(result).axes[0].get_ylim()[1] > 1e4


def test_a_curve_that_is_near_singular_throughout_does_not_vanish() -> None:
    result = rest_to_rest(401)
    result.read("flags")[:, 0] = Flag.NEAR_SINGULAR
    result.read("tau_motor")[:, 0, 0] = -1000.0
    result.read("tau_motor")[200, 0, 0] = -1e6
    axes = torques(result).axes[0]
    assert -1500 < axes.get_ylim()[0] < -1000
    assert [text.get_text() for text in axes.texts] == ["-1e+06"]


def test_what_does_not_grow_near_singular_steps_is_shown_whole() -> None:
    result = rest_to_rest(401)
    result.read("flags")[10:, :] = Flag.NEAR_SINGULAR
    low, high = plot_stored(result)["motion"].axes[0].get_ylim()
    assert low < -1.0
    assert high > 1.5


def test_a_comparison_cuts_off_peaks_and_those_of_the_differences() -> None:
    figure = compare_files([peaked(), rest_to_rest(401)])["compare"]
    over, apart = figure.axes[0], figure.axes[2]
    assert over.get_ylim()[1] < 200
    assert apart.get_ylim()[0] > -100  # the median of the ten steps is about -45
    peak = rest_to_rest(401).read("tau_motor")[100, 0, 0] - 1e4
    assert apart.texts[0].get_text() == f"{peak:.0f}"


def test_a_peak_next_to_an_infeasible_sample_is_cut_off_as_well() -> None:
    result = peaked(flags=0)
    result.read("flags")[105:110, 0] = Flag.INFEASIBLE
    figure = torques(result)
    assert figure.axes[0].get_ylim()[1] < 200
    assert "cut off, near-singular" in legend(figure)


def values(axes: Axes, color: str) -> np.ndarray:
    (line,) = (line for line in axes.lines if line.get_color() == color and len(line.get_xdata()) > 2)
    return np.asarray(line.get_ydata())


def test_limits_of_joints_that_share_a_panel_are_drawn_as_their_utilization() -> None:
    result = rest_to_rest(401)
    result.bounds["tau_motor"] = np.array([[[-120.0, 120.0]] * 2, [[-300.0, 300.0]] * 2, [[np.nan] * 2] * 2])
    figure = plot_stored(result)["motor-torque"]
    first, _, used, _ = figure.axes
    assert limit_lines(first) == []
    assert limit_lines(used) == [100.0]
    assert used.get_ylim()[0] == 0
    assert used.get_ylim()[1] > 100
    assert used.get_ylabel() == "utilization [%]"
    curves = [line for line in used.lines if len(line.get_xdata()) > 2]
    assert len(curves) == 2  # the elbow has no limit
    torque = result.read("tau_motor")
    np.testing.assert_allclose(values(used, "black"), np.abs(torque[:, 0, 0]) / 120 * 100)
    np.testing.assert_allclose(values(used, "#d8261c"), np.abs(torque[:, 1, 0]) / 300 * 100)


def test_the_utilization_of_a_position_range_is_0_in_its_middle_and_100_at_its_ends() -> None:
    result = rest_to_rest(401)
    result.bounds["q"] = np.array([[[0.0, np.pi / 2]], [[-40.0, 40.0]], [[np.nan, np.nan]]])
    used = plot_stored(result)["motion"].axes[1]
    q = result.read("q")[:, 0]
    np.testing.assert_allclose(values(used, "black"), np.abs(q - np.pi / 4) / (np.pi / 4) * 100)


def test_a_limit_on_one_side_stays_a_line() -> None:
    result = rest_to_rest(401)
    result.bounds["q"] = np.array([[[-np.inf, 1.6]], [[np.nan, np.nan]], [[np.nan, np.nan]]])
    figure = plot_stored(result)["motion"]
    assert limit_lines(figure.axes[0]) == [1.6]
    assert "limit" in legend(figure)


def test_distant_limits_of_one_joint_are_written_and_do_not_flatten_its_curve() -> None:
    result = rest_to_rest(401, "R")
    before = torques(result).axes[0].get_ylim()
    result.bounds["tau_motor"] = np.array([[[-1000.0, 1000.0]] * 2])
    figure = torques(result)
    assert figure.axes[0].get_ylim() == before
    assert [text.get_text() for text in figure.axes[0].texts] == ["limits beyond the axis: -1000, 1000"]
    assert "limit" not in legend(figure)


def test_limits_of_the_stiffness_are_drawn_in_its_corridor() -> None:
    result = rest_to_rest(401)
    result.bounds["stiffness"] = np.array([[[810.0, 1300.0]]] * 3)
    base = plot_stored(result)["motion"].axes[1]
    assert limit_lines(base) == [810.0, 1300.0]
