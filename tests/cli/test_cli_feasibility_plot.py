"""`check-feasibility --plot`: the stiffness inside its corridor, without a result file."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib.figure import Figure
from samples.command_line import ROBOT, SEVEN_JOINTS, contents, seven_joint_motion
from samples.figures import rest_to_rest

from vsacli.results.charts.figures import FEASIBILITY_VARIABLES, feasibility
from vsacli.results.charts.stored import StoredCharts
from vsacli.results.plots import draw_sheet

PNG = b"\x89PNG\r\n\x1a\n"
FIGURE = "figures/vsa_3r-soft-feasibility.png"


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def titles(figure: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


def shaded(axes, label: str = "infeasible") -> list[tuple[float, float]]:
    """Start and end of each band of a kind."""
    paths = [path for band in axes.collections if band.get_label() == label for path in band.get_paths()]
    return [(path.get_extents().x0, path.get_extents().x1) for path in paths]


@pytest.mark.slow
def test_figure_is_all_that_is_written(vsacli, too_soft, tmp_path, temporary_files):
    (tmp_path / "temporary").mkdir()
    temporary_files(tmp_path / "temporary")
    done = vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures")
    assert (done.code, done.err) == (3, f"wrote {FIGURE}\n")
    assert contents(tmp_path).keys() == {"soft.yaml", FIGURE}
    assert (tmp_path / FIGURE).read_bytes().startswith(PNG)
    assert not any((tmp_path / "temporary").iterdir())


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--json"], ["--stop-on-infeasible"]], ids=" ".join)
def test_report_is_the_same_with_a_figure(vsacli, too_soft, options):
    plain = vsacli("check-feasibility", ROBOT, too_soft, *options)
    drawn = vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures", *options)
    assert (drawn.code, drawn.out) == (plain.code, plain.out)


@pytest.mark.slow
def test_bad_stretches_are_those_of_the_report(vsacli, too_soft, drawn_figures):
    done = vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures", "--json")
    (figure,) = drawn_figures.values()
    joints = json.loads(done.out)["joints"]
    assert titles(figure) == [joint["name"] for joint in joints]
    for axes, joint in zip(figure.axes, joints, strict=True):
        ((start, end),) = shaded(axes)
        # A band begins half a step of 10 ms before its first step.
        assert start == pytest.approx(joint["first_time"]["infeasible"] - 0.005)
        assert end == 4
    assert labels(figure) == ["attainable", "infeasible"]


@pytest.mark.slow
def test_ways_that_end_are_shaded(vsacli, too_soft, drawn_figures):
    followed = ("--deflection-solver", "ode", "--set", "rate=25", "--json")
    done = vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures", *followed)
    ends = [joint["stopped"]["time"] for joint in json.loads(done.out)["deflections"]["joints"]]
    (figure,) = drawn_figures.values()
    for axes, end in zip(figure.axes, ends, strict=True):
        ((start, last),) = shaded(axes)
        assert start - 0.02 < end <= start + 0.02  # half a step
        assert last == 4


@pytest.mark.usefixtures("no_computing")
def test_existing_figure_is_refused_before_computing(vsacli, too_soft, tmp_path):
    figure = tmp_path / FIGURE
    figure.parent.mkdir()
    figure.write_text("mine")
    done = vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures")
    assert (done.code, done.out) == (4, "")
    assert done.err.startswith(f"{FIGURE}: exists already")
    assert figure.read_text() == "mine"


@pytest.mark.slow
def test_existing_figure_is_replaced_on_request(vsacli, too_soft, tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / FIGURE).write_text("old")
    assert vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures", "--overwrite").code == 3
    assert (tmp_path / FIGURE).read_bytes().startswith(PNG)


def test_folder_that_is_a_file_is_refused(vsacli, too_soft, tmp_path):
    (tmp_path / "figures").write_text("mine")
    done = vsacli("check-feasibility", ROBOT, too_soft, "--plot", "figures")
    assert (done.code, done.out) == (4, "")
    assert done.err.startswith("figures: is a file")


@pytest.mark.slow
def test_seven_joints_have_a_panel_each(vsacli, tmp_path, drawn_figures):
    motion = seven_joint_motion(tmp_path / "reach.yaml", rate=100)
    assert vsacli("check-feasibility", SEVEN_JOINTS, motion, "--plot", ".").code == 0
    (figure,) = drawn_figures.values()
    assert len(titles(figure)) == 7
    assert (tmp_path / "lwr_7r_vsa-reach-feasibility.png").exists()


def test_upper_end_of_the_corridor_is_drawn():
    result = rest_to_rest(sigma=(850, 1275))
    upper = np.full_like(result.read("stiffness"), 1200.0)
    above = result.read("stiffness") > upper
    bounded = rest_to_rest(sigma=(850, 1275), stiffness_max=upper, flags=above.astype(np.uint32))
    assert set(FEASIBILITY_VARIABLES) <= set(bounded.variables)
    for axes in draw_sheet(feasibility(StoredCharts([bounded]))).axes:
        assert any((line.get_ydata() == 1200).all() for line in axes.lines)
        ((start, _),) = shaded(axes)
        assert 2 < start < 4
