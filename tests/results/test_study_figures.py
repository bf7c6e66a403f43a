"""Figures of studies."""

from __future__ import annotations

import contextlib
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import FillBetweenPolyCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from samples.studies import DRAWN, study
from scipy.stats import binomtest

from vsacli import InputError
from vsacli.base.tables import ReportText
from vsacli.cli.main import run
from vsacli.results.charts.study_points import StudyPoints
from vsacli.results.pages.study_page import study_page
from vsacli.results.plots import compared_studies, study_figures
from vsacli.results.store.study_table import StoredStudy

GRID = "vary:\n  joints.*.actuator.spring.k: [380, 400, 440]\n  duration: [3, 4, 5]\n"


def computed(folder: Path, text: str) -> Path:
    """The table of a study in a folder."""
    study(folder, text)
    with contextlib.chdir(folder):
        assert run(["study", "study.yaml", "-q"]) == 0
    return folder / "study.h5"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of nine runs, three of which are infeasible."""
    return computed(tmp_path_factory.mktemp("figures"), GRID)


@pytest.fixture(scope="module")
def drawn_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of six random draws."""
    return computed(tmp_path_factory.mktemp("drawn"), DRAWN)


@pytest.fixture
def drawn(drawn_path: Path) -> Iterator[StoredStudy]:
    with StoredStudy(drawn_path) as opened:
        yield opened


@pytest.fixture
def table(path: Path) -> Iterator[StoredStudy]:
    with StoredStudy(path) as opened:
        yield opened


@pytest.mark.slow
def test_the_front_has_the_runs_of_which_none_is_better_in_both(table: StoredStudy) -> None:
    points = StudyPoints(table)
    assert points.cost is not None
    cost, fine = points.cost[1], points.ok
    np.testing.assert_array_equal(np.isnan(cost), ~fine)

    def beaten(row: int) -> bool:
        other = fine & (points.margin >= points.margin[row]) & (cost <= cost[row])
        return bool((other & ((points.margin > points.margin[row]) | (cost < cost[row]))).any())

    assert sorted(points.front) == [row for row in np.flatnonzero(fine) if not beaten(row)]
    assert set(points.worst) == set(np.argsort(points.margin)[:3])


@pytest.mark.slow
def test_two_numbers_on_a_grid_are_a_map(table: StoredStudy) -> None:
    """Each value of the margin stands at its two numbers."""
    figures = study_figures(table)
    assert set(figures) == {"feasibility", "margin", "pareto"}
    mesh = next(each for each in figures["margin"].axes[0].collections if isinstance(each, QuadMesh))
    shown = np.asarray(mesh.get_array()).reshape(3, 3)  # durations upwards, springs across
    margin = 100 * table.read("margin").min(axis=1).reshape(3, 3)
    np.testing.assert_array_equal(shown, margin.T)


def test_shares_fall_from_the_ok_runs_at_their_margins(table: StoredStudy) -> None:
    """A dotted line counts runs of any verdict, of which some have negative margins."""
    axes = compared_studies([table, table], ["one", "two"]).axes[0]
    margins, ok = 100 * table.read("margin").min(axis=1), np.array(table.texts("verdict")) == "ok"
    for line, counted in ((axes.lines[0], ok), (axes.lines[1], np.ones_like(ok))):
        margin, share = map(np.asarray, line.get_data())
        for at in (-10.0, 0.0, 3.0):
            place = np.searchsorted(margin, at)
            shown = share[place] if place < len(share) else 0.0
            assert shown == pytest.approx(100 * (counted & (margins >= at)).mean())
        assert (share[0], share[-1]) == (pytest.approx(100 * counted.mean()), 0)


def texts(figure: Figure) -> list[str]:
    """Labels of the legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def bands(axes: Axes) -> list[FillBetweenPolyCollection]:
    """Bands of intervals in a panel."""
    return [each for each in axes.collections if isinstance(each, FillBetweenPolyCollection)]


def test_a_grid_has_no_intervals(table: StoredStudy) -> None:
    """Its runs are chosen: their share is the probability of nothing."""
    figure = study_figures(table)["feasibility"]
    assert texts(figure) == ["ok 66.7 %\ninfeasible 33.3 %", "runs of any verdict"]
    assert not bands(figure.axes[0])
    assert not figure.axes[0].get_title(loc="left")


@pytest.mark.slow
def test_random_draws_have_intervals_with_a_mark_in_the_legend(drawn: StoredStudy) -> None:
    figure = study_figures(drawn)["feasibility"]
    share, *_, label = texts(figure)
    ok, runs = drawn.texts("verdict").count("ok"), drawn.rows
    low, high = binomtest(ok, runs).proportion_ci(method="wilson")
    assert share.split("\n")[0] == f"ok {100 * ok / runs:.3g} % ({100 * low:.3g} to {100 * high:.3g} %)"
    assert label == "95 % interval (random samples)"
    assert isinstance(figure.legends[0].legend_handles[-1], Patch)
    (band,) = bands(figure.axes[0])
    edges = np.asarray(band.get_paths()[0].vertices)[:, 1]
    ends = [binomtest(count, runs).proportion_ci(method="wilson") for count in range(ok + 1)]
    np.testing.assert_allclose(
        np.unique(np.round(edges, 6)), np.unique(np.round(100 * np.ravel(ends), 6)), rtol=1e-3
    )


class TwoMotions(StoredStudy):
    """A table each of whose draws was executed with two trajectories."""

    def texts(self, name: str) -> list[str]:
        return ["one.yaml", "two.yaml"] * (self.rows // 2) if name == "trajectory" else super().texts(name)


def test_draws_that_several_motions_share_have_no_intervals(drawn: StoredStudy) -> None:
    """Runs of the same draw are not independent."""
    with TwoMotions(drawn.path) as shared:
        assert not bands(study_figures(shared)["feasibility"].axes[0])


def test_axes_and_titles_are_words(table: StoredStudy, drawn: StoredStudy) -> None:
    figures = study_figures(table)
    labels = [figures["margin"].axes[0].get_xlabel(), figures["margin"].axes[0].get_ylabel()]
    assert labels == ["spring stiffness k, all joints\n[N m/rad]", "duration [s]"]
    assert {figure.get_suptitle() for figure in figures.values()} == {"study springs of vsa-3r: 9 runs, grid"}
    of_draws = study_figures(drawn)["margin"]
    assert of_draws.get_suptitle() == "study springs of vsa-3r: 6 runs, Latin hypercube samples"
    last = [axes.get_xlabel() for axes in of_draws.axes if axes.get_xlabel()]
    assert last == [f"spring stiffness k, {name}\n[N m/rad]" for name in ("base", "shoulder", "elbow")]
    assert compared_studies([table, drawn], ["a", "b"]).get_suptitle() == "comparison of 2 studies: ok runs"


def test_the_legend_of_a_map_has_what_is_drawn(table: StoredStudy) -> None:
    """Runs without a cost are hatched, so that they are none of the colors in gray either."""
    figure = study_figures(table)["margin"]
    assert texts(figure) == ["margin zero", "infeasible"]
    assert figure.axes[1].patch.get_hatch() == figure.legends[0].legend_handles[1].get_hatch()  # type: ignore[union-attr]
    np.testing.assert_array_equal(figure.axes[0].get_xticks(), [380, 400, 440])


def test_legends_name_the_points(drawn: StoredStudy) -> None:
    """Marks of each verdict, ok first, and numbers of the worst."""
    verdicts = sorted(set(drawn.texts("verdict")), key=lambda verdict: verdict != "ok")
    assert texts(study_figures(drawn)["margin"]) == [*verdicts, "runs of the smallest margins"]


@pytest.mark.slow
def test_optimized_runs_show_costs_before_and_after(own_folder: Path) -> None:
    """Their margin is the one that was required, which is no finding."""
    study(own_folder, "vary:\n  joints.*.actuator.spring.k: [400, 430]\noptimize: {minimize: torque}\n")
    assert run(["study", "study.yaml", "-q"]) == 0
    with StoredStudy("study.h5") as table:
        figure = study_figures(table)["cost"]
        before, after = (table.read(f"cost_{when}").max(axis=1) for when in ("before", "after"))
    (axes,) = figure.axes
    assert axes.get_ylabel() == "rms motor torque [N m]"
    assert texts(figure) == ["as commanded (1 of 2 feasible)", "optimum"]
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), before[np.isfinite(before)])
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), after)
    assert axes.lines[0].get_markerfacecolor() == "none"
    assert axes.lines[1].get_markerfacecolor() != "none"


def test_a_page_gives_intervals_of_random_draws_alone(table: StoredStudy, drawn: StoredStudy) -> None:
    pytest.importorskip("bokeh")
    page = study_page([table, drawn], [ReportText(""), ReportText("")])
    shares = re.findall(r'"shares": ?"([^"]*)"', page)
    assert [" to " in each for each in shares] == [False, True]
    assert '"spring stiffness k, all joints"' in page


@pytest.mark.slow
def test_figures_are_files(vsacli: Any, path: Path) -> None:
    shutil.copy(path, "again.h5")
    done = vsacli("plot", path, "again.h5", "--format", "svg", "-q")
    assert (done.code, [each.name for each in Path().glob("*.svg")]) == (0, ["study-again-compare.svg"])
    assert vsacli("plot", path, path.parent / "study.yaml").code == 2


@pytest.mark.slow
def test_nothing_to_draw(own_folder: Path) -> None:
    study(own_folder, "keep: [peak_tau_e]\n")
    assert run(["study", "study.yaml", "-q"]) == 0
    with StoredStudy("study.h5") as table, pytest.raises(InputError, match=r"no margin; put it into `keep:`"):
        study_figures(table)


LIMITED = (
    "method: random\nsamples: 10\nseed: 1\nvary:\n  joints.*.actuator.spring.k: {normal: 3 %}\n"
    "  joints.base.actuator.motor.max_torque: [90, 200]\n"
)


@pytest.fixture(scope="module")
def limited_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of ten random draws: some ok, some over a limit, and some infeasible."""
    return computed(tmp_path_factory.mktemp("limited"), LIMITED)


def test_runs_over_a_limit_are_counted_apart_from_ok_ones(limited_path: Path) -> None:
    """In legends, and in the Pareto front, where they are pale."""
    with StoredStudy(limited_path) as table:
        figures, verdicts = study_figures(table), table.texts("verdict")
        front = {verdicts[row] for row in StudyPoints(table).front}
    assert (set(verdicts), front) == ({"ok", "over_limit", "infeasible"}, {"ok"})
    percent = {verdict: f"{10 * verdicts.count(verdict)} %" for verdict in verdicts}
    ok, others = texts(figures["feasibility"])[0].split("\n")
    assert ok.startswith(f"ok {percent['ok']} (")
    assert {f"over limit {percent['over_limit']}", f"infeasible {percent['infeasible']}"} == set(
        others.split(", ")
    )
    assert {"ok", "over limit", "infeasible"} <= set(texts(figures["margin"]))
    alphas = {line.get_marker(): line.get_alpha() or 1 for line in figures["pareto"].axes[0].lines}
    assert alphas["^"] < alphas["o"] == 1


def test_a_page_counts_runs_over_a_limit_apart_and_names_the_limit(limited_path: Path) -> None:
    pytest.importorskip("bokeh")
    with StoredStudy(limited_path) as table:
        page, verdicts = study_page([table], [ReportText("")]), table.texts("verdict")
    (badge,) = re.findall(r'class="verdict fair">([^<]*)<', page)
    counts = {words: verdicts.count(words.replace(" ", "_")) for words in ("ok", "over limit", "infeasible")}
    assert set(badge.split(", ")) == {f"{count} {words}" for words, count in counts.items()}
    assert '"base motor_torque_limit"' in page


@pytest.mark.slow
def test_runs_over_a_limit_are_marked_on_a_map(own_folder: Path) -> None:
    """Their margin, alone, would look as if they were ok."""
    grid = (
        "vary:\n  joints.*.actuator.spring.k: [380, 390, 400]\n"
        "  joints.base.actuator.motor.max_torque: [80, 100, 200]\n"
    )
    with StoredStudy(computed(own_folder, grid)) as table:
        over = np.array(table.texts("verdict")) == "over_limit"
        figure = study_figures(table)["margin"]
        k, torque = (table.read(path)[over] for path in table.parameters)
    assert 0 < over.sum() < 9
    (marks,) = [line for line in figure.axes[0].lines if line.get_marker() == "^"]
    np.testing.assert_array_equal(np.stack(marks.get_data()), [k, torque])
    assert "over limit" in texts(figure)
