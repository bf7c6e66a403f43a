"""Figures of recorded signals and the splines that stand for them."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.patches import Patch
from samples.figure_inputs import FREQUENCIES, TIME, curve

from vsacli.results.charts.measured import AmplitudeSpectrum
from vsacli.results.charts.reduction import Curve
from vsacli.results.plots import recorded_figure


@pytest.mark.slow
def test_each_component_has_four_panels() -> None:
    figure = recorded_figure([curve(), curve("wrist.q", rms=0.0, cutoff=np.nan)], "log")
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    smoothed = ["elbow.q", "smoothed, noise 0.0001 rad", "motion to 5 Hz, 65 knots", "d4q +- 1.2 %"]
    assert titles == [
        *smoothed,
        "wrist.q",
        "interpolated, noise 0.0001 rad",
        "motion at all frequencies",
        "d4q",
    ]
    units = [axes.get_ylabel() for axes in figure.axes[:4]]
    assert units == ["[rad]", "", r"[rad/$\sqrt{\mathrm{Hz}}$]", r"[rad/s^4/$\sqrt{\mathrm{Hz}}$]"]
    assert [axes.get_xlabel() for axes in figure.axes[4:]] == ["time [s]"] * 2 + ["frequency [Hz]"] * 2


def test_the_legend_names_every_curve_and_area() -> None:
    """Areas differ by their hatch too, so that they do in gray."""
    figure = recorded_figure([curve(above=2.0)], "log")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [
        "recorded",
        "spline",
        "reported noise (difference: twice)",
        "ends: derivatives unreliable",
        "recorded minus spline",
        "frequencies of the motion",
        "low-pass filtered noise",
        "cut-off of the spline",
    ]
    areas = [handle for handle in figure.legends[0].legend_handles if isinstance(handle, Patch)]
    assert len({area.get_hatch() for area in areas}) == len(areas)
    whole = recorded_figure([curve(rms=0.0, cutoff=np.nan)._replace(inside=(0.0, 10.0))], "log")
    assert "ends: derivatives unreliable" not in [text.get_text() for text in whole.legends[0].get_texts()]


def test_the_report_s_numbers_are_drawn_where_they_belong() -> None:
    _, residual, spectrum, highest = recorded_figure([curve()], "log").axes
    levels = {line.get_ydata()[0] for line in residual.lines if len(set(line.get_ydata())) == 1}
    assert {-2e-4, 2e-4} <= levels
    shaded = [patch.get_extents().transformed(residual.transData.inverted()) for patch in residual.patches]
    np.testing.assert_allclose([(box.x0, box.x1) for box in shaded], [(0, 0.5), (9, 10)], atol=1e-9)
    for axes, factor in ((spectrum, 1.0), (highest, (2 * np.pi * FREQUENCIES) ** 4)):
        np.testing.assert_allclose(axes.lines[2].get_ydata(), 1e-5 * factor * np.ones(50))
        assert list(axes.lines[3].get_xdata()) == [5.0, 5.0]
        (band,) = axes.patches
        assert band.get_extents().transformed(axes.transData.inverted()).x1 == pytest.approx(5.0)


def test_noise_that_a_filter_made_smooth_is_no_band_of_the_motion() -> None:
    _, _, spectrum, _ = recorded_figure([curve(above=2.0)], "log").axes
    ends = [patch.get_extents().transformed(spectrum.transData.inverted()) for patch in spectrum.patches]
    assert [end.x1 for end in ends] == pytest.approx([2.0, 5.0])
    assert spectrum.get_title(loc="left") == "motion to 2 Hz, 65 knots"


def test_the_highest_derivative_is_weighed_by_the_frequency() -> None:
    _, _, spectrum, highest = recorded_figure([curve()], "log").axes
    ratio = highest.lines[0].get_ydata() / spectrum.lines[0].get_ydata()
    np.testing.assert_allclose(ratio, (2 * np.pi * FREQUENCIES) ** 4)


def test_a_spline_through_all_samples_has_no_band_and_no_residual() -> None:
    _, residual, spectrum, _ = recorded_figure([curve(rms=0.0, cutoff=np.nan)], "log").axes
    assert list(residual.get_yticks()) == [0.0]
    assert not spectrum.patches


@pytest.mark.slow
def test_a_joint_at_rest_is_said_to_be_so() -> None:
    nothing = AmplitudeSpectrum(FREQUENCIES, np.zeros(50), np.zeros(50), 1e-18, np.nan, np.nan)
    still = Curve(TIME, np.full(400, 0.3))
    rest = curve(rms=0.0)._replace(recorded=still, fitted=still, spectrum=nothing)
    signal, _, spectrum, _ = recorded_figure([rest], "log").axes
    assert spectrum.get_title(loc="left") == "at rest"
    assert signal.get_ylim() == pytest.approx((0.27, 0.33))


@pytest.mark.slow
def test_many_joints_begin_again_beside_the_first() -> None:
    figure = recorded_figure([curve(f"j{number}.q") for number in range(15)], "log")
    assert len(figure.axes) == 60
    columns = {round(axes.get_subplotspec().colspan.start) for axes in figure.axes}
    assert columns == set(range(8))
