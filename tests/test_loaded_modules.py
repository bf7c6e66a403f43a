"""A command loads the modules of its task: some it must not load, and so many lines of ours at most."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import NamedTuple

import pytest
from samples.marks import slow
from samples.python_processes import run_python
from samples.sources import PACKAGE

REPOSITORY = Path(__file__).parents[1]
ROBOT = str(REPOSITORY / "robots" / "vsa_3r.yaml")
TRAJECTORY = str(REPOSITORY / "trajectories" / "rest_to_rest.yaml")

NOT_FOR_THE_MAIN_JOB = (
    *("scipy", "matplotlib", "numpy.ma", "numpy.polynomial", "numpy.typing"),
    *("concurrent", "importlib.resources", "random", "shutil", "subprocess", "tempfile", "traceback"),
    *("base.renamed", "cli.plot", "cli.simulate", "cli.check_feasibility", "control", "files", "studies"),
    *("results.charts", "results.exports", "results.plots", "results.store.reader"),
    *("robot.modified_dh", "robot.urdf"),
    *("analysis.result", "dynamics.integrated_deflections", "documents.table"),
    *("compute.engine.compiled_engine", "compute.engine.compiler", "compute.engine.lanes"),
    *("compute.engine.libraries", "compute.tracing"),
    *("trajectory.curves.steps", "trajectory.curves.sinusoids", "trajectory.curves.via_points"),
    *("trajectory.curves.sequence", "trajectory.curves.via_points"),
    *("trajectory.recorded", "trajectory.fits"),
    *("actuators.pairs.solver", "actuators.laws.polynomial", "actuators.laws.sinh", "actuators.laws.table"),
)
"""Modules, here and elsewhere, that take time to import and have no part in the paper's example."""


class Task(NamedTuple):
    """A command with its arguments.

    Attributes:
        arguments: Command line.
        not_loaded: Modules and packages that it must not load.
        most_lines: Most lines of ours that it loads.
    """

    arguments: tuple[str, ...]
    not_loaded: tuple[str, ...]
    most_lines: int


OF_A_ROBOT = ("studies", "control", "results", "analysis", "dynamics", "h5py", "scipy")
"""Modules that have no part in reading one robot."""

TASKS = {
    "invdyn": Task(("invdyn", "-q", ROBOT, TRAJECTORY), NOT_FOR_THE_MAIN_JOB, 24_150),
    "invdyn --plot": Task(
        ("invdyn", "-q", ROBOT, TRAJECTORY, "--plot", "figures"),
        ("studies", "control", "files", "trajectory.fits", "trajectory.recorded"),
        32_000,
    ),
    "check-feasibility": Task(
        ("check-feasibility", ROBOT, TRAJECTORY),
        ("studies", "control", "results.store", "h5py", "scipy"),
        22_900,
    ),
    "validate": Task(("validate", ROBOT), OF_A_ROBOT, 12_350),
    "info": Task(("info", ROBOT), OF_A_ROBOT, 13_900),
}
"""Lines change with the code: a change that needs more raises them, with its reason in its message."""


def load(task: Task, folder: Path) -> tuple[set[str], int]:
    """Return the modules that a task imports, ours without `vsacli.`, and the lines of ours."""
    libraries = ["click", "yaml", "numpy", *(["h5py"] if "h5py" not in task.not_loaded else [])]
    code = f"""
import json, sys, {", ".join(libraries)}
before = set(sys.modules)
from vsacli.cli.main import run
assert run({list(task.arguments)}) == 0
loaded = sorted(set(sys.modules) - before)
files = [sys.modules[name].__file__ for name in loaded if name.startswith("vsacli")]
sys.stderr.write(json.dumps([loaded, files]))
"""
    modules, files = json.loads(run_python(code, folder).stderr.splitlines()[-1])
    lines = sum(len(Path(file).read_text(encoding="utf-8").splitlines()) for file in files)
    return {name.removeprefix("vsacli.") for name in modules}, lines


@pytest.mark.parametrize(
    "task", [slow(task) if "--plot" in name else task for name, task in TASKS.items()], ids=TASKS
)
def test_a_command_loads_its_task(task: Task, tmp_path: Path) -> None:
    modules, lines = load(task, tmp_path)
    assert "cli.main" in modules
    assert [
        name for name in task.not_loaded if any(f"{each}.".startswith(f"{name}.") for each in modules)
    ] == []
    assert lines <= task.most_lines


def test_modules_that_must_not_be_loaded_exist() -> None:
    for name in {name for task in TASKS.values() for name in task.not_loaded}:
        own = (PACKAGE / name.partition(".")[0]).is_dir()
        assert importlib.util.find_spec(f"vsacli.{name}" if own else name), name
