"""Figures of every kind in the looks for a paper and a slide: size, fonts, and texts that stay apart."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from samples.command_line import REST_TO_REST, ROBOT
from samples.figure_inputs import LIMITED, curve, joint, motor
from samples.figures import rest_to_rest
from samples.shipped import shipped_robot
from samples.studies import DRAWN, study
from samples.text_boxes import collisions, shown_texts

from vsacli.cli.main import run
from vsacli.files.info.robot_info import static_load, static_loads
from vsacli.results.charts.arm_chart import arm_chart
from vsacli.results.charts.chart import Chart, Line, PanelGrid, Sheet
from vsacli.results.charts.look import LEGIBLE, STYLES, Look, drawing_with
from vsacli.results.charts.measured import MeasuredCurve, measured_sheet
from vsacli.results.charts.optimum import change_sheet
from vsacli.results.charts.ranking import EffectBar, Ranking
from vsacli.results.charts.reduction import Curve
from vsacli.results.charts.robot_charts import ActuatorChart, actuator_charts
from vsacli.results.plots import (
    actuators_figure,
    arm_figure,
    compare_files,
    draw_sheet,
    plot_stored,
    ranking_figure,
    recorded_figure,
    stiffness_figure,
    study_figures,
    torque_speed_figure,
)
from vsacli.results.plots.arrangement import arrange_blocks
from vsacli.results.plots.long_texts import wrapped
from vsacli.results.store.reader import open_stored
from vsacli.results.store.study_table import StoredStudy

PAPER, SLIDE = STYLES["paper"], STYLES["slide"]
CM = 2.54
SEVEN = ("panda_7r", "lwr_7r_vsa")
GRID = "vary:\n  joints.*.actuator.spring.k: [380, 400, 440]\n  duration: [3, 4, 5]\n"
TIME = np.linspace(0.0, 4.0, 100)

Figures = dict[str, Figure]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulation, and tables of a grid and of random draws."""
    folder = tmp_path_factory.mktemp("looks")
    for name, vary in (("grid", GRID), ("drawn", DRAWN)):
        (folder / name).mkdir()
        study(folder / name, vary)
        with contextlib.chdir(folder / name):
            assert run(["study", "study.yaml", "-q"]) == 0
    with contextlib.chdir(folder):
        run(["simulate", str(ROBOT), str(REST_TO_REST), "--set", "rate=100", "-q", "-o", "simulated.h5"])
    return folder


@cache
def charts(name: str) -> list[ActuatorChart]:
    robot = shipped_robot(name)
    return actuator_charts(robot, static_loads(static_load(robot)).tolist())


def of_robot(name: str) -> Figures:
    return {
        "arm": arm_figure(arm_chart(shipped_robot(name))),
        "actuators": actuators_figure(charts(name), name),
        "stiffness": stiffness_figure(charts(name), name),
    }


def of_result(joints: int) -> Figures:
    result = rest_to_rest(types="R" * joints)
    result.read("flags")[100:151, 1] = 1
    return {**plot_stored(result), **compare_files([result, rest_to_rest(types="R" * joints, path="b.h5")])}


def of_tables(folder: Path) -> Figures:
    figures: Figures = {}
    for name in ("grid", "drawn"):
        with StoredStudy(folder / name / "study.h5") as table:
            figures |= {f"{name}-{kind}": figure for kind, figure in study_figures(table).items()}
    return figures


def of_lists() -> Figures:
    bars = [
        EffectBar(f"1 % of cubic spring stiffness k_c, shoulder {at}", 1 / at, "shoulder")
        for at in range(1, 9)
    ]
    measured = MeasuredCurve("shoulder.tau_motor_measured_1", "N m", 0.09123, TIME, TIME / 4, TIME / 5)
    return {
        "ranking": ranking_figure(Ranking("sensitivity of vsa-3r, rest-to-rest: 8 parameters", bars)),
        "torque-speed": torque_speed_figure([motor(LIMITED)] * 6, "sizing of motors: vsa-3r, rest-to-rest"),
        "recording": recorded_figure([curve("shoulder.q"), curve("elbow.q", above=2.0)], "log"),
        "optimum": draw_sheet(change_sheet([joint("shoulder", limit=92.0)] * 3, "optimum", along_path=True)),
        "measured": draw_sheet(measured_sheet([measured] * 6, "comparison of a result with a recording")),
    }


def of_simulation(folder: Path) -> Figures:
    with open_stored(folder / "simulated.h5") as stored:
        return plot_stored(stored)


def every_figure(files: Path) -> Iterator[tuple[str, Figure]]:
    """Figures of every kind, with the current look."""
    for figures in (of_simulation(files), of_result(3), of_tables(files), of_lists(), of_robot("vsa_3r")):
        yield from figures.items()


def figures_of_seven_joints() -> Iterator[tuple[str, Figure]]:
    """Figures with many panels, with the current look."""
    for figures in (of_result(7), *map(of_robot, SEVEN)):
        yield from figures.items()


def smallest(figure: Figure) -> float:
    return min(text.get_fontsize() for text, _ in shown_texts(figure))


@pytest.mark.slow
def test_in_a_paper_every_figure_has_the_width_and_legible_texts_that_stay_apart(files: Path) -> None:
    with drawing_with(PAPER):
        check_in_paper(every_figure(files))


@pytest.mark.exhaustive
@pytest.mark.slow
def test_in_a_paper_figures_of_seven_joints_do_so_too() -> None:
    with drawing_with(PAPER):
        check_in_paper(figures_of_seven_joints())


def check_in_paper(figures: Iterator[tuple[str, Figure]]) -> None:
    for name, figure in figures:
        assert figure.get_figwidth() * CM == pytest.approx(PAPER.width, rel=0.01), name
        assert not figure.get_suptitle(), name
        texts = shown_texts(figure)
        assert min(text.get_fontsize() for text, _ in texts) >= LEGIBLE, name
        assert collisions(figure, texts) == [], name


@pytest.mark.exhaustive
@pytest.mark.slow
def test_on_a_slide_every_figure_has_the_size_and_texts_that_stay_apart(files: Path) -> None:
    with drawing_with(SLIDE):
        for name, figure in chain(every_figure(files), figures_of_seven_joints()):
            size = [CM * inches for inches in figure.get_size_inches()]
            assert size == pytest.approx([SLIDE.width, SLIDE.height], rel=0.01), name
            assert collisions(figure, shown_texts(figure)) == [], name


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("width", [6.0, 12.0, 18.3])
def test_other_widths_are_kept(width: float) -> None:
    with drawing_with(replace(PAPER, width=width)):
        figures = {**of_robot("vsa_3r"), **of_result(3), **of_lists()}
    for name, figure in figures.items():
        assert figure.get_figwidth() * CM == pytest.approx(width, rel=0.01), name


def test_the_usual_look_leaves_figures_as_declared() -> None:
    sheet = simulated(7)
    assert arrange_blocks(sheet).natural == sheet.size
    assert draw_sheet(sheet).get_size_inches() == pytest.approx(sheet.size)


@pytest.mark.slow
def test_a_font_size_alone_scales_a_figure() -> None:
    sheet = simulated(3)
    with drawing_with(Look(font_size=15.0)):
        figure = draw_sheet(sheet)
    assert figure.get_size_inches() == pytest.approx([1.5 * inches for inches in sheet.size])
    assert smallest(figure) == pytest.approx(1.5 * 9)


def simulated(joints: int, columns: int = 2, most_rows: int = 7, rows: int = 1) -> Sheet:
    """Groups of `rows` rows for each joint, as of simulated motions and comparisons."""
    lines = [Line(Curve(TIME, np.sin(TIME)), 0)]
    chart = {
        (at, row, column): Chart(f"joint {at}, {row}, {column}", "rad", lines)
        for at in range(joints)
        for row in range(rows)
        for column in range(columns)
    }
    panels = [
        [chart[at, row, column] for column in range(columns)] for at in range(joints) for row in range(rows)
    ]
    block = PanelGrid(TIME, panels, (1.7,) * rows, most_rows)
    return Sheet("sheet", (3.0 * block.columns, block.height + 1), {"computed": 0}, [block])


def places(figure: Figure) -> dict[str, tuple[float, float]]:
    """Corner of each panel, by its title."""
    figure.draw_without_rendering()
    return {axes.get_title(loc="left"): (axes.bbox.x0, axes.bbox.y1) for axes in figure.axes}


def side_by_side(figure: Figure) -> int:
    return len({round(x) for x, _ in places(figure).values()})


@pytest.mark.slow
def test_many_joints_fold_into_as_many_columns_as_fit() -> None:
    sheet = simulated(8)
    assert side_by_side(draw_sheet(sheet)) == 4
    with drawing_with(PAPER):
        figure = draw_sheet(sheet)
    assert side_by_side(figure) == 2
    assert len(figure.axes) == 16


@pytest.mark.slow
def test_a_difference_stays_below_its_curves() -> None:
    with drawing_with(replace(PAPER, width=5.0)):
        figure = draw_sheet(simulated(2, columns=3, rows=2))
    assert side_by_side(figure) == 1
    seen = places(figure)
    for at in range(2):
        for column in range(3):
            (x, y), (below_x, below_y) = (seen[f"joint {at}, {row}, {column}"] for row in range(2))
            assert x == pytest.approx(below_x)
            between = [height for _, height in seen.values() if below_y < height < y]
            assert not between


def test_rows_that_are_too_wide_are_divided_after_their_first_panels() -> None:
    with drawing_with(PAPER):
        seen = places(draw_sheet(simulated(1, columns=3)))
    first, second, third = (seen[f"joint 0, 0, {column}"] for column in range(3))
    assert first[0] == pytest.approx(second[0])
    assert first[1] > second[1]
    assert second[1] == pytest.approx(third[1])


@pytest.mark.slow
def test_figures_higher_than_a_page_have_more_panels_side_by_side() -> None:
    sheet = simulated(12, most_rows=12)
    with drawing_with(replace(PAPER, width=18.3)):
        figure = draw_sheet(sheet)
    assert side_by_side(figure) == 4
    assert figure.get_figheight() * CM < 24


@pytest.mark.slow
def test_a_slide_has_the_arrangement_with_the_largest_font() -> None:
    with drawing_with(SLIDE):
        figure = draw_sheet(simulated(7))
    assert side_by_side(figure) == 4
    assert smallest(figure) > 7


@pytest.mark.parametrize(
    ("text", "length", "lines"),
    [
        ("minus the first, rms 7.24 N m", 20, ["minus the first,", "rms 7.24 N m"]),
        ("shoulder_pitch, motor 1", 16, ["shoulder_pitch,", "motor 1"]),
        ("stiffness error $a - b$ [N m/rad]", 26, ["stiffness error $a - b$", "[N m/rad]"]),
        ("shoulder.tau_motor_measured_1", 22, ["shoulder.", "tau_motor_measured_1"]),
        ("a_very_long_name_of_a_joint", 9, ["a_ve…oint"]),
        ("short", 9, ["short"]),
    ],
)
def test_texts_break_between_clauses_and_keep_values_with_units(
    text: str, length: int, lines: list[str]
) -> None:
    assert wrapped(text, length).split("\n") == lines


def test_a_distant_limit_is_written_where_no_curve_is() -> None:
    places = {}
    for name, values in (("rising", TIME), ("falling", -TIME)):
        result = rest_to_rest(401, "R")
        result.read("tau_motor")[:] = np.interp(result.time, TIME, values)[:, None, None]
        result.bounds["tau_motor"] = np.array([[[-1000.0, 1000.0]] * 2])
        (note,) = plot_stored(result, ["tau_motor"])["tau_motor"].axes[0].texts
        assert note.get_text() == "limits beyond the axis: -1000, 1000"
        places[name] = (note.get_ha(), note.get_va())
    assert places["rising"] != places["falling"]
