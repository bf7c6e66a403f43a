"""Curves whose line would be a blot are drawn as what they span; others, and gaps, as they were."""

from __future__ import annotations

import numpy as np
import pytest
from samples.figures import rest_to_rest

from vsacli.results.charts.reduction import WIDE_COLUMNS, Curve, Envelope, read_curves
from vsacli.results.plots import plot_stored

NOISE = np.random.default_rng(1)


def curve(values: np.ndarray) -> Curve:
    return Curve.reduced(np.linspace(0.0, 4.0, values.size), values)


@pytest.mark.parametrize("samples", [800, 2401, 100_000])
def test_noise_has_an_envelope(samples: int) -> None:
    found = curve(NOISE.standard_normal(samples)).envelope
    assert found is not None
    assert found.time.size == WIDE_COLUMNS


@pytest.mark.parametrize(
    "shape",
    [
        lambda t: t**3,
        lambda t: np.sin(100 * np.pi * t / 2),  # 100 waves
        lambda t: np.where(t < 2, 0.0, 1.0),
        lambda t: 0 * t,
        lambda t: t + 1e-4 * NOISE.standard_normal(t.size),  # thinner than a line
        lambda t: np.where(np.arange(t.size) == 7777, 1e6, t),  # one spike
        lambda t: np.full_like(t, np.nan),
    ],
    ids=["smooth", "waves", "step", "constant", "faint", "spike", "nan"],
)
def test_others_are_lines(shape: object) -> None:
    assert curve(shape(np.linspace(0.0, 4.0, 20_001))).envelope is None


def test_an_envelope_holds_every_sample_and_its_mean() -> None:
    values = NOISE.standard_normal(50_000)
    values[12_345] = 40.0
    found = curve(values).envelope
    assert found is not None
    assert (found.low.min(), found.high.max()) == (values.min(), 40.0)
    # columns of 250 samples: their mean has a standard deviation of 0.063, and one of 200 lies within five
    assert np.abs(np.delete(found.mean, 12_345 // 250)).max() < 5 * 0.063


def test_an_envelope_has_the_gaps_of_its_curve() -> None:
    values = NOISE.standard_normal(50_000)
    values[10_000:20_000] = np.nan
    found = curve(values).envelope
    assert found is not None
    inside = (found.time > 0.81) & (found.time < 1.59)
    assert np.isnan(found.mean[inside]).all()
    assert np.isfinite(found.mean[found.time > 1.62]).all()


def test_blocks_of_a_long_result_are_joined() -> None:
    result = rest_to_rest(200_000, types="R")
    result.read("q")[:, 0] = NOISE.standard_normal(200_000)
    found = read_curves(result, ["q"])[0][0].envelope
    assert found is not None
    whole = curve(result.read("q")[:, 0]).envelope
    assert whole is not None
    # the columns are the same, and their sums taken alike
    for part, expected in zip(found, whole, strict=True):
        np.testing.assert_allclose(part, expected, rtol=1e-12)


def test_means_of_infinities_do_not_warn() -> None:
    values = np.array([np.inf, -np.inf, 1.0, 2.0])
    found = Envelope.of(np.arange(4.0), values, np.array([0, 2]))
    assert np.isnan(found.mean[0])
    assert found.mean[1] == 1.5


def test_a_noisy_result_says_what_its_bands_are() -> None:
    result = rest_to_rest(20_001)
    result.read("tau_motor")[...] += 5 * NOISE.standard_normal((20_001, 3, 2))
    figure = plot_stored(result, ["tau_motor"])["tau_motor"]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["base", "shoulder", "elbow", "smallest to largest"]
    assert len(figure.axes[0].collections) == 3
