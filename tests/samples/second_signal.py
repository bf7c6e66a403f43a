"""Command lines of a vsacli whose antagonistic joints are commanded by a pretension as well.

Run as a script: it registers the signal before anything else is imported, as a further signal would be, runs
the command lines of a JSON list and prints a list of exit codes and outputs.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys

from vsacli.base.signals import COMMANDED, Signal
from vsacli.base.units import Quantity

PRETENSION = Signal(
    key="pretension",
    names=("pretension", "dpretension", "ddpretension"),
    quantities=(Quantity("rad", "m"), Quantity("rad/s", "m/s"), Quantity("rad/s^2", "m/s^2")),
    long_names=("commanded pretension", "rate of the pretension", "second derivative of the pretension"),
    meaning="pretension of the springs",
    spline_degree=5,
    optional=True,
)


def run(lines: list[list[str]]) -> list[tuple[int, str]]:
    """Exit code and output of each command line."""
    COMMANDED[PRETENSION.key] = PRETENSION
    from vsacli.actuators.antagonistic import Antagonistic
    from vsacli.cli.main import run as vsacli

    Antagonistic.commanded = ("stiffness", PRETENSION.key)
    outcomes = []
    for line in lines:
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
            outcomes.append((int(vsacli(line)), out.getvalue()))
    return outcomes


if __name__ == "__main__":
    json.dump(run(json.load(sys.stdin)), sys.stdout)
