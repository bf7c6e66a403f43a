"""Measure vsacli beside its peers, all in one run: `python tests/benchmarks`.

Needs the extra `bench`, gcc, and the Debian packages of the tests on a Cortex-M7. `--write` puts what was
found into docs/performance.md and docs/codegen.md.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the oracles and samples of the tests

import actuation
import commands
import compiled
import controllers
import growth
import kernel
import page
import recorders
import sensitivities
import simulations
import single_calls
import small_numbers
import stages
import storage
import whole_runs
from machine import description
from subjects import ROOT

from vsacli.compute.engine.engines import SAMPLES_PER_PASS

PAGES = (ROOT / "docs" / "performance.md", ROOT / "docs" / "codegen.md")
FIGURE = ROOT / "docs" / "images" / "performance-growth.png"
PART = re.compile(r"(<!-- measured: (?P<name>\S+) -->\n).*?(<!-- end of measured part -->)", re.DOTALL)

SAMPLES = 200_000
PYTHON_SAMPLES = 5_000
ACTUATION_SAMPLES = 3 * SAMPLES_PER_PASS
LONG_RUN = 2_000_000


def measured(repeats: int, *, figure: Path) -> Iterator[tuple[str, str]]:
    """Name and text of each part of the page, as it is found."""
    yield "machine", description() + "\n"
    yield "kernel", page.kernel_table(kernel.compare(SAMPLES, PYTHON_SAMPLES, repeats))
    yield "batches", page.batch_table(compiled.batches(SAMPLES, repeats))
    yield "subnormals", page.subnormal_table(small_numbers.compare(SAMPLES, repeats))
    yield "calls", page.call_sentence(single_calls.calls_of_seven_joints())
    yield "recorders", page.recorder_table(recorders.compare(SAMPLES, repeats))
    yield "controllers", page.controller_table(controllers.measure())
    yield "costs", page.cost_table(compiled.costs())
    runs = (stages.split(SAMPLES, repeats, engine) for engine in ("numpy", "c"))
    yield "stages", page.stage_table(*runs)
    yield "storage", page.storage_table(storage.compare(repeats))
    yield "whole", page.whole_table(whole_runs.compare(2 * SAMPLES, repeats))
    yield "actuation", page.actuation_table(actuation.compare(ACTUATION_SAMPLES, 3 * repeats))
    yield "sensitivity", page.sensitivity_part(sensitivities.compare(3 * repeats))
    yield "simulations", page.simulation_table(simulations.compare(repeats))
    yield "startup", page.startup_table(commands.startup(3 * repeats))
    memory = commands.peak_memory(LONG_RUN) / 1e6
    yield (
        "memory",
        f"{LONG_RUN:,} samples with `--variables tau_motor,flags`: at most {memory:.0f} MB resident.",
    )
    found = growth.measure(repeats)
    growth.draw(found, figure)
    yield "growth", page.growth_sentence(found)


def main() -> None:
    """Run what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="rounds, of which the medians count")
    parser.add_argument("--write", action="store_true", help="write the results into the pages of docs")
    options = parser.parse_args()

    parts: dict[str, str] = {}
    for name, text in measured(options.repeats, figure=FIGURE if options.write else Path("growth.png")):
        sys.stdout.write(f"{name}\n\n{text}\n\n")
        sys.stdout.flush()
        parts[name] = text
    if options.write:
        rewrite(lambda name: parts[name])


def rewrite(part: Callable[[str], str]) -> None:
    """Put each part into its place on the pages."""
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        path.write_text(PART.sub(lambda m: f"{m[1]}\n{part(m['name'])}\n\n{m[3]}", text), encoding="utf-8")


if __name__ == "__main__":
    main()
