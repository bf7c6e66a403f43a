"""Running the command line inside the test process."""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import os
import signal
import tempfile
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest
from samples.command_line import ROBOT, Outcome, rest_to_rest
from samples.marks import spread
from samples.system_errors import fail_with

from vsacli.cli.main import run


def pytest_collection() -> None:
    """Look for no garbage while tests are imported and collected: there is hardly any."""
    gc.disable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark slow cases of a test as exhaustive beyond the number in its mark `cases`."""
    cases: defaultdict[object, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker("cases") and item.get_closest_marker("slow"):
            cases[item.nodeid.partition("[")[0]].append(item)
    for found in cases.values():
        kept = spread(found, found[0].get_closest_marker("cases").args[0])
        for item in found:
            if item not in kept:
                item.add_marker("exhaustive")


def pytest_collection_finish() -> None:
    """Exclude what has been imported and collected from garbage collections: it stays to the end."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _interrupts() -> None:
    """A shell has what it starts in the background ignore Ctrl-C, which some tests send."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def before_system_call(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, Callable[..., object]], None]:
    """Have a function called before each call of one of `os`; what it raises is the error of the system."""

    def watch(name: str, function: Callable[..., object]) -> None:
        genuine = getattr(os, name)

        def call(*arguments: object, **options: object) -> object:
            function(*arguments)
            return genuine(*arguments, **options)

        monkeypatch.setattr(os, name, call)

    return watch


@pytest.fixture
def no_hard_links(before_system_call: Callable[[str, Callable[..., object]], None]) -> None:
    """A file system whose files have one name each."""
    before_system_call("link", fail_with(errno.EPERM))


@pytest.fixture(params=[True, False], ids=["hard links", "no hard links"])
def links(request: pytest.FixtureRequest) -> bool:
    """Whether a file of the file system may have several names."""
    if not request.param:
        request.getfixturevalue("no_hard_links")
    return bool(request.param)


@pytest.fixture
def temporary_files(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path | str], None]:
    """Set the folder for temporary files."""
    return lambda folder: monkeypatch.setattr(tempfile, "tempdir", str(folder))


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """`tmp_path`, in which the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def vsacli(own_folder: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:  # noqa: ARG001
    """Run a command line in `own_folder`, as the command `vsacli` does."""

    def run_in_folder(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = run([str(argument) for argument in arguments])
        return Outcome(code, *capsys.readouterr())

    return run_in_folder


@pytest.fixture
def motion(tmp_path: Path) -> Path:
    """A trajectory that the 3R arm can execute, `move.yaml`."""
    return rest_to_rest(tmp_path / "move.yaml")


@pytest.fixture
def too_soft(tmp_path: Path) -> Path:
    """The same, but it ends at a stiffness below 2K, `soft.yaml`."""
    return rest_to_rest(tmp_path / "soft.yaml", end_stiffness=790)


@pytest.fixture(scope="session")
def feasible_result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result file without trouble; not to be changed."""
    return _computed(tmp_path_factory.mktemp("feasible"), 1275)


@pytest.fixture(scope="session")
def infeasible_result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result file whose last steps are infeasible; not to be changed."""
    return _computed(tmp_path_factory.mktemp("infeasible"), 790)


def _computed(folder: Path, end_stiffness: float) -> Path:
    result = folder / "result.h5"
    motion = rest_to_rest(folder / "motion.yaml", end_stiffness)
    with contextlib.redirect_stdout(io.StringIO()):
        run(["invdyn", str(ROBOT), str(motion), "-q", "-o", str(result)])
    return result
