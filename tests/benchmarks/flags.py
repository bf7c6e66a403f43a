"""Print whether engines agree on flags: `python tests/benchmarks/flags.py`, on a million random demands.

Of every robot in `robots/`, with samples of all kinds: feasible, at an end of the attainable range, beyond.
Flags may differ where a sample lies within rounding of a threshold. It compiles each robot, which takes
minutes once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the samples of the tests

from markdown import table
from samples.engines import demands
from subjects import ROBOTS

from vsacli import Flag, load_robot
from vsacli.compute.engine import choose_engine
from vsacli.dynamics.inverse import InverseDynamics, compute_block


def compared(path: Path, samples: int) -> list[str]:
    """A row of the table: robot, demands on its joints, how many have flags, how many have others in C."""
    robot = load_robot(path)
    motion = demands(robot, samples)
    by_numpy = compute_block(robot, motion).flags
    engine = choose_engine("c", InverseDynamics(robot), samples, threads=1).engine
    by_c = compute_block(robot, motion, engine=engine).flags
    flagged, differing = np.count_nonzero(by_numpy), np.flatnonzero((by_numpy != by_c).ravel())
    bits = int(np.bitwise_or.reduce((by_numpy ^ by_c).ravel()))
    which = ", ".join(flag.label for flag in Flag if flag & bits)
    return [robot.name, f"{by_numpy.size:,}", f"{flagged:,}", f"{differing.size:,}", which]


def rows(total: int) -> Iterator[list[str]]:
    """Of all robots alike."""
    paths = sorted(path for path in ROBOTS.glob("*.yaml") if _is_robot(path))
    for path in paths:
        joints = len(load_robot(path).joints)
        yield compared(path, -(-total // (len(paths) * joints)))


def _is_robot(path: Path) -> bool:
    """Return whether a file is a robot whose inverse dynamics needs only a motion and a stiffness."""
    if "vsacli-robot/" not in path.read_text(encoding="utf-8"):
        return False
    return not any(joint.damper for joint in load_robot(path).joints)


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--demands", type=int, default=1_000_000, help="on joints, of all robots together")
    header = ("robot", "demands", "flagged", "other flags in C", "bits")
    sys.stdout.write(table(header, rows(parser.parse_args().demands)) + "\n")


if __name__ == "__main__":
    main()
