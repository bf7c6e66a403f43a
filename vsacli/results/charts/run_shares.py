"""Verdicts of the runs of a study: their counts, and the share of runs that are ok, with its uncertainty.

Reports, figures and pages count each verdict apart, and use these words for it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.results.store.study_table import StoredStudy

OK = "ok"
"""Verdict of a run that is feasible, regular and within every limit."""

DRAWN = ("random", "latin_hypercube")
"""Methods whose runs are random draws, so that shares of runs estimate probabilities."""

NORMAL_95 = 1.96
"""Half-width of the 95 % interval of a normal distribution, in standard deviations."""


class Shares(NamedTuple):
    """Shares of runs, with the ends of their intervals of 95 % confidence; all arrays of one shape."""

    values: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, counts: FloatArray, runs: int) -> Shares:
        """Return the shares of counts in a number of runs, with Wilson's intervals (1927)."""
        values, square = counts / runs, NORMAL_95**2
        center = (values + square / (2 * runs)) / (1 + square / runs)
        spread = np.sqrt(values * (1 - values) / runs + square / (4 * runs**2))
        half = NORMAL_95 * spread / (1 + square / runs)
        return cls(values, np.maximum(0.0, center - half), np.minimum(1.0, center + half))


def count_verdicts(verdicts: Sequence[str]) -> dict[str, int]:
    """Return the number of runs by verdict: ok first, then the most frequent."""
    by_frequency = Counter(verdicts).most_common()
    return dict(sorted(by_frequency, key=lambda entry: entry[0] != OK))


def verdict_words(verdict: str) -> str:
    """Return a verdict as people read it."""
    return verdict.replace("_", " ")


def verdict_counts_text(counts: Mapping[str, int]) -> str:
    """Return how many runs have each verdict, such as `26 ok, 24 infeasible`."""
    return ", ".join(f"{count} {verdict_words(verdict)}" for verdict, count in counts.items())


def runs_are_independent(table: StoredStudy) -> bool:
    """Return whether the runs are independent random draws, so that shares of them have intervals."""
    # each trajectory has the same draws, so that runs of several are not independent
    drawn = str(table.attributes.get("method", "")) in DRAWN
    return drawn and len(set(table.texts("trajectory"))) == 1


def ok_share(counts: Mapping[str, int]) -> tuple[float, float, float]:
    """Return the share of ok runs, with its interval of 95 % confidence, which holds for random draws."""
    share, low, high = Shares.of(np.array(float(counts.get(OK, 0))), sum(counts.values()))
    return float(share), float(low), float(high)


def verdict_shares_lines(counts: Mapping[str, int], *, random: bool) -> list[str]:
    """Return the share of ok runs, with its interval for random draws, and those of other verdicts."""
    share, low, high = (100 * each for each in ok_share(counts))
    interval = f" ({low:.3g} to {high:.3g} %)" if random else ""
    percent = {verdict: 100 * count / sum(counts.values()) for verdict, count in counts.items()}
    others = [f"{verdict_words(verdict)} {percent[verdict]:.3g} %" for verdict in counts if verdict != OK]
    return [f"{OK} {share:.3g} %{interval}", *([", ".join(others)] if others else [])]
