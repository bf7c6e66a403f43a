"""Measure vsacli beside its peers, all in one run: `python tests/benchmarks`.

Needs the extra `bench`, gcc, and the Debian packages of the tests on a Cortex-M7; the part `gpu` is there
where CuPy finds a device. `--write` puts each part, as soon as it is there, into one of the `PAGES` of docs;
`--only growth,startup` measures parts.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the oracles and samples of the tests

import actuation
import commands
import compiled
import controllers
import device
import growth
import kernel
import one_sample
import optimizations
import page
import recorders
import sensitivities
import simulations
import single_calls
import small_numbers
import stages
import storage
import variants
import waits
import whole_runs
from machine import description
from subjects import ROOT

from vsacli.compute.engine.engines import SAMPLES_PER_PASS

PAGES = tuple(
    ROOT / "docs" / name
    for name in ("performance.md", "performance-notes.md", "codegen-performance.md", "gpu.md")
)
FIGURE = ROOT / "docs" / "images" / "performance-growth.png"
PART = re.compile(r"(<!-- measured: (?P<name>\S+) -->\n).*?(<!-- end of measured part -->)", re.DOTALL)

SAMPLES = 200_000
PYTHON_SAMPLES = 5_000
ACTUATION_SAMPLES = 3 * SAMPLES_PER_PASS
LONG_RUN = 2_000_000


def measured(repeats: int, figure: Path) -> dict[str, Callable[[], str]]:
    """What finds the text of each part of the pages, by its name."""

    def grown() -> str:
        found = growth.measure()
        growth.draw(found, figure)
        return page.growth_tables(found)

    def staged() -> str:
        return page.stage_table(*(stages.split(SAMPLES, repeats, engine) for engine in ("numpy", "c")))

    gpu = device.device_name()
    on_device = {"gpu": lambda: device.device_part(gpu, device.measure())} if gpu else {}
    return {
        **on_device,
        "machine": lambda: description() + "\n",
        "kernel": lambda: page.kernel_table(kernel.compare(SAMPLES, PYTHON_SAMPLES, repeats)),
        "batches": lambda: page.batch_table(compiled.batches(SAMPLES, repeats)),
        "variants": lambda: page.variant_table(variants.compare(repeats)),
        "subnormals": lambda: page.subnormal_table(small_numbers.compare(SAMPLES, repeats)),
        "samples": lambda: page.sample_part(*one_sample.compare(3 * repeats)),
        "calls": lambda: page.call_sentence(single_calls.calls_of_seven_joints()),
        "recorders": lambda: page.recorder_table(recorders.compare(SAMPLES, repeats)),
        "controllers": lambda: page.controller_table(controllers.measure()),
        "costs": lambda: page.cost_table(compiled.costs()),
        "stages": staged,
        "storage": lambda: page.storage_table(storage.compare(repeats)),
        "whole": lambda: page.whole_table(whole_runs.compare(2 * SAMPLES, 2 * repeats + 1)),
        "actuation": lambda: page.actuation_table(actuation.compare(ACTUATION_SAMPLES, 3 * repeats)),
        "sensitivity": lambda: page.sensitivity_part(sensitivities.compare(3 * repeats)),
        "search": lambda: page.search_table(optimizations.compare(3 * repeats)),
        "simulations": lambda: page.simulation_table(simulations.compare(repeats)),
        "startup": lambda: page.startup_table(commands.startup(3 * repeats)),
        "waits": lambda: page.waits_table(waits.compare(repeats)),
        "memory": lambda: page.memory_sentence(LONG_RUN, commands.peak_memory(LONG_RUN)),
        "growth": grown,
    }


def main() -> None:
    """Run what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="rounds, of which the medians count")
    parser.add_argument("--write", action="store_true", help="write the results into the pages of docs")
    parser.add_argument("--only", help="parts to measure, by name, with commas between; by default all")
    options = parser.parse_args()

    parts = measured(options.repeats, FIGURE if options.write else Path("growth.png"))
    chosen = options.only.split(",") if options.only else list(parts)
    if unknown := set(chosen) - parts.keys():
        parser.error(f"no part is called {', '.join(sorted(unknown))}; there are {', '.join(parts)}")
    for name in chosen:
        text = parts[name]()
        sys.stdout.write(f"{name}\n\n{text}\n\n")
        sys.stdout.flush()
        if options.write:
            rewrite(name, text)


def rewrite(name: str, text: str) -> None:
    """Put a part into its place on the pages."""
    for path in PAGES:
        before = path.read_text(encoding="utf-8")
        after = PART.sub(lambda m: f"{m[1]}\n{text}\n\n{m[3]}" if m["name"] == name else m[0], before)
        path.write_text(after, encoding="utf-8")


if __name__ == "__main__":
    main()
