"""Command lines of a vsacli that knows a kind of actuator which is commanded by a pretension as well.

Run as a script: it registers the signal before anything else is imported, as a further signal would be, then
the kind; runs the command lines of a JSON list and prints a list of exit codes and outputs.
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


if __name__ == "__main__":
    COMMANDED[PRETENSION.key] = PRETENSION
    from vsacli import Antagonistic
    from vsacli.actuators.kinds import ACTUATORS
    from vsacli.cli.main import run

    class Pretensioned(Antagonistic):
        """Two motors behind nonlinear springs, commanded by a pretension that changes nothing."""

        commanded = (*Antagonistic.commanded, PRETENSION.key)

    ACTUATORS.homes["pretensioned"] = "__main__:Pretensioned"
    outcomes = []
    for line in json.load(sys.stdin):
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
            outcomes.append((int(run(line)), out.getvalue()))
    json.dump(outcomes, sys.stdout)
