"""Print how right fourth derivatives of noisy records are: `python tests/benchmarks/derivatives.py`.

The table of docs/recorded.md, with seeds that no test has. It takes half an hour, with `--records 1` minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the samples of the tests

from samples.noisy_records import COLOURS, MOTIONS, Record, cyclic_sines, record

from vsacli.trajectory.fits import Fit, fit_samples

FIRST_SEED = 200
ENDS = 0.5
"""At each end, s, that does not count: there filters err too."""


class Outcome(NamedTuple):
    """How right one fit is.

    Attributes:
        error: of the fourth derivative, relative, root mean square.
        stated: deviation that the fit states, likewise; NaN if none.
        covered: share of the samples whose error is within twice the stated deviation.
        warned: whether the report warns of it.
    """

    error: float
    stated: float
    covered: float
    warned: bool

    @property
    def silent(self) -> bool:
        """Whether it is wrong by more than 10 % without a word."""
        return self.error > 0.1 and not self.warned


def outcome(of: Record) -> Outcome:
    """What the default makes of a record."""
    fit: Fit = fit_samples(of.time, of.values[None], 7, 4, None)
    inside = (of.time > ENDS) & (of.time < of.time[-1] - ENDS)
    time, truth = of.time[inside], of.truth[1][inside]
    error = fit.at(time, 5)[4, 0] - truth
    deviation = np.sqrt(fit.covariance(time)[0, 4, 4])
    size = np.sqrt(np.mean(truth**2))
    known = fit.parts[0].smoothing
    warned = known is not None and bool(not known.determined or known.lines.others)
    stated = np.sqrt(np.mean(deviation**2)) / size
    covered = np.mean(np.abs(error) < 2 * deviation)
    return Outcome(np.sqrt(np.mean(error**2)) / size, stated, covered, warned)


def cell(found: list[Outcome]) -> str:
    """Worst error, range of what is stated, in percent, and how many are warned of."""
    stated = [100 * each.stated for each in found if np.isfinite(each.stated)]
    text = f"{100 * max(each.error for each in found):.2g}"
    text += f" ({min(stated):.2g}-{max(stated):.2g})" if stated else " (-)"
    warned = sum(each.warned for each in found)
    return f"{text} *w*{warned}" if warned else text


def rows(records: int) -> Iterator[tuple[str, list[list[Outcome]]]]:
    """Each kind of noise, with the outcomes of each motion."""
    seeds = range(FIRST_SEED, FIRST_SEED + records)
    for colour in COLOURS:
        outcomes = [[outcome(record(each, colour, seed)) for seed in seeds] for each in MOTIONS.values()]
        yield colour, outcomes
    name = "first order 0.9"
    yield (
        f"{name}, 100 Hz",
        [[outcome(record(each, name, seed, 100)) for seed in seeds] for each in MOTIONS.values()],
    )
    cyclic = [outcome(record(cyclic_sines, "12-bit encoder", seed)) for seed in seeds]
    yield "12-bit encoder, repeated every second", [cyclic]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=5, help="of each motion and noise")
    records = parser.parse_args().records
    say = sys.stdout.write
    say(f"| noise | {' | '.join(MOTIONS)} | within two deviations |\n")
    say("| --- " * (len(MOTIONS) + 2) + "|\n")
    silent = 0
    for name, outcomes in rows(records):
        found = [each for cells in outcomes for each in cells]
        shown = [each.covered for each in found if np.isfinite(each.stated)]
        cells = " | ".join(cell(each) for each in outcomes) + " |" * (len(MOTIONS) - len(outcomes))
        say(f"| {name} | {cells} | {100 * np.mean(shown):.0f} % |\n")
        sys.stdout.flush()
        silent += sum(each.silent for each in found)
    say(f"\nwrong by more than 10 % without a warning: {silent}\n")


if __name__ == "__main__":
    main()
