"""A command is one transaction: whatever the disk refuses, whenever it is ended, all is old or all is new."""

from __future__ import annotations

import contextlib
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples.catalogs import GENERIC
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, edited, installed
from samples.disturbed import PATIENCE, Disturbance, Disturber
from samples.excited import Excitation, excited
from samples.marks import needs_compiler

from vsacli import load_robot
from vsacli.base.interrupts import ENDING_SIGNALS

pytestmark = needs_compiler

URDF = REPOSITORY / "robots" / "desk_arm.urdf"


@dataclass(frozen=True)
class Task:
    """A command line that writes, in a folder with motions, `given.h5` and its `given.csv`, and a record.

    Attributes:
        arguments: of `vsacli`.
        code: its exit code, if nothing happens.
        overwrites: whether it takes `--overwrite`.
    """

    arguments: tuple[object, ...]
    code: int = 0
    overwrites: bool = True


TASKS = {
    "invdyn": Task(("invdyn", ROBOT, "move.yaml", "-o", "r.h5")),
    "invdyn --plot": Task(("invdyn", ROBOT, "move.yaml", "-o", "r.h5", "--plot", "figures/all")),
    "check-feasibility": Task(
        ("check-feasibility", ROBOT, "soft.yaml", "--plot", "figures", "--write-fix", 1, "-o", "fixed.yaml"),
        3,
    ),
    "simulate": Task(("simulate", ROBOT, "move.yaml", "-o", "s.h5", "--budget", "300", "-q"), 3),
    "codegen": Task(("codegen", ROBOT, "-o", "code")),
    "plot": Task(("plot", "given.h5", "-o", "figures")),
    "compare": Task(("compare", "given.h5", "given.csv", "--plot", "figures")),
    "sensitivity": Task(
        (
            "sensitivity",
            ROBOT,
            "move.yaml",
            "--parameters",
            "joints.*.link.mass",
            "-o",
            "n.h5",
            "--plot",
            "seen",
        )
    ),
    "optimize": Task(("optimize", ROBOT, "move.yaml", "-o", "best.yaml")),
    "identify": Task(("identify", ROBOT, "record.csv", "-o", "fitted.yaml", "--plot", "figures")),
    "size": Task(("size", ROBOT, "move.yaml", "--catalog", "motors.csv", "-o", "s.yaml", "--plot", "drives")),
    "export": Task(("export", "given.h5", "-o", "torques.csv")),
    "new robot": Task(("new", "robot", "--joints", "RR", "-o", "arm.yaml")),
    "new trajectory": Task(("new", "trajectory", "--robot", ROBOT, "-o", "rise.yaml")),
    "import-urdf": Task(("import-urdf", URDF, "--tip", "flange", "-o", "desk.yaml")),
    "examples": Task(("examples", "rp_2", "tendon_1r", "--copy", "arms")),
    "info --extract": Task(("info", "given.h5", "--extract", "again"), overwrites=False),
    "validate --recompute": Task(("validate", "given.h5", "--recompute"), overwrites=False),
}

STARTS = ("new", "overwriting")

CASES = [
    (name, STARTS[number % 2 if task.overwrites else 0]) for number, (name, task) in enumerate(TASKS.items())
]

State = dict[str, bytes | None]
"""What is in a folder: files with their bytes, folders with None."""


def holds(path: Path) -> dict[str, bytes]:
    """What there is in an HDF5 file, but for its attributes, which say when it was made."""
    with h5py.File(path) as file:
        names: list[str] = []
        file.visit(names.append)
        datasets = [file[name] for name in names if isinstance(file[name], h5py.Dataset)]
        return {each.name: np.asarray(each[()]).tobytes() for each in datasets if each.dtype != object}


class Stage:
    """A place to run a task in, again and again from the same start.

    Args:
        place: the library is built there, and inputs lie there.
        name: of the task.
        start: one of `STARTS`: whether the targets are there, each with other content.
    """

    def __init__(self, place: Path, name: str, start: str) -> None:
        self.task, self._inputs = TASKS[name], place / "inputs"
        self._folder = place / f"{name} {start}".replace(" ", "_")
        here = {"TMPDIR": "temporary", "XDG_CACHE_HOME": "cache"}
        environment = {key: str(self._folder / folder) for key, folder in here.items()}
        self.disturber = Disturber.build(place, self._folder, environment)
        self.arguments = (*self.task.arguments, *(["--overwrite"] if start == "overwriting" else []))
        self.before: State = {}
        self.reset()
        began = time.monotonic()
        self.calls = self.disturber.calls(*self.arguments)
        self.seconds = time.monotonic() - began
        self.after = self.state()
        self._reference = place / f"{self._folder.name}_reference"
        shutil.copytree(self.here, self._reference)
        if start == "overwriting":
            new = {path: content for path, content in self.after.items() if path not in self.before}
            self.before |= {path: None if content is None else b"old" for path, content in new.items()}
            self.reset()

    @property
    def here(self) -> Path:
        """The folder the commands run in."""
        return self._folder / "here"

    def reset(self) -> None:
        """Begin again."""
        shutil.rmtree(self._folder, ignore_errors=True)
        (self._folder / "temporary").mkdir(parents=True)
        shutil.copytree(self._inputs, self.here)
        self.before = self.before or self.state()
        for path, content in self.before.items():
            if content is None:
                (self.here / path).mkdir(exist_ok=True)
            else:
                (self.here / path).write_bytes(content)

    def state(self) -> State:
        """What is there, hidden files, too."""
        found = sorted(self.here.rglob("*"))
        return {
            str(each.relative_to(self.here)): each.read_bytes() if each.is_file() else None for each in found
        }

    def temporary(self) -> list[str]:
        """What is in the folder for temporary files; Python's own test of it may be cut short, too."""
        return [path.name for path in (self._folder / "temporary").glob(".vsacli-*")]

    def is_new(self, path: str, content: bytes | None) -> bool:
        """Whether something is what the task writes under that name; results have a time in them."""
        if path.endswith(".h5") and self.after.get(path) not in (None, content):
            new = content != self.before.get(path)
            return new and holds(self.here / path) == holds(self._reference / path)
        return path in self.after and self.after[path] == content

    def run(self, disturbance: Disturbance) -> tuple[int, str, str]:
        """Begin again, and run the task disturbed."""
        self.reset()
        return self.disturber.run(disturbance, *self.arguments)

    def check_all_or_nothing(self, code: int, err: str) -> bool:
        """Whether everything is new, as the exit code says; nothing is, if it says another."""
        state = self.state()
        assert "Traceback" not in err, err
        assert not self.temporary()
        if code != self.task.code:
            assert state == self.before, (code, err, sorted(state))
            return False
        assert state.keys() == self.after.keys(), (code, err)
        assert all(self.is_new(path, content) for path, content in state.items()), (code, err)
        return True


MakeStage = Callable[[str, str], Stage]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> MakeStage:
    """Makes a stage, or finds it made."""
    place = tmp_path_factory.mktemp("disturbed")
    inputs = place / "inputs"
    inputs.mkdir()
    for name, end in (("move", "1275"), ("soft", "790")):
        edited(
            REST_TO_REST, inputs / f"{name}.yaml", ("rate: 1000 ", "rate: 10 "), ("end: 1275", f"end: {end}")
        )
    (inputs / "motors.csv").write_text(GENERIC)
    arm = load_robot(ROBOT)
    moved = Excitation([0, 0, 0], [0.4] * 3, [1400] * 3, [300] * 3, rate=50)
    excited(arm, moved).noisy(seed=0).write(inputs / "record.csv", arm)
    for arguments in (
        ("invdyn", ROBOT, "move.yaml", "-o", "given.h5"),
        ("export", "given.h5", "-o", "given.csv"),
    ):
        assert installed(*arguments, folder=inputs).returncode == 0
    return cache(lambda name, start: Stage(place, name, start))


def sample(calls: Sequence[str], most: int, draw: random.Random) -> list[int]:
    """Numbers of calls, from 1: one of each row of the same call to the same file, but not too many."""
    rows = [list(row) for _, row in groupby(range(len(calls)), key=lambda each: calls[each])]
    chosen = [draw.choice(row) + 1 for row in rows]
    return sorted(draw.sample(chosen, min(most, len(chosen))))


TRIED = 1
"""Calls of each task and start, of some twenty to five hundred; all of them take hours."""


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES, ids=" - ".join)
def test_all_is_new_or_nothing(stage: MakeStage, case: tuple[str, str]) -> None:
    there = stage(*case)
    draw = random.Random(f"{case}")
    for at in sample(there.calls, TRIED, draw):
        check_failure(there, Disturbance(at=at, lasting=draw.random() < 0.5))
    for at in sample(there.calls, TRIED, draw):
        check_ending(there, Disturbance(at=at, number=draw.choice(ENDING_SIGNALS)))
    for at in sample(there.calls, TRIED, draw):
        check_kill(there, Disturbance(at=at, number=signal.SIGKILL))


@pytest.mark.slow
def test_a_moment_at_random(stage: MakeStage) -> None:
    """Whatever a command does just then, and whichever it is."""
    draw = random.Random(0)
    for case in draw.sample(CASES, 2):
        there = stage(*case)
        check_moment(there, draw.choice(ENDING_SIGNALS), draw.random())


def check_moment(there: Stage, number: int, moment: float) -> None:
    """A signal at a moment of a run, 0 its beginning and 1 about its end."""
    there.reset()
    process = there.disturber.start(*there.arguments)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=moment * there.seconds)
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    if process.returncode == -number:  # Python was not yet up
        assert there.state() == there.before
    elif not there.check_all_or_nothing(process.returncode, err):
        assert process.returncode == 128 + number, err


def check_failure(there: Stage, disturbance: Disturbance) -> None:
    """A disk that is full is told with the name of what could not be written, or does not matter."""
    code, out, err = there.run(disturbance)
    if not there.check_all_or_nothing(code, err):
        assert code == 4, (disturbance, out, err)
        named = [*(set(there.after) - set(there.before)), *there.before, "folder for temporary files"]
        assert any(line.startswith(f"{name}: cannot be ") for line in err.splitlines() for name in named), err
        assert "the disk is full" in err


def check_ending(there: Stage, disturbance: Disturbance) -> None:
    code, _, err = there.run(disturbance)
    if not there.check_all_or_nothing(code, err):
        assert code == 128 + disturbance.number, (disturbance, err)


def check_kill(there: Stage, disturbance: Disturbance) -> None:
    code, _, err = there.run(disturbance)
    assert code == -signal.SIGKILL, err
    state = there.state()
    for path in there.after:
        if path in state:
            old = path in there.before and state[path] == there.before[path]
            assert old or there.is_new(path, state[path]), (disturbance, path)
        else:
            assert path not in there.before, (disturbance, path)
    for folder in there.after.keys() & state.keys() - there.before.keys():
        assert {path for path in there.after if path.startswith(f"{folder}/")} <= state.keys(), disturbance
    replaced = there.task.overwrites and state.keys() & (there.after.keys() - there.before.keys())
    arguments = [*there.arguments, *(["--overwrite"] if replaced else [])]
    code, _, err = there.disturber.run(Disturbance(), *arguments)
    if there.task.overwrites or code == there.task.code:
        assert code == there.task.code, err
        assert there.state().keys() == there.after.keys()
    assert not [path for path in there.state() if ".vsacli-" in path]
    assert not there.temporary()
