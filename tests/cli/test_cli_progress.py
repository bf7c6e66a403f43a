"""The progress bar: for long work on a terminal, and nowhere else."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

import pytest
from samples.command_line import ROBOT, edited
from samples.excited import Excitation, excited

from vsacli import load_robot
from vsacli.cli.console import Talk

LONG = 100_000
"""Steps from which on a run takes seconds."""


class Terminal(io.StringIO):
    """What is written to a terminal."""

    def isatty(self) -> bool:
        return True


def bar_of(steps: int, *, quiet: bool = False) -> None:
    """Do some steps, which a bar may show."""
    with Talk(quiet=quiet, verbose=False).progress(steps) as bar:
        bar.update(steps // 2)
        bar.update(steps - steps // 2)
        assert bar.pos == steps


def test_long_work_has_a_bar() -> None:
    with redirect_stderr(Terminal()) as shown:
        bar_of(LONG)
    assert all(text in shown.getvalue() for text in ("computing", "50%", "100%"))


@pytest.mark.parametrize(("steps", "quiet"), [(LONG - 1, False), (LONG, True)])
def test_shorter_or_quiet_work_has_none(steps: int, quiet: bool) -> None:
    with redirect_stderr(Terminal()) as shown:
        bar_of(steps, quiet=quiet)
    assert shown.getvalue() == ""


def test_there_is_none_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    bar_of(LONG)
    assert capsys.readouterr().err == ""


def test_without_a_terminal_verbose_work_has_a_line_now_and_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = iter([100.0, 110.0, 131.0, 132.0, 165.0])
    monkeypatch.setattr("time.monotonic", lambda: next(now))
    with Talk(quiet=False, verbose=True).progress(4 * LONG, label="searching") as bar:
        for _ in range(4):
            bar.update(LONG)
    assert capsys.readouterr().err.splitlines() == [
        "searching: 200000 of 400000 (50 %) after 31 s",
        "searching: 400000 of 400000 (100 %) after 65 s",
    ]


def test_a_short_run_shows_none(vsacli: Callable[..., Any], motion: Path) -> None:
    with redirect_stderr(Terminal()) as shown:
        assert vsacli("invdyn", ROBOT, motion).code == 0
    assert shown.getvalue() == "wrote vsa_3r-move.h5\n"


def test_a_simulation_always_shows_one(vsacli: Callable[..., Any], motion: Path) -> None:
    edited(motion, motion, ("duration: 4.0", "duration: 0.5"))
    with redirect_stderr(Terminal()) as shown:
        assert vsacli("simulate", ROBOT, motion).code == 0
    assert "computing" in shown.getvalue()


@pytest.mark.slow
def test_searches_for_fixes_and_identifications_have_a_line_now_and_then_if_verbose(
    vsacli: Callable[..., Any], own_folder: Path, too_soft: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vsacli.cli.console.SECONDS_PER_LINE", 0.0)
    searched = vsacli("check-feasibility", ROBOT, too_soft, "--fixes", "-v")
    assert all(f"searching: {each} of 7 " in searched.err for each in range(1, 8))
    lab = load_robot(ROBOT)
    motion = Excitation(
        position=[0] * 3, reach=[0.4] * 3, stiffness=[1400] * 3, swing=[300] * 3, duration=6, rate=100
    )
    record = excited(lab, motion).noisy(seed=0).write(own_folder / "record.csv", lab)
    identified = vsacli("identify", ROBOT, record, "--fit", "springs,motors", "-v")
    assert all(f"identifying: {each} of 6 " in identified.err for each in range(1, 7))
    assert "identifying" not in vsacli("identify", ROBOT, record, "--fit", "springs,motors").err
