"""Figures that cannot mislead: failures by joint, legends with curves, missing curves with a reason."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from samples.command_line import REPOSITORY
from samples.figures import rest_to_rest
from samples.pages import Page

from vsacli import Flag
from vsacli.results.plots import compare_files, plot_stored
from vsacli.results.store.reader import open_stored


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def strips(axes: Axes) -> dict[tuple, tuple[float, float]]:
    """Span of time of each strip of infeasible samples, by color."""
    found = {}
    for collection in axes.collections:
        if collection.get_label() == "infeasible":
            (path,) = collection.get_paths()
            extents = path.get_extents()
            assert extents.height < 0.1
            found[tuple(collection.get_facecolor()[0][:3].round(2))] = (extents.x0, extents.x1)
    return found


def test_failures_of_one_joint_do_not_make_the_others_look_infeasible() -> None:
    result = rest_to_rest(401)
    result.read("flags")[100:151, 1] = Flag.INFEASIBLE
    axes = plot_stored(result)["elastic-torque"].axes[0]
    red = (0.85, 0.15, 0.11)
    assert list(strips(axes)) == [red]
    np.testing.assert_allclose(strips(axes)[red], (0.995, 1.505))


def test_strips_lie_below_all_curves() -> None:
    result = rest_to_rest(401)
    result.read("flags")[100:151] = Flag.INFEASIBLE
    axes = plot_stored(result)["elastic-torque"].axes[0]
    low, high = axes.get_ylim()
    top = max(
        path.get_extents().y1
        for collection in axes.collections
        if collection.get_label() == "infeasible"
        for path in collection.get_paths()
    )
    assert low + top * (high - low) < result.read("tau_e").min()


@pytest.mark.slow
def test_a_comparison_marks_failures_by_file() -> None:
    failing = rest_to_rest(401, path="b.h5")
    failing.read("flags")[100:151, 0] = Flag.INFEASIBLE
    base, *_ = compare_files([rest_to_rest(401), failing])["compare"].axes
    assert list(strips(base)) == [(0.85, 0.15, 0.11)]  # the look of the second file


def test_a_comparison_does_not_magnify_rounding(tmp_path: Path, feasible_result: Path) -> None:
    """Of one joint that differs, of one that differs by single precision, and of one that is equal."""
    other = shutil.copy(feasible_result, tmp_path / "other.h5")
    with h5py.File(other, "r+") as file:
        file["tau_motor"][:, 0] = np.float32(file["tau_motor"][:, 0])
        file["tau_motor"][:, 2] *= 1 + 1e-5
    with open_stored(feasible_result) as first, open_stored(other) as second:
        comparison = compare_files([first, second])["compare"]
        peaks = np.abs(first.read("tau_motor")).max(axis=0)
    differences = [axes for axes in comparison.axes if axes.get_title(loc="left").partition(" the first")[1]]
    titles = [axes.get_title(loc="left") for axes in differences]
    assert [re.sub(r"\d\S*", "#", title) for title in titles] == [
        *["equal to the first, rms # N m"] * 2,
        *["equal to the first"] * 2,
        *["minus the first, rms # N m"] * 2,
    ]
    for axes, peak in zip(differences, peaks.ravel(), strict=True):
        [line] = [line for line in axes.get_lines() if len(line.get_xdata()) > 2]
        largest, top = np.abs(line.get_ydata()).max(), axes.get_ylim()[1]
        if axes in differences[:4]:
            assert largest < 1e-4 * top  # a hundredth of the thickness of a line
            assert top == pytest.approx(0.01 * peak)
        else:
            assert largest > 0.5 * top


@pytest.mark.slow
def test_pages_do_not_magnify_rounding(vsacli: Callable, feasible_result: Path) -> None:
    shutil.copy(feasible_result, "other.h5")
    with h5py.File("other.h5", "r+") as file:
        file["q"][...] = np.float32(file["q"][...])
        file["tau_e"][:, 0] *= 1.01
    assert vsacli("plot", feasible_result, "other.h5", "-o", "both.html", "-q").code == 0
    page = Page(Path("both.html"))
    equal, other = (page.chart(name, "difference") for name in ("q", "tau_e"))
    assert equal["note"] == "equal within 1e-06 of the largest value"
    assert equal["shown"] == pytest.approx([-np.pi / 200, np.pi / 200])
    assert (other["note"], other["shown"]) == ("", None)


def test_a_joint_without_a_curve_is_not_in_the_legend() -> None:
    result = rest_to_rest(401)
    result.read("tau_e")[:, 1] = np.nan
    assert legend(plot_stored(result)["elastic-torque"]) == ["base", "elbow"]


def test_a_missing_curve_has_a_reason() -> None:
    result = rest_to_rest(401)
    result.read("tau_e")[:, 1:] = np.nan
    assert _texts(plot_stored(result)["elastic-torque"]) == ["undefined: shoulder, elbow"]
    result.read("flags")[0, 1] = Flag.INFEASIBLE
    result.read("tau_e")[:, 0] = np.nan
    figure = plot_stored(result)["elastic-torque"]
    assert _texts(figure) == ["undefined because of infeasible samples: base, shoulder, elbow"]
    assert not figure.axes[0].get_yticks().size


def _texts(figure: Figure) -> list[str]:
    return [text.get_text().replace("\n", " ") for text in figure.axes[0].texts]


@pytest.mark.slow
def test_folded_rows_of_different_length_stay_evenly_apart() -> None:
    figure = plot_stored(rest_to_rest(101, "R" * 7))["motion"]
    FigureCanvasAgg(figure).draw()
    tops = sorted({round(axes.get_position().y1, 3) for axes in figure.axes[1:]})
    assert len(tops) == 4
    np.testing.assert_allclose(np.diff(tops), np.diff(tops)[0], atol=0.005)  # rounded, and of a figure of 1


@pytest.mark.slow
def test_figures_of_a_simulation_say_controller_and_model_error(vsacli: Callable) -> None:
    arm, motion = (REPOSITORY / folder / "planar_2r.yaml" for folder in ("robots", "trajectories"))
    ran = vsacli("simulate", arm, motion, "--set", "rate=50", "--perturb", "5%", "-o", "sim.h5")
    assert ran.code in (0, 3)
    with open_stored("sim.h5") as stored:
        titles = {figure.get_suptitle() for figure in plot_stored(stored).values()}
    assert titles == {"planar-2r: simulation, feedforward, model error 5 %"}
