"""The paper's example in environments that a laboratory's machines have, and nobody wished for."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from samples.command_line import REST_TO_REST, ROBOT, contents, installed
from samples.marks import needs_compiler, slow, slow_but

Environment = Mapping[str, str | None]
"""Changes to the environment variables; None unsets one."""

NOTHING: Environment = {}

ENVIRONMENTS: dict[str, Environment] = {
    "a notebook's terminal": {"MPLBACKEND": "module://matplotlib_inline.backend_inline"},
    "no folder for temporary files": {"TMPDIR": "/nonexistent"},
    "no home": {"HOME": None},
    "a home that is no folder": {"HOME": "/dev/null"},
    "ASCII": {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    "a relative cache folder": {"XDG_CACHE_HOME": "cache"},
    "CC is no command": {"CC": "'"},
    "CC without NaN": {"CC": "cc -ffast-math"},
    "numbers of threads that are none": {"OMP_NUM_THREADS": "-1", "OPENBLAS_NUM_THREADS": "many"},
}

EXAMPLE = ("check-feasibility", ROBOT, REST_TO_REST)

COMMANDS: dict[str, tuple[object, ...]] = {
    "invdyn": ("invdyn", ROBOT, REST_TO_REST, "-o", "r.h5"),
    "invdyn --plot": ("invdyn", ROBOT, REST_TO_REST, "-o", "r.h5", "--plot", "figures"),
    "check-feasibility": EXAMPLE,
    "check-feasibility --plot": (*EXAMPLE, "--plot", "figures"),
}

QUICK = {("ASCII", "check-feasibility")}

UNWANTED = ("Traceback", "Warning", "bug")
"""In what is printed, the last as `vsacli` says it."""


def run(
    *arguments: object, folder: Path, changes: Environment = NOTHING, **options: Any
) -> tuple[int, str, str]:
    """Exit code, standard output and standard error in an environment; nothing that nobody asked for."""
    environment = {name: value for name, value in {**os.environ, **changes}.items() if value is not None}
    done = installed(*arguments, folder=folder, env=environment, **options)
    printed = f"{done.stdout}{done.stderr}"
    assert not [word for word in UNWANTED if word in printed], printed
    return done.returncode, done.stdout or "", done.stderr or ""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the example says anywhere else."""
    return installed(*EXAMPLE, folder=tmp_path_factory.mktemp("usual")).stdout


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", slow_but(QUICK, product(ENVIRONMENTS, COMMANDS)), ids=" - ".join)
def test_the_example_does_not_care(case: tuple[str, str], report: str, tmp_path: Path) -> None:
    environment, command = case
    code, out, _ = run(*COMMANDS[command], folder=tmp_path, changes=ENVIRONMENTS[environment])
    assert code == 0
    assert out.splitlines()[0] == report.splitlines()[0]
    assert bool(list(tmp_path.glob("figures/*.png"))) == ("--plot" in command)
    assert (tmp_path / "r.h5").is_file() == ("-o" in COMMANDS[command])


@pytest.mark.cases(1)
@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("cache", ["relative", "/dev/null/cache"])
def test_compiled_code_without_a_cache_folder_of_ones_own(cache: str, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    changes = {"XDG_CACHE_HOME": cache, "HOME": str(home), "TMPDIR": "/nonexistent"}
    code, _, err = run(*COMMANDS["invdyn"], "--engine", "c", folder=tmp_path, changes=changes)
    assert code == 0
    assert ("compiled code is not kept" in err) == cache.startswith("/dev")
    assert bool(list(home.glob(".cache/vsacli/*"))) == (cache == "relative")


def closing(*streams: int) -> Any:
    """What a shell does at `>&-`."""

    def close() -> None:
        for stream in streams:
            os.close(stream)

    return close


@pytest.mark.cases(2)
@pytest.mark.parametrize("streams", [slow((0,)), (1,), slow((2,)), slow((1, 2)), slow((0, 1, 2))], ids=str)
@pytest.mark.parametrize("command", ["invdyn", slow("invdyn --plot"), slow("check-feasibility")])
def test_closed_streams(command: str, streams: tuple[int, ...], tmp_path: Path) -> None:
    """The report is lost without a standard output, which the exit code says; the file is whole."""
    code, out, err = run(*COMMANDS[command], folder=tmp_path, preexec_fn=closing(*streams))
    assert code == (4 if 1 in streams else 0)
    assert (tmp_path / "r.h5").is_file() == ("-o" in COMMANDS[command])
    assert bool(out) == (1 not in streams)
    assert ("wrote" in err) == (not {1, 2} & set(streams) and "-o" in COMMANDS[command])


@pytest.mark.slow
@pytest.mark.parametrize("command", ["check-feasibility", slow("check-feasibility --fixes")])
def test_the_report_needs_no_disk(command: str, report: str, tmp_path: Path) -> None:
    arguments = (*EXAMPLE, *command.split()[1:])
    code, out, err = run(*arguments, folder=tmp_path, largest_file=0)
    assert (code, out.splitlines()[0], err) == (0, report.splitlines()[0], "")


NO_TEMPORARY = "folder for temporary files: cannot be used: No usable temporary directory"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (COMMANDS["invdyn"], 4, "r.h5: cannot be written: "),
        (COMMANDS["check-feasibility --plot"], 4, NO_TEMPORARY),
        (("new", "trajectory", "--robot", ROBOT), 4, NO_TEMPORARY),
        (("validate", "-"), 4, NO_TEMPORARY),
        pytest.param(
            (*COMMANDS["check-feasibility"], "--engine", "c"), 2, NO_TEMPORARY, marks=needs_compiler
        ),
    ],
)
def test_full_disks(arguments: tuple[object, ...], code: int, message: str, tmp_path: Path) -> None:
    here = tmp_path / "here"
    here.mkdir()
    with ROBOT.open() as robot:
        changes = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
        found, out, err = run(*arguments, folder=here, changes=changes, stdin=robot, largest_file=0)
    assert (found, out) == (code, "")
    assert err.splitlines()[-1].startswith(message)  # Matplotlib may have complained before
    assert not contents(here)


@pytest.mark.slow
def test_figures_without_a_folder_for_what_matplotlib_keeps(feasible_result: Path, tmp_path: Path) -> None:
    homeless = {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null", "XDG_CONFIG_HOME": "/dev/null"}
    changes = {**homeless, "MPLCONFIGDIR": None}
    found, out, err = run("plot", feasible_result, folder=tmp_path, changes=changes, largest_file=0)
    assert (found, out) == (4, "")
    assert err.splitlines()[-1].startswith(
        "figures: cannot be drawn: Matplotlib has no folder for its files;"
    )
    assert not contents(tmp_path)


EMPTY = {
    "invdyn -o": ("invdyn", ROBOT, REST_TO_REST, "-o", ""),
    "check-feasibility --plot": (*EXAMPLE, "--plot", ""),
    "plot -o": ("plot", "r.h5", "--output="),
    "codegen -o": ("codegen", ROBOT, "-o", ""),
    "examples --copy": ("examples", "--copy", ""),
    "new robot -o": ("new", "robot", "--joints", "R", "-o", ""),
    "validate": ("validate", ROBOT, ""),
    "info": ("info", ""),
}


@pytest.mark.parametrize("arguments", EMPTY.values(), ids=EMPTY)
def test_a_variable_of_the_shell_that_is_not_set(
    arguments: tuple[object, ...], vsacli: Any, tmp_path: Path
) -> None:
    done = vsacli(*arguments)
    assert (done.code, done.out) == (2, "")
    assert done.err.splitlines()[-1].endswith(" is empty; is a shell variable in the command unset?")
    assert not contents(tmp_path)
