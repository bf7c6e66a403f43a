"""Random recordings with planted faults: a comparison finds the truth within its stated errors.

The constants of the comparison were set on seeds 1000 to 1099; these are others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from samples.compared import MOTIONS, Motion, Planted, computed_motion, random_recording

from vsacli import Comparison, compare

SEEDS = range(100)
QUICK = (1, 6, 16)
"""All of one motion, in which a joint holds still."""

FARTHEST = 5.0
"""Standard errors. Those of colored noise come from 24 cosines, and one of 2000 values of Student's t with 24
degrees of freedom is beyond 4.0; one test in a hundred would have a value beyond 5."""

BEYOND_THREE = 0.01
"""Share of gains and offsets beyond three errors: 0.3 % of normal ones, 0.6 % of Student's t."""

Found = tuple[Planted, Comparison]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Found]:
    """A comparison by its seed."""
    folder = tmp_path_factory.mktemp("compared")
    motions: dict[str, Motion] = {}

    def compared(seed: int) -> Found:
        name = list(MOTIONS)[seed % len(MOTIONS)]
        if name not in motions:
            motions[name] = computed_motion(name, folder)
        planted = random_recording(motions[name], folder / "recording.csv", seed)
        return planted, compare(motions[name].result, planted.path)

    return compared


def deviations(planted: Planted, comparison: Comparison) -> Iterator[float]:
    """Errors of gains and offsets of all columns that can be judged, in standard errors."""
    for signal in comparison.signals:
        if signal.column in planted.gains and not (signal.still and signal.column in planted.vague):
            yield (signal.gain - planted.gains[signal.column]) / signal.gain_error
            yield (signal.offset - planted.offsets[signal.column]) / signal.offset_error


def unexplained(planted: Planted, comparison: Comparison) -> list[str]:
    """Notes that name no planted fault, and columns that hold still though they move."""
    strange = []
    for note in comparison.notes:
        if " still as computed" in note:
            columns = note.partition(" hold")[0].split(", ")
            wrong = [each for each in columns if not planted.motion.still(each) and each not in planted.vague]
        else:
            wrong = [] if any(column in note for column in planted.faults) else [note]
        strange += wrong
    return strange


def missed(planted: Planted, comparison: Comparison) -> list[tuple[str, str]]:
    """Planted faults that no note names."""
    return [
        (column, words)
        for column, words in planted.faults.items()
        if column not in planted.vague
        and not any(column in note and words in note for note in comparison.notes)
    ]


def check(planted: Planted, comparison: Comparison) -> None:
    assert abs(comparison.time_offset - planted.time_offset) <= 3 * comparison.time_offset_error
    assert max(map(abs, deviations(planted, comparison)), default=0.0) <= FARTHEST
    assert missed(planted, comparison) == []
    assert unexplained(planted, comparison) == []
    for signal in comparison.signals:
        if planted.motion.still(signal.column):
            assert signal.still == "computed"
            assert np.isnan([signal.gain, signal.offset, signal.lag]).all()


@pytest.mark.parametrize("seed", QUICK)
def test_a_random_recording_is_compared_as_it_was_made(found: Callable[[int], Found], seed: int) -> None:
    check(*found(seed))


@pytest.mark.exhaustive
@pytest.mark.slow
def test_random_recordings_are_compared_as_they_were_made(found: Callable[[int], Found]) -> None:
    sizes, faults = [], 0
    for seed in SEEDS:
        planted, comparison = found(seed)
        check(planted, comparison)
        sizes += list(map(abs, deviations(planted, comparison)))
        faults += len(planted.faults)
    assert len(sizes) > 1500
    assert faults > 150
    assert np.mean(np.array(sizes) > 3) <= BEYOND_THREE
    assert np.sqrt(np.mean(np.square(sizes))) == pytest.approx(
        1.0, abs=0.2
    )  # neither too small nor too large
