"""Simulations with the text of the equations of motion, as a recorded program, and compiled."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple
from unittest.mock import patch

from samples.shipped import shipped_run
from timing import Seconds, cpu_seconds, medians

from vsacli import Gains, InitialError, simulate
from vsacli.compute.engine import libraries
from vsacli.control.simulation import Simulation
from vsacli.control.simulation.loop_equations import RecordedEquations

TEXT, RECORDED, COMPILED = "text", "recorded", "compiled"


class Simulated(NamedTuple):
    """What a simulation takes.

    Attributes:
        name: of the case.
        duration: of the motion, s.
        evaluations: of the equations of motion.
        seconds: of processor time by way.
        first: seconds of a compiled run that has to compile.
    """

    name: str
    duration: float
    evaluations: int
    seconds: Seconds
    first: float


def compare(repeats: int) -> Iterator[Simulated]:
    """Time each case, with the three ways in turn; code is compiled before."""
    for name, run in _cases().items():
        ways = {
            TEXT: cpu_seconds(partial(_from_text, run)),
            RECORDED: cpu_seconds(partial(run, engine="numpy")),
            COMPILED: cpu_seconds(partial(run, engine="c")),
        }
        first, report = _first(run), run(engine="c").report
        yield Simulated(name, report.duration, report.evaluations, medians(ways, repeats), first)


def _cases() -> dict[str, Callable[..., Simulation]]:
    arm, seven = shipped_run("vsa_3r", "rest_to_rest"), shipped_run("lwr_7r_vsa", "lwr_7r")
    gains = Gains.from_poles([-20] * 4, [-20] * 2)
    fast = Gains.from_poles([-200] * 4, [-200] * 2)
    return {
        "3R, feedforward": partial(simulate, *arm),
        "3R, poles of -20/s": partial(simulate, *arm, gains=gains, initial_error=InitialError(0.01)),
        "3R, poles of -200/s": partial(simulate, *arm, gains=fast, initial_error=InitialError(0.001)),
        "3R, poles of -20/s, measured positions": partial(simulate, *arm, gains=gains, feedback="positions"),
        "7R, feedforward": partial(simulate, *seven),
        "7R, poles of -20/s": partial(simulate, *seven, gains=gains, initial_error=InitialError(0.01)),
    }


def _from_text(run: Callable[..., Simulation]) -> None:
    """Without anything recorded."""
    with patch.object(RecordedEquations, "_change_backend", lambda *_: None):
        run(engine="numpy")


def _first(run: Callable[..., Simulation]) -> float:
    """Seconds of a run that finds no compiled code."""
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, XDG_CACHE_HOME=folder):
        libraries._loaded_libraries.clear()
        begin = time.perf_counter()
        run(engine="c")
        return time.perf_counter() - begin
