"""Times of several ways to do one thing, taken in turn: a slow minute of the machine hits all alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping

Seconds = dict[str, float]
"""Median seconds by name."""


def medians(ways: Mapping[str, Callable[[], object]], repeats: int) -> Seconds:
    """Median time of each way over `repeats` rounds, after one that is not counted."""
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(repeats + 1):
        for name, way in ways.items():
            begin = time.perf_counter()
            reported = way()
            elapsed = time.perf_counter() - begin
            if turn:
                taken[name].append(reported if isinstance(reported, float) else elapsed)
    return {name: statistics.median(times) for name, times in taken.items()}


def cpu_seconds(way: Callable[[], object], rounds: int = 1) -> Callable[[], float]:
    """A way that reports seconds of processor time, in which other programs do not count; mean of rounds."""

    def timed() -> float:
        begin = time.process_time()
        for _ in range(rounds):
            way()
        return (time.process_time() - begin) / rounds

    return timed
