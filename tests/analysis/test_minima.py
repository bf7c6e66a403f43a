"""Minima of many functions at once, on functions whose minima are known."""

from __future__ import annotations

import numpy as np
import pytest

from vsacli.analysis.minima import (
    MINIMUM_ACCURACY,
    ROUNDING,
    ROUNDS,
    Brackets,
    SampledFunctions,
    find_brackets,
    narrow_brackets,
)

PLACES = np.linspace(-0.49, 0.49, 23)
"""Where the functions have their minima, between the samples -1, 0, 1."""

SHAPES = {
    "parabola": lambda t: 1 + 3 * t * t,
    "touching zero": lambda t: t * t,
    "through zero": lambda t: t * t - 1e-3,
    "quartic": lambda t: 0.1 + t**4,
    "kink": lambda t: 0.2 + np.abs(t),
    "jump": lambda t: np.where(t < 0, 1 - t, 0.5 + 3 * t),
    "steep peak": lambda t: -1 / (0.05 + np.abs(t)),
}
LEAST = {"parabola": 1, "touching zero": 0, "through zero": -1e-3, "quartic": 0.1, "kink": 0.2, "jump": 0.5}


@pytest.mark.parametrize("shape", SHAPES)
def test_minima_between_three_samples(shape: str) -> None:
    function, least = SHAPES[shape], LEAST.get(shape, -20.0)
    calls = []

    def evaluate(which: np.ndarray, times: np.ndarray) -> np.ndarray:
        calls.append(times.size)
        return function(times - PLACES[which][:, None])

    time = np.array([-1.0, 0.0, 1.0])
    given = find_brackets(
        SampledFunctions(0, np.tile(time, (len(PLACES), 1)), function(time - PLACES[:, None]))
    )
    found = narrow_brackets(given, evaluate, np.zeros(len(PLACES)))
    beside = 3 * (shape == "jump")  # whose lower side may show at the next sample
    assert len(found.function) == len(PLACES) - beside
    np.testing.assert_allclose(
        found.value[:, 1], least, rtol=0, atol=MINIMUM_ACCURACY * abs(least) + ROUNDING
    )
    assert len(calls) <= ROUNDS
    assert calls[-1] <= calls[0]


def test_what_is_known_is_not_computed() -> None:
    def evaluate(_: np.ndarray, __: np.ndarray) -> np.ndarray:
        raise AssertionError

    given = Brackets(np.array([0]), np.array([[0.0, 1.0, 2.0]]), np.array([[1.0005, 1.0, 1.0009]]))
    assert np.array_equal(narrow_brackets(given, evaluate, np.zeros(1)).time, given.time)


def test_local_minima_of_rows() -> None:
    values = np.array([[3, 2, 2, 4, 1, 5], [0, 1, 2, 1, 1, 1], [np.inf, 1, np.inf, 4, 5, np.inf]])
    found = find_brackets(SampledFunctions(0, np.tile(np.arange(6.0), (len(values), 1)), values))
    assert list(zip(found.function.tolist(), found.time[:, 1].tolist(), strict=True)) == [
        (0, 2.0), (0, 4.0), (2, 1.0), (2, 3.0),
    ]  # fmt: skip
    assert not found.unresolved(np.zeros(3))[2], "nothing is known of its neighbors"
