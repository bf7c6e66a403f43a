"""Judge vsacli on random recordings.

    python tests/benchmarks/recordings.py --seeds design --count 200 results.jsonl

`samples.random_recordings` draws them: even seeds are the design half, odd seeds the unseen half. Each
recording adds a line to the file as soon as it is done; those that have a line are not repeated. One
takes some 3 s. The oracle is a smoother that knows filter and noise, see `oracles.wiener`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import json_lines

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the samples and oracles of the tests

from oracles.wiener import attainable_error
from samples.laboratory_filters import FAMILIES
from samples.random_recordings import draw
from samples.recorded_torques import judge

FIRST = {"design": 0, "unseen": 1}
"""Seeds go on from there in steps of two."""

ALLOWED, ALLOWED_DEVIATIONS = 0.1, 10.0
"""Errors of tau_motor beyond which a run is wrong: relative to the torque, and to the stated deviation."""


class Judged(NamedTuple):
    """A recording and what came of it.

    Attributes:
        seed: of the recording.
        family: of its filter.
        facts: how it was made, for people.
        attainable: error of the oracle.
        verdict: of vsacli.
        error: of tau_motor.
        deviations: error over what was stated; NaN if nothing was.
        stated: deviation of tau_motor relative to its root mean square; NaN if none is stated.
    """

    seed: int
    family: str
    facts: str
    attainable: float
    verdict: str
    error: float
    deviations: float
    stated: float

    @property
    def wrong(self) -> bool:
        """Whether it is said to be right and is not."""
        return self.verdict == "ok" and not self.error <= ALLOWED

    @property
    def overconfident(self) -> bool:
        """Whether it is said to be right with a deviation that is far too small."""
        return self.verdict == "ok" and self.deviations > ALLOWED_DEVIATIONS

    @property
    def within_reach(self) -> bool:
        """Whether the oracle is right."""
        return self.attainable <= ALLOWED


def judged(seed: int) -> Judged:
    """Draw a recording, have the oracle and vsacli smooth it, and compare both with the truth."""
    recording = draw(seed)
    found = judge(recording)
    ratio = found.torque.size / found.torque.stated
    return Judged(
        seed,
        recording.filter.family,
        recording.facts,
        attainable_error(recording),
        found.verdict,
        found.torque.size,
        ratio,
        found.torque.stated,
    )


def run(path: Path, seeds: Iterable[int]) -> None:
    """Add what is not there yet."""
    done = {seed for seed, *_ in json_lines.read(path)}
    for seed in seeds:
        if seed not in done:
            json_lines.add(path, [judged(seed)])


def table(found: list[Judged]) -> Iterator[str]:
    """Yield rows by filter family, and one of all."""
    yield "| filter | recordings | OK | wrong under OK | beyond 10 deviations | attainable | OK of these |"
    yield "| --- " * 7 + "|"
    for family in FAMILIES:
        yield row(family, [each for each in found if each.family == family])
    yield row("all", found)


def row(name: str, of: list[Judged]) -> str:
    """Return a row of the table."""
    within = [each for each in of if each.within_reach]
    passed = sum(each.verdict == "ok" for each in within)
    share = f"{passed} ({100 * passed / len(within):.0f} %)" if within else "-"
    ok, wrong = sum(each.verdict == "ok" for each in of), sum(each.wrong for each in of)
    overconfident = sum(each.overconfident for each in of)
    return f"| {name} | {len(of)} | {ok} | {wrong} | {overconfident} | {len(within)} | {share} |"


def listed(found: list[Judged]) -> Iterator[str]:
    """Yield a line for each recording that is wrong under OK, or attainable and not OK."""
    for title, chosen in (
        (
            "wrong, or beyond 10 deviations, under OK",
            [each for each in found if each.wrong or each.overconfident],
        ),
        ("attainable and not OK", [each for each in found if each.within_reach and each.verdict != "ok"]),
    ):
        yield f"\n{title}:"
        for each in chosen:
            yield (
                f"  {each.seed}: {each.verdict}, off by {100 * each.error:.3g} %, "
                f"{each.deviations:.3g} deviations, oracle {100 * each.attainable:.2g} %: {each.facts}"
            )


def main() -> None:
    """Add recordings to a file, and print what all of these seeds in it show."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="JSON lines, one a recording")
    parser.add_argument("--seeds", choices=FIRST, required=True, help="half of the seeds")
    parser.add_argument("--count", type=int, default=200, help="of recordings")
    parser.add_argument("--quiet", action="store_true", help="only the table")
    given = parser.parse_args()
    seeds = list(range(FIRST[given.seeds], 2 * given.count, 2))
    run(given.results, seeds)
    found = [Judged(*each) for each in json_lines.read(given.results) if each[0] in set(seeds)]
    lines = table(found) if given.quiet else (*table(found), *listed(found))
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
