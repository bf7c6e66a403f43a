"""Long runs reduced to what a figure can show: extremes and gaps survive."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from samples.figures import rest_to_rest

from vsacli.results.charts.reduction import (
    BLOCK_SAMPLES,
    COLUMNS,
    FULL_DETAIL,
    column_starts,
    kept_samples,
    marked_spans,
    read_curves,
)

NAN = np.nan


@st.composite
def curves_with_gaps(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(draw(st.integers(0, 2**32)))
    samples = draw(st.integers(FULL_DETAIL, 4 * FULL_DETAIL))
    values = generator.standard_normal(samples)
    for start in generator.integers(0, samples, draw(st.integers(0, 30))):
        values[start : start + generator.integers(1, 40)] = NAN
    time = np.cumsum(generator.exponential(size=samples) ** draw(st.integers(0, 4)) + 1e-9)
    return time, values


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(curves_with_gaps())
def test_reduction_keeps_the_extremes_of_every_column(curve: tuple[np.ndarray, np.ndarray]) -> None:
    time, values = curve
    starts = column_starts(time)
    kept = kept_samples(values, starts)
    drawn = np.full_like(values, NAN)
    drawn[kept] = values[kept]
    for some, all_of_them in zip(np.split(drawn, starts[1:]), np.split(values, starts[1:]), strict=True):
        if not np.isnan(all_of_them).all():
            assert np.nanmin(some) == np.nanmin(all_of_them)
            assert np.nanmax(some) == np.nanmax(all_of_them)


def test_columns_are_equal_in_time_though_samples_are_not() -> None:
    time = np.concatenate([np.arange(0, 1, 1e-4), np.arange(1, 10.01, 1e-2)])
    starts = column_starts(time)
    spans = [column[-1] - column[0] for column in np.split(time, starts[1:])]
    assert starts[0] == 0
    assert max(spans) <= 10 / COLUMNS + 1e-12  # rounding of the times
    assert np.count_nonzero(starts < 10_000) == pytest.approx(COLUMNS / 10, abs=1)


@settings(max_examples=30, deadline=None)
@given(curves_with_gaps())
def test_reduction_bridges_no_gap_and_opens_none(curve: tuple[np.ndarray, np.ndarray]) -> None:
    time, values = curve
    kept = kept_samples(values, column_starts(time))
    for first, second in pairwise(kept):
        if np.isfinite(values[[first, second]]).all():
            assert np.isfinite(values[first : second + 1]).all()
    assert kept[0] == 0
    assert kept[-1] == values.size - 1


def test_alternating_gaps_do_not_defeat_the_reduction() -> None:
    values = np.where(np.arange(100_000) % 2, NAN, 1.0)
    kept = kept_samples(values, column_starts(np.arange(100_000.0)))
    assert kept.size <= 8 * COLUMNS  # first, last, two extremes, and a NaN after each
    assert np.isfinite(values[kept]).sum() >= COLUMNS


def test_short_runs_are_drawn_sample_by_sample() -> None:
    result = rest_to_rest(FULL_DETAIL)
    for joint, drawn in enumerate(read_curves(result, ["q"])):
        np.testing.assert_array_equal(drawn.time, result.time)
        np.testing.assert_array_equal(drawn.values[0], result.read("q")[:, joint])


def test_long_runs_are_read_in_blocks_and_reduced() -> None:
    result = rest_to_rest(3 * BLOCK_SAMPLES)
    result.read("tau_motor")[2 * BLOCK_SAMPLES, 1, 0] = 1e6
    result.read("tau_motor")[BLOCK_SAMPLES - 2 : BLOCK_SAMPLES + 2, 2] = NAN
    longest = 0

    def reading(name: str, start: int = 0, stop: int | None = None, read=result.read) -> np.ndarray:
        nonlocal longest
        longest = max(longest, stop - start)
        return read(name, start, stop)

    result.read = reading
    drawn = read_curves(result, ["tau_motor"])
    assert longest < 1.1 * BLOCK_SAMPLES  # a block ends with a column, here 164 samples
    assert all(np.all(np.diff(joint.time) > 0) for joint in drawn)
    assert all(joint.time.size <= 10 * COLUMNS for joint in drawn)
    assert drawn[1].values[0].max() == 1e6
    gap = (drawn[2].time >= result.time[BLOCK_SAMPLES - 2]) & (
        drawn[2].time <= result.time[BLOCK_SAMPLES + 1]
    )
    assert np.isnan(drawn[2].values[:, gap]).all()
    assert gap.any()


def test_a_marked_step_reaches_half_way_to_its_neighbors() -> None:
    time = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    marked = np.array([True, False, False, True, False])
    np.testing.assert_array_equal(marked_spans(time, marked), [[0.0, 0.5], [3.0, 4.5]])


def test_marked_steps_in_a_row_and_the_last_one_make_one_stretch() -> None:
    np.testing.assert_array_equal(
        marked_spans(np.arange(4.0), np.array([False, True, True, True])), [[0.5, 3.0]]
    )


def test_stretches_closer_than_a_pixel_column_are_joined() -> None:
    marked = np.arange(100_000) % 2 == 0
    marked[50_000:60_000] = False
    spans = marked_spans(np.arange(100_000.0), marked)
    np.testing.assert_allclose(spans, [[0, 49_998.5], [59_999.5, 99_998.5]])
