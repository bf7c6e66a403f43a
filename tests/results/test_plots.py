"""Figures of results: what is drawn, and what is left out."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from samples.figures import rest_to_rest, without

from vsacli import InputError
from vsacli.results.charts.figures import RESULT_DRAWINGS, omitted_figures
from vsacli.results.charts.reduction import visible_range
from vsacli.results.plots import compare_files, plot_stored, save_figures
from vsacli.results.plots.styles import line_style, shortened

NAN = np.nan


def panels(figure: Figure) -> list[Axes]:
    return list(figure.axes)


def curves(axes: Axes) -> list:
    """The lines of the joints (or results): those wider than the edges of a corridor."""
    return [line for line in axes.lines if line.get_linewidth() > 1 and line.get_linestyle() != "None"]


def bands(axes: Axes, label: str = "infeasible") -> list[tuple[float, float]]:
    """Start and end of the bands of a kind."""
    extents = [
        path.get_extents()
        for collection in axes.collections
        if collection.get_label() == label
        for path in collection.get_paths()
    ]
    return [(extent.x0, extent.x1) for extent in extents]


def legend_labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_infeasible_steps_get_gray_bands_in_the_panels_that_show_the_joint() -> None:
    result = rest_to_rest(401)
    result.read("flags")[100:151, 1] = 1
    result.read("flags")[200, 2] = 3  # infeasible and singular
    figures = plot_stored(result)
    first, second = (0.995, 1.505), (1.995, 2.005)
    position, base, shoulder, elbow = panels(figures["motion"])
    assert bands(base) == []
    np.testing.assert_allclose(bands(shoulder), [first])
    np.testing.assert_allclose(bands(elbow), [second])
    for axes in (position, *panels(figures["motor-torque"]), *panels(figures["elastic-torque"])):
        np.testing.assert_allclose(sorted(bands(axes)), [first, second])
        np.testing.assert_allclose(bands(axes, "singular"), [second])
    band = next(collection for collection in shoulder.collections if collection.get_label() == "infeasible")
    red, green, blue, _ = band.get_facecolor()[0]
    assert red == green == blue < 0.9


@pytest.mark.slow
def test_a_single_infeasible_step_of_a_million_is_visible() -> None:
    result = rest_to_rest(100_001)
    result.read("flags")[50_000, 0] = 1
    figure = plot_stored(result)["elastic-torque"]
    middle = _column_of_pixels(figure)
    assert middle.min() < 0.85  # the band is at 0.8, the grid at 0.9


def _column_of_pixels(figure: Figure) -> np.ndarray:
    """Brightness from t = 1.9 s to 2.1 s at the lower end of the first panel, without the grid."""
    axes = figure.axes[0]
    axes.grid(visible=False)
    axes.set_xticks([])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    left, right = (round(axes.transData.transform((time, 0))[0]) for time in (1.9, 2.1))
    image = np.asarray(canvas.buffer_rgba())
    row = image.shape[0] - round(axes.transAxes.transform((0, 0.02))[1])
    return image[row, left:right, 0] / 255


def test_the_first_three_joints_look_as_in_the_paper() -> None:
    lines = curves(panels(plot_stored(rest_to_rest())["motion"])[0])
    assert [(line.get_linestyle(), line.get_marker()) for line in lines] == [
        ("-", ""),
        ("--", ""),
        ("-", "+"),
    ]
    black, red, blue = (matplotlib.colors.to_rgb(line.get_color()) for line in lines)
    assert black == (0, 0, 0)
    assert np.argmax(red) == 0
    assert np.argmax(blue) == 2


def test_styles_stay_distinct_in_color_and_stroke() -> None:
    assert len({line_style(joint) for joint in range(72)}) == 72
    first = [line_style(joint) for joint in range(8)]
    assert len({style.color for style in first}) == 8
    assert len({(style.linestyle, style.marker) for style in first}) == 8


def test_markers_are_sparse() -> None:
    marked = curves(panels(plot_stored(rest_to_rest(2001))["elastic-torque"])[0])[2]
    assert 5 <= len(marked.get_markevery()) <= 20


def test_a_gap_breaks_the_line() -> None:
    result = rest_to_rest(401)
    result.read("tau_motor")[100:110, 0] = NAN
    for axes in panels(plot_stored(result)["motor-torque"]):
        values = curves(axes)[0].get_ydata()
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(values)), np.arange(100, 110))


def test_a_step_alone_between_gaps_is_a_dot() -> None:
    result = rest_to_rest(401)
    result.read("tau_motor")[100:110, 0] = NAN
    result.read("tau_motor")[105, 0] = 7.0
    for axes in panels(plot_stored(result)["motor-torque"]):
        (dot,) = (line for line in axes.lines if line.get_marker() == ".")
        np.testing.assert_array_equal(dot.get_xydata(), [[1.05, 7.0]])


@pytest.mark.slow
def test_a_run_of_one_step_can_be_drawn(tmp_path: Path) -> None:
    result = rest_to_rest(401)
    result.time = result.time[:1]
    result._values = {name: values[:1] for name, values in result._values.items()}
    assert len(save_figures(plot_stored(result), tmp_path, "one")) == 3


@pytest.mark.parametrize(
    ("figure", "labels"),
    [
        ("motion", ["joint position $q$ [rad]", *3 * [r"$\sigma$ [N m/rad]"]]),
        ("motor-torque", [r"motor torque $\tau_1$ [N m]", r"motor torque $\tau_2$ [N m]"]),
        ("elastic-torque", [r"elastic torque $\tau_e$ [N m]"]),
    ],
)
def test_every_axis_has_a_unit(figure: str, labels: list[str]) -> None:
    drawn = plot_stored(rest_to_rest())[figure]
    assert [axes.get_ylabel() for axes in panels(drawn)] == labels
    assert panels(drawn)[-1].get_xlabel() == "time [s]"
    assert panels(drawn)[0].get_xlabel() == "time [s]"


def test_times_since_1970_are_counted_from_the_second_in_which_they_begin() -> None:
    result = rest_to_rest()
    result.time = 1.7e9 + 0.25 + result.time
    axes = panels(plot_stored(result)["motor-torque"])[-1]
    axes.figure.draw_without_rendering()
    assert axes.get_xlabel() == "time after 1700000000 s [s]"
    assert [label.get_text() for label in axes.get_xticklabels()[1:-1]] == ["1", "2", "3", "4"]


def test_title_and_legend_name_robot_trajectory_and_joints() -> None:
    result = rest_to_rest()
    result.read("flags")[7, 0] = 1
    figures = plot_stored(result)
    assert {figure.get_suptitle() for figure in figures.values()} == {"vsa-3r, rest-to-rest"}
    assert legend_labels(figures["elastic-torque"]) == [
        *("base", "shoulder", "elbow", "infeasible, by color of joint")
    ]
    assert legend_labels(figures["motion"])[4:] == ["attainable", "infeasible"]


@pytest.mark.slow
def test_a_name_that_robot_and_trajectory_share_stands_once() -> None:
    result = rest_to_rest()
    result.trajectory_name = result.robot_name
    assert plot_stored(result)["motion"].get_suptitle() == "vsa-3r"


def test_an_incomplete_run_says_where_it_stopped() -> None:
    result = rest_to_rest()
    result.complete = False
    assert plot_stored(result)["motion"].get_suptitle() == "vsa-3r, rest-to-rest (stopped at 4 s)"


def test_revolute_and_prismatic_joints_get_axes_of_their_own() -> None:
    figures = plot_stored(rest_to_rest(types="RPRP"))
    revolute, prismatic = panels(figures["elastic-torque"])
    assert revolute.get_ylabel() == r"elastic torque $\tau_e$ [N m]"
    assert prismatic.get_ylabel() == r"elastic force $\tau_e$ [N]"
    assert [line.get_color() for line in curves(prismatic)] == [line_style(1).color, line_style(3).color]
    stiffness = [axes.get_ylabel() for axes in panels(figures["motion"])[2:]]
    assert stiffness == 2 * [r"$\sigma$ [N m/rad]", r"$\sigma$ [N/m]"]


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("joints", [1, 7, 20])
def test_many_joints_stay_apart(joints: int, tmp_path: Path) -> None:
    figures = plot_stored(rest_to_rest(types="R" * joints))
    shown = [curves(axes) for axes in panels(figures["elastic-torque"])]
    assert sum(map(len, shown)) == joints
    assert max(map(len, shown)) <= 7
    titles = [axes.get_title(loc="left") for axes in panels(figures["motion"])]
    assert {title for title in titles if title} == {f"joint_{number + 1}" for number in range(joints)}
    (legend,) = figures["motion"].legends
    save_figures({"motion": figures["motion"]}, tmp_path, "many")
    assert legend.get_window_extent().width <= figures["motion"].bbox.width
    assert legend.get_window_extent().y1 <= min(axes.bbox.y0 for axes in panels(figures["motion"]))


@pytest.mark.slow
def test_names_are_taken_literally_and_cut(tmp_path: Path) -> None:
    result = rest_to_rest()
    result.trajectory_name = r"$\frac{$ " + 200 * "x"
    result.joint_names = ("_hidden", "$x$", 90 * "long_")
    figures = plot_stored(result)
    save_figures(figures, tmp_path, "odd")
    labels = legend_labels(figures["elastic-torque"])
    assert labels[:2] == ["_hidden", "$x$"]
    assert len(labels[2]) == 36


def test_a_cut_name_keeps_both_ends() -> None:
    assert shortened("a_very_long_name_1", 9) == "a_ve…me_1"
    assert shortened("short", 9) == "short"


def test_stiffness_lies_in_its_shaded_corridor() -> None:
    result = rest_to_rest()
    axes = panels(plot_stored(result)["motion"])[2]
    (area,) = (collection for collection in axes.collections if not collection.get_label().startswith("inf"))
    vertices = area.get_paths()[0].vertices
    lower, top = result.read("stiffness_min")[:, 1], axes.get_ylim()[1]
    assert vertices[:, 1].max() == pytest.approx(top)  # the upper end is infinite
    assert vertices[:, 1].min() == pytest.approx(lower.min())
    edge = next(line for line in axes.lines if line.get_linewidth() < 1)
    np.testing.assert_array_equal(edge.get_ydata(), lower)
    assert top > 1275


def test_the_corridor_has_a_gap_where_the_load_cannot_be_carried() -> None:
    result = rest_to_rest(401)
    for bound in ("stiffness_min", "stiffness_max"):
        result.read(bound)[100:200, 0] = NAN
    area = panels(plot_stored(result)["motion"])[1].collections[0]
    extents = [path.get_extents() for path in area.get_paths()]
    np.testing.assert_allclose([(extent.x0, extent.x1) for extent in extents], [(0, 0.99), (2, 4)])


@pytest.mark.parametrize(
    ("command", "lower", "upper", "expected"),
    [
        ([850, 1275], [800, 800], [np.inf, np.inf], (800, 1275)),  # a near bound is shown, infinity is not
        ([1000, 1000], [1, 1], [1e9, 1e9], (750, 1250)),  # far bounds are shown as far as a quarter away
        ([850, 850], [5000, 4000], [np.inf, NAN], (850, 5000)),  # a violated bound is always shown
        ([850, 850], [100, 100], [300, 200], (200, 850)),
        ([850, 900], [NAN, NAN], [NAN, NAN], (850, 900)),
    ],
)
def test_stiffness_axis_shows_what_matters(command: list, lower: list, upper: list, expected: tuple) -> None:
    bottom, top = visible_range(*(np.array(values, dtype=float) for values in (command, lower, upper)))
    low, high = expected
    margin = 0.06 * (high - low)
    assert (bottom, top) == pytest.approx((low - margin, high + margin))


def test_stiffness_axis_of_a_constant_or_unknown_command() -> None:
    bottom, top = visible_range(np.array([850.0, 850.0]))
    assert bottom < 850 < top
    assert visible_range(np.array([NAN, NAN])) == (0.0, 1.0)


def test_figures_without_their_variables_are_left_out_with_a_reason() -> None:
    result = without(rest_to_rest(), "q", "stiffness", "tau_e")
    assert list(plot_stored(result)) == ["motor-torque"]
    reasons = omitted_figures(RESULT_DRAWINGS, result.variables)
    further = ["losses", "damper", "motor-current", "motor-voltage", "tool-stiffness", "tool-path"]
    assert list(reasons) == ["motion", "elastic-torque", "energy", *further]
    expected = "figure motion needs q and stiffness, which this result was written without (--variables)"
    assert reasons["motion"] == expected


def test_corridor_and_bands_are_drawn_only_if_stored() -> None:
    figure = plot_stored(without(rest_to_rest(sigma=(850, 790)), "stiffness_max", "flags"))["motion"]
    assert legend_labels(figure) == ["base", "shoulder", "elbow"]
    assert not any(axes.collections for axes in panels(figure))


def test_nothing_to_draw_is_an_error() -> None:
    with pytest.raises(InputError, match=r"run.h5: nothing can be plotted: .*elastic-torque needs tau_e"):
        plot_stored(without(rest_to_rest(), "q", "tau_motor", "tau_e"))


def test_comparison_overlays_the_motor_torques_of_each_joint() -> None:
    soft = rest_to_rest(sigma=(850, 850), trajectory="soft")
    stiff = rest_to_rest(sigma=(1275, 1275), trajectory="stiff")
    figure = compare_files([soft, stiff])["compare"]
    overlaid = [axes for axes in panels(figure) if axes.get_ylabel()]
    titles = [axes.get_title(loc="left") for axes in overlaid]
    assert titles[:3] == ["base, motor 1", "base, motor 2", "shoulder, motor 1"]
    assert overlaid[3].get_ylabel() == r"$\tau_2$ [N m]"
    black, red = curves(overlaid[3])
    assert (black.get_color(), black.get_linestyle(), red.get_linestyle()) == ("black", "-", "--")
    np.testing.assert_array_equal(black.get_ydata(), soft.read("tau_motor")[:, 1, 1])
    np.testing.assert_array_equal(red.get_ydata(), stiff.read("tau_motor")[:, 1, 1])
    assert legend_labels(figure) == ["soft", "stiff"]


def test_comparison_spans_the_longest_run_and_shows_bands() -> None:
    short = rest_to_rest(trajectory="short")
    short.time = short.time / 2
    short.read("flags")[300:401, 0] = 1
    figure = compare_files([short, rest_to_rest()])["compare"]
    assert panels(figure)[-1].get_xlim() == (0, 4)
    np.testing.assert_allclose(bands(panels(figure)[0]), [(1.4975, 2.0)])
    assert bands(panels(figure)[4]) == []


@pytest.mark.parametrize(
    ("paths", "labels"),
    [
        (("a.h5", "b.h5"), ["rest-to-rest (a)", "rest-to-rest (b)"]),
        (("x/a.h5", "y/a.h5"), [f"rest-to-rest ({Path('x/a.h5')})", f"rest-to-rest ({Path('y/a.h5')})"]),
        (("a.h5", "a.h5"), ["1: rest-to-rest (a.h5)", "2: rest-to-rest (a.h5)"]),
    ],
)
def test_equal_trajectory_names_are_told_apart(paths: tuple[str, str], labels: list[str]) -> None:
    assert legend_labels(compare_files([rest_to_rest(path=path) for path in paths])["compare"]) == labels


def test_results_of_different_joints_are_refused() -> None:
    with pytest.raises(
        InputError, match=r"b.h5: cannot be compared with a.h5: it has the joints joint_1 \(prismatic\)"
    ):
        compare_files([rest_to_rest(types="R", path="a.h5"), rest_to_rest(types="P", path="b.h5")])


def test_a_result_without_motor_torques_is_refused() -> None:
    with pytest.raises(InputError, match=r"b.h5: figure compare needs tau_motor, which .* without"):
        compare_files([rest_to_rest(), without(rest_to_rest(path="b.h5"), "tau_motor")])
