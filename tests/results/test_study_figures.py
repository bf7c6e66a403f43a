"""Figures of studies."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from samples.studies import study

from vsacli.base.errors import InputError
from vsacli.cli.main import run
from vsacli.results.charts.study_points import StudyPoints
from vsacli.results.plots import compared_studies, study_figures
from vsacli.results.store.study_table import StoredStudy

GRID = "vary:\n  joints.*.actuator.spring.k: [380, 400, 440]\n  duration: [3, 4, 5]\n"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of nine runs, three of which are infeasible."""
    folder = tmp_path_factory.mktemp("figures")
    study(folder, GRID)
    with contextlib.chdir(folder):
        assert run(["study", "study.yaml", "-q"]) == 0
    return folder / "study.h5"


@pytest.fixture
def table(path: Path) -> Iterator[StoredStudy]:
    with StoredStudy(path) as opened:
        yield opened


def test_the_front_has_the_runs_of_which_none_is_better_in_both(table: StoredStudy) -> None:
    points = StudyPoints(table)
    assert points.cost is not None
    cost, fine = points.cost[1], points.feasible
    np.testing.assert_array_equal(np.isnan(cost), ~fine)

    def beaten(row: int) -> bool:
        other = fine & (points.margin >= points.margin[row]) & (cost <= cost[row])
        return bool((other & ((points.margin > points.margin[row]) | (cost < cost[row]))).any())

    assert sorted(points.front) == [row for row in np.flatnonzero(fine) if not beaten(row)]
    assert set(points.worst) == set(np.argsort(points.margin)[:3])


def test_two_numbers_on_a_grid_are_a_map(table: StoredStudy) -> None:
    """Each value of the margin stands at its two numbers."""
    figures = study_figures(table)
    assert set(figures) == {"feasibility", "margin", "pareto"}
    mesh = next(each for each in figures["margin"].axes[0].collections if isinstance(each, QuadMesh))
    shown = np.asarray(mesh.get_array()).reshape(3, 3)  # durations upwards, springs across
    margin = 100 * table.read("margin").min(axis=1).reshape(3, 3)
    np.testing.assert_array_equal(shown, margin.T)


def test_shares_fall_from_all_runs_at_their_margins(table: StoredStudy) -> None:
    axes = compared_studies([table, table], ["one", "two"]).axes[0]
    margin, share = map(np.asarray, axes.lines[0].get_data())
    for at in (-10.0, 0.0, 3.0):
        expected = 100 * (100 * table.read("margin").min(axis=1) >= at).mean()
        place = np.searchsorted(np.asarray(margin), at)
        assert (np.asarray(share)[place] if place < len(np.asarray(share)) else 0.0) == pytest.approx(
            expected
        )
    labels = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert labels == ["one: 66.7 % (35.4 to 87.9 %)", "two: 66.7 % (35.4 to 87.9 %)"]  # of 6 in 9 (Wilson)


@pytest.mark.slow
def test_figures_are_files(vsacli: Any, path: Path) -> None:
    done = vsacli("plot", path, path.parent / "study.h5", "--format", "svg", "-q")
    assert (done.code, [each.name for each in Path().glob("*.svg")]) == (0, ["study-study-compare.svg"])
    assert vsacli("plot", path, path.parent / "study.yaml").code == 2


@pytest.mark.slow
def test_nothing_to_draw(own_folder: Path) -> None:
    study(own_folder, "keep: [peak_tau_e]\n")
    assert run(["study", "study.yaml", "-q"]) == 0
    with StoredStudy("study.h5") as table, pytest.raises(InputError, match=r"no margin; put it into `keep:`"):
        study_figures(table)
