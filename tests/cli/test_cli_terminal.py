"""Reports on a terminal: as wide as that is, the verdict in color; in a pipe neither."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from samples.command_line import REPOSITORY

fcntl, pty, termios = (pytest.importorskip(name) for name in ("fcntl", "pty", "termios"))

ROBOT, TRAJECTORY = "robots/vsa_3r.yaml", "trajectories/rest_to_rest.yaml"
COMMAND = [sys.executable, "-m", "vsacli"]
CHECK = ("check-feasibility", ROBOT, TRAJECTORY, "--set", "rate=20")
RED, GREEN, PLAIN = "\x1b[1;31m", "\x1b[1;32m", "\x1b[0m"


def on_terminal(columns: int, *arguments: str, **environment: str) -> str:
    """What a command shows on a terminal of so many columns, without what the terminal adds."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    known = {name: value for name, value in os.environ.items() if name not in {"NO_COLOR", "COLUMNS"}}
    done = subprocess.Popen(
        [*COMMAND, *arguments],
        stdout=theirs,
        stderr=subprocess.PIPE,
        cwd=REPOSITORY,
        env={**known, "TERM": "xterm", **environment},
    )
    os.close(theirs)
    shown = b""
    while chunk := _read(ours):
        shown += chunk
    os.close(ours)
    assert done.communicate()[1] == b""
    return shown.decode().replace("\r\n", "\n")


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # the other side has gone
        return b""


@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("columns", [40, 80, 200])
def test_a_report_is_as_wide_as_its_terminal(columns: int) -> None:
    wrong = (*CHECK, "--set", "stiffness.end=700")
    shown = on_terminal(columns, *wrong)
    assert shown.startswith(f"{RED}INFEASIBLE{PLAIN}  vsa-3r, rest-to-rest:")
    plain = shown.replace(RED, "").replace(PLAIN, "")
    assert max(map(len, plain.splitlines())) <= columns
    piped = subprocess.run(
        [*COMMAND, *wrong], capture_output=True, text=True, check=False, cwd=REPOSITORY
    ).stdout
    assert "\x1b" not in piped
    words = sorted(set(piped.split()))
    assert sorted({*plain.split()} - {"\\"}) == words  # nothing is left out; commands go on
    assert (plain == piped) == (columns == 200)


@pytest.mark.slow
def test_color_is_for_those_who_want_it() -> None:
    assert on_terminal(80, *CHECK).startswith(f"{GREEN}OK{PLAIN}  vsa-3r")
    assert "\x1b" not in on_terminal(80, *CHECK, NO_COLOR="1")
    assert "\x1b" not in on_terminal(80, *CHECK, TERM="dumb")
    assert GREEN in on_terminal(80, *CHECK, NO_COLOR="")  # empty is not set, see no-color.org


@pytest.mark.slow
def test_json_on_a_terminal_is_as_in_a_pipe() -> None:
    piped = subprocess.run(
        [*COMMAND, *CHECK, "--json"], capture_output=True, text=True, check=True, cwd=REPOSITORY
    ).stdout
    assert on_terminal(40, *CHECK, "--json") == piped


@pytest.mark.slow
def test_descriptions_are_fitted_too() -> None:
    shown = on_terminal(60, "info", ROBOT)
    assert max(map(len, shown.splitlines())) <= 60
    assert "\x1b" not in shown


@pytest.mark.slow
def test_names_do_not_act_on_a_terminal(tmp_path: Path) -> None:
    """An escape in a name is refused, or shown as one, whatever colors the verdict has."""
    wicked = tmp_path / "OK\x1b[32m.yaml"
    wicked.write_bytes((REPOSITORY / TRAJECTORY).read_bytes())
    shown = on_terminal(80, *CHECK[:2], str(wicked), "--set", "rate=20")
    assert "\x1b[32m" not in shown
