"""Print how right d4q and torques of noisy records are: `python tests/benchmarks/torques.py results.jsonl`.

The tables behind docs/recorded.md, with more columns. Each record adds lines to the file as it is done,
seeds one after the other; those that are there are not done again. All take an hour, `--records 1` minutes,
`--records 0` no time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from itertools import groupby, product
from pathlib import Path
from typing import NamedTuple

import json_lines
import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the samples of the tests

from samples.noisy_records import COLORS, MOTIONS
from samples.recorded_torques import ARMS, Error, Outcome, outcomes

FIRST_SEED = 70
RATES = (250, 1000, 2000)
"""Hz."""

ALLOWED, FALSE = 0.1, 0.05
"""Errors beyond which a run is wrong, and below which a doubt of it is a false alarm."""


SMOOTH = tuple(MOTIONS)[:4]
"""Motions without fast parts."""


class Of(NamedTuple):
    """What a record is made of."""

    seed: int
    rate: int
    motion: str
    color: str


Found = list[tuple[Of, Outcome]]


def read(path: Path) -> Found:
    """What was found before."""
    return [
        (Of(*of), Outcome(**{**it, "torque": Error(*it["torque"]), "fourth": Error(*it["fourth"])}))
        for of, it in json_lines.read(path)
    ]


def run(path: Path, records: int) -> None:
    """Add what is not there yet."""
    done = {of for of, _ in read(path)}
    seeds = range(FIRST_SEED, FIRST_SEED + records)
    for of in (Of(*each) for each in product(seeds, RATES, MOTIONS, COLORS)):
        if of not in done:
            found = outcomes(of.motion, of.color, of.seed, of.rate)
            json_lines.add(path, [(of, each._asdict()) for each in found])


def percent(values: Iterable[float]) -> str:
    """The largest; a dash if there is none."""
    largest = max(values, default=np.nan)
    return "-" if np.isnan(largest) else f"{100 * largest:.2g}"


def judged(errors: list[float], doubted: list[bool]) -> str:
    """Number, median and largest error, the largest without a doubt, doubts, and how many are false."""
    passed = [error for error, doubt in zip(errors, doubted, strict=True) if not doubt]
    false = sum(doubt and error < FALSE for error, doubt in zip(errors, doubted, strict=True))
    typical = f"{100 * np.median(errors):.2g}, {percent(errors)}"
    return f"{len(errors)} | {typical} | {percent(passed)} | {sum(doubted)} | {false}"


def cell(runs: list[Outcome]) -> str:
    """Worst error of d4q, what deviations are stated, in percent, and how many are warned of."""
    stated = [each.fourth.stated for each in runs if not np.isnan(each.fourth.stated)]
    between = f"{100 * min(stated):.2g}-{percent(stated)}" if stated else "-"
    warned = sum(each.warned for each in runs)
    text = f"{percent(each.fourth.size for each in runs)} ({between})"
    return f"{text} *w*{warned}/{len(runs)}" if warned else text


def covered(errors: list[Error]) -> str:
    """Share of the steps within two deviations, mean and least, in percent."""
    shares = [100 * each.covered for each in errors if not np.isnan(each.covered)]
    return f"{np.mean(shares):.0f} ({min(shares):.0f})" if shares else "-"


def of_derivatives(found: Found) -> Iterator[str]:
    """Cells by noise and motion."""
    yield f"| noise | {' | '.join(MOTIONS)} |"
    yield "| --- " * (len(MOTIONS) + 1) + "|"
    for color in COLORS:
        of_color = [each for each in found[:: len(ARMS)] if each[0].color == color]
        runs = [[each for of, each in of_color if of.motion == motion] for motion in MOTIONS]
        yield f"| {color} | {' | '.join(cell(each) if each else '' for each in runs)} |"


def of_motions(found: Found) -> Iterator[str]:
    """How right torques and d4q are, by motion and arm."""
    yield "| motion | of | records | median and largest error | without a doubt | doubted | false |"
    yield "| --- " * 7 + "|"
    for motion in MOTIONS:
        of_motion = [each for of, each in found if of.motion == motion]
        for arm in ARMS:
            runs = [each for each in of_motion if each.arm == arm]
            if runs:
                doubted = [each.verdict == "unreliable" for each in runs]
                yield f"| {motion} | {arm} | {judged([each.torque.size for each in runs], doubted)} |"
        runs = of_motion[:: len(ARMS)]
        if runs:
            errors, warned = [each.fourth.size for each in runs], [each.warned for each in runs]
            yield f"| {motion} | d4q | {judged(errors, warned)} |"


def of_colors(found: Found) -> Iterator[str]:
    """How right deviations and verdicts are, by noise."""
    yield f"| noise | d4q | {' | '.join(ARMS)} | wrong, no doubt | right, no doubt |"
    yield "| --- " * (len(ARMS) + 4) + "|"
    by_color = sorted(found, key=lambda each: list(COLORS).index(each[0].color))
    for color, group in groupby(by_color, key=lambda each: each[0].color):
        rows = list(group)
        runs = [each for _, each in rows]
        errors = [[each.fourth for each in runs[:: len(ARMS)]]]
        errors += [[each.torque for each in runs if each.arm == arm] for arm in ARMS]
        smooth = [each for of, each in rows if of.motion in SMOOTH]
        right = [each.verdict != "unreliable" for each in smooth if each.torque.size < FALSE]
        wrong = sum(each.verdict != "unreliable" and each.torque.size > ALLOWED for each in runs)
        yield f"| {color} | {' | '.join(map(covered, errors))} | {wrong} | {100 * np.mean(right):.0f} % |"


def main() -> None:
    """Add records to a file, and print the tables of all that are in it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="JSON lines, of each record and arm")
    parser.add_argument("--records", type=int, default=5, help="of each motion, noise and rate")
    given = parser.parse_args()
    run(given.results, given.records)
    found = read(given.results)
    for table in (of_derivatives, of_motions, of_colors):
        sys.stdout.write("\n".join(table(found)) + "\n\n")


if __name__ == "__main__":
    main()
