"""Recorded signals next to their splines, and the spectra of both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vsacli import InputError, Trajectory
from vsacli.files.placeholder_robot import placeholder_robot
from vsacli.files.recordings.fit_curves import recorded_curves, table_profiles
from vsacli.results.charts.measured import RecordedCurve

RATE, DURATION, NOISE = 500, 10.0, 1e-4


def curve_of(values: np.ndarray, rate: float = RATE, **options: object) -> RecordedCurve:
    """The curve of one joint that was recorded at equal steps."""
    trajectory = Trajectory.from_samples(np.arange(len(values)) / rate, values[:, None], **options)
    return recorded_curves(trajectory.estimates.values(), ["revolute"], "a.csv")[0]


def sines(count: int = round(DURATION * RATE) + 1) -> np.ndarray:
    time = np.arange(count) / RATE
    return np.sin(2 * np.pi * 0.4 * time) + 0.2 * np.sin(2 * np.pi * 1.3 * time + 1)


@pytest.fixture(scope="module")
def noisy() -> RecordedCurve:
    """Two sines up to 1.3 Hz with white noise."""
    return curve_of(sines() + NOISE * np.random.default_rng(1).standard_normal(5001))


def test_the_residual_is_what_the_spline_leaves(noisy: RecordedCurve) -> None:
    fitted = np.interp(noisy.residual.time, noisy.fitted.time, noisy.fitted.values)
    recorded = np.interp(noisy.residual.time, noisy.recorded.time, noisy.recorded.values)
    # curves are reduced to visible detail, which leaves out samples between: of 5001 about every second
    assert np.mean(np.abs(recorded - fitted - noisy.residual.values) < 3 * NOISE) > 0.9
    assert noisy.rms == pytest.approx(NOISE, rel=0.05)  # 5001 samples: 1 %, three deviations and more
    assert noisy.noise == pytest.approx(NOISE, rel=0.05)
    assert noisy.fit == "smoothed"


def test_the_spectrum_of_white_noise_is_the_level_that_is_stated(noisy: RecordedCurve) -> None:
    spectrum = noisy.spectrum
    above = spectrum.frequencies > 20
    level = np.sqrt(np.average(spectrum.recorded[above] ** 2, weights=spectrum.frequencies[above]))
    assert level == pytest.approx(NOISE * np.sqrt(2 / RATE), rel=0.05)
    assert spectrum.noise == pytest.approx(level, rel=0.1)


def test_the_spline_follows_motion_to_the_cutoff_and_no_noise_behind(noisy: RecordedCurve) -> None:
    spectrum = noisy.spectrum
    assert 1.3 < spectrum.cutoff < 10
    behind = spectrum.frequencies > 3 * spectrum.cutoff
    assert np.all(spectrum.fitted[behind] < 0.01 * spectrum.recorded[behind])
    motion = spectrum.frequencies < 1.3
    np.testing.assert_allclose(spectrum.fitted[motion], spectrum.recorded[motion], rtol=0.02)


@pytest.mark.slow
def test_motion_does_not_leak_over_noise_of_a_billionth() -> None:
    noise = 1e-9 * np.random.default_rng(2).standard_normal(5001)
    spectrum = curve_of(sines() + noise, fit="interpolate").spectrum
    above = spectrum.frequencies > 20
    assert np.median(spectrum.recorded[above]) == pytest.approx(1e-9 * np.sqrt(2 / RATE), rel=0.1)


def test_a_spline_through_all_samples_leaves_nothing_and_has_no_cutoff() -> None:
    curve = curve_of(sines())
    assert (curve.fit, curve.rms) == ("interpolated", 0.0)
    assert not np.any(curve.residual.values)
    assert np.isnan(curve.spectrum.cutoff)
    assert (curve.highest.name, curve.highest.order, curve.highest.unit) == ("d4q", 4, "rad/s^4")
    assert np.isnan(curve.highest.deviation)


def test_uneven_stamps_show_the_same_noise() -> None:
    rng = np.random.default_rng(3)
    time = (np.arange(5001) + rng.uniform(-0.2, 0.2, 5001)) / RATE
    values = np.sin(2 * np.pi * 0.4 * time) + NOISE * rng.standard_normal(5001)
    trajectory = Trajectory.from_samples(time, values[:, None])
    (curve,) = recorded_curves(trajectory.estimates.values(), ["revolute"], "a.csv")
    spectrum = curve.spectrum
    middle = (spectrum.frequencies > 20) & (spectrum.frequencies < 80)  # interpolation damps the highest
    level = np.sqrt(np.mean(spectrum.recorded[middle] ** 2))
    assert level == pytest.approx(NOISE * np.sqrt(2 / RATE), rel=0.1)


@pytest.mark.parametrize("values", [np.full(200, 0.3), np.zeros(200)])
def test_a_joint_at_rest_has_no_spectrum(values: np.ndarray) -> None:
    assert not np.any(curve_of(values).spectrum.recorded)


def test_eight_samples_have_a_spectrum() -> None:
    frequencies = curve_of(sines(8)).spectrum.frequencies
    assert len(frequencies) > 1
    assert frequencies[-1] <= RATE / 2


def test_forces_and_moments_have_units_of_their_own() -> None:
    time = np.arange(101) / 100
    wrench = np.sin(time)[:, None] * np.arange(1.0, 7.0)
    trajectory = Trajectory.from_samples(time, np.cos(time)[:, None], wrench=wrench)
    curves = recorded_curves(trajectory.estimates.values(), ["prismatic"], "a.csv")
    assert [curve.unit for curve in curves] == ["m", "N", "N", "N", "N m", "N m", "N m"]


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Positions of two joints, 101 samples over 1 s, `log.csv`."""
    time = np.arange(101) / 100
    path = tmp_path / "log.csv"
    rows = np.array([time + 5, np.sin(time), np.cos(time)]).T
    np.savetxt(path, rows, delimiter=",", header="time,arm.q,hand.q", comments="")
    return path


def test_a_table_needs_no_signal_but_the_position(table: Path) -> None:
    profiles = table_profiles(str(table), placeholder_robot(table).robot)
    curves = recorded_curves(profiles, ["revolute"] * 2, table)
    assert [curve.name for curve in curves] == ["arm.q", "hand.q"]


def test_joints_and_times_are_chosen(table: Path) -> None:
    profiles = table_profiles(str(table), placeholder_robot(table).robot)
    (curve,) = recorded_curves(profiles, ["revolute"] * 2, table, ("hand",), (5.25, 5.5))
    assert (curve.name, len(curve.recorded.time)) == ("hand.q", 26)
    assert (curve.fitted.time[0], curve.fitted.time[-1]) == (5.25, 5.5)
    whole = recorded_curves(profiles, ["revolute"] * 2, table)[1]
    np.testing.assert_array_equal(curve.spectrum.recorded, whole.spectrum.recorded)


@pytest.mark.parametrize(
    ("joints", "span", "message"),
    [
        (("hnad",), (0, 9), r"log\.csv: has no joint 'hnad'; did you mean 'hand'\?"),
        ((), (7, 9), r"log\.csv: has no samples from t = 7 to 9 s; it spans 5 to "),
    ],
)
def test_what_is_not_there_is_refused(
    table: Path, joints: tuple[str, ...], span: tuple[float, float], message: str
) -> None:
    profiles = table_profiles(str(table), placeholder_robot(table).robot)
    with pytest.raises(InputError, match=message):
        recorded_curves(profiles, ["revolute"] * 2, table, joints, span)
