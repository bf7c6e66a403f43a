"""Searches of recordings that are noise alone end early, and no motion that can be resolved is missed."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from samples.marks import slow_but
from samples.random_recordings import draw

from vsacli.trajectory.fits import resolution
from vsacli.trajectory.fits.penalized import enough_spans
from vsacli.trajectory.fits.resolution import KnownNoise, find_resolution
from vsacli.trajectory.fits.selection import fit_samples

RATE, SAMPLES = 1000.0, 8001
TIME = np.arange(SAMPLES) / RATE


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(SAMPLES)


def correlated(seed: int, correlation: float) -> np.ndarray:
    noise = white(seed)
    for index in range(1, SAMPLES):
        noise[index] += correlation * noise[index - 1]
    return noise


def normal(values: np.ndarray) -> np.ndarray:
    return (values - values.mean()) / values.std()


NOISES = {
    "white": white(1),
    "correlated": correlated(2, 0.9),
    "random walk": correlated(3, 1.0),
    "flickering encoder": np.round(0.3 * white(4) + 0.5),
}

MOTIONS = {
    "none": np.zeros(SAMPLES),
    "vibration": np.sin(2 * np.pi * 18 * TIME),
    "burst": np.exp(-(((TIME - 5) / 0.3) ** 2)) * np.sin(2 * np.pi * 12 * TIME),
    "sweep": np.sin(2 * np.pi * (0.5 * TIME + 1.5 * TIME**2)),
    "bump": np.exp(-(((TIME - 3) / 0.06) ** 2)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but({"white", "flickering encoder"}, NOISES))
def test_noise_alone_needs_no_fine_resolution(name: str, monkeypatch: pytest.MonkeyPatch):
    tried = []
    original = resolution.most_likely
    monkeypatch.setattr(resolution, "most_likely", lambda *args: tried.append(args) or original(*args))
    found = find_resolution(TIME, normal(NOISES[name]), 7, 4, KnownNoise())
    assert found is not None
    assert not found.accepted
    assert found.total > resolution.MAX_DEVIATION
    spans = [bins.spans for bins, _ in tried]
    assert max(spans) <= 1024  # of 2048, which takes as long as all others together


@pytest.fixture
def search_to_the_end(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Let no search end early from now on."""
    return lambda: monkeypatch.setattr(resolution, "enough_spans", lambda *_: np.inf)


@pytest.mark.slow
@pytest.mark.cases(2)
@pytest.mark.parametrize("case", list(product(["white", "random walk"], MOTIONS)), ids=" - ".join)
def test_what_is_resolved_is_the_same_without_an_early_end(
    case: tuple[str, str], search_to_the_end: Callable[[], None]
):
    noise, name = case
    step = 0.05 if noise == "random walk" else 1.0
    row = normal(10 * MOTIONS[name] + step * NOISES[noise])
    early = find_resolution(TIME, row, 7, 4, KnownNoise())
    search_to_the_end()
    late = find_resolution(TIME, row, 7, 4, KnownNoise())
    assert early is not None
    assert late is not None
    assert early.accepted == late.accepted
    if late.accepted:
        np.testing.assert_array_equal(early.model.coefficients, late.model.coefficients)
        assert early[1:] == late[1:]


@pytest.mark.slow
@pytest.mark.cases(2)
@pytest.mark.parametrize("seed", range(0, 120, 3))
def test_drawn_recordings_are_fitted_the_same_without_an_early_end(
    seed: int, search_to_the_end: Callable[[], None]
):
    drawn = draw(seed)
    rows = drawn.position.recorded[None]
    early = fit_samples(drawn.time, rows, 7, 4, None)
    search_to_the_end()
    late = fit_samples(drawn.time, rows, 7, 4, None)
    one, two = early.parts[0], late.parts[0]
    if two.smoothing is None or two.smoothing.resolved:
        np.testing.assert_array_equal(one.spline.c, two.spline.c)
        np.testing.assert_array_equal(early.noise, late.noise)
    assert (one.smoothing and one.smoothing.resolved) == (two.smoothing and two.smoothing.resolved)


def test_few_or_uneven_samples_are_searched_to_the_end():
    row = normal(white(1))
    assert np.isfinite(enough_spans(TIME, row))
    assert np.isinf(enough_spans(TIME[:1000], row[:1000]))
    gap = TIME + np.where(TIME > 3, 0.1, 0.0)
    assert np.isinf(enough_spans(gap, row))
    assert np.isinf(enough_spans(TIME, np.zeros(SAMPLES)))
