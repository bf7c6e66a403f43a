"""Long trajectories in bounded memory, no Python loop over samples, and a quick start."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from samples.command_line import COMMAND, ROBOT, SEVEN_JOINTS, edited, seven_joint_motion

from vsacli.cli.main import run

MEMORY_LIMIT = 400.0
"""MB, resident, for any number of samples of seven joints."""

LAUNCH = """
import resource, subprocess, sys
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL)
unit = 1024 if sys.platform == "darwin" else 1
print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / unit / 1000)
"""
"""Run a command, print its exit code and peak memory in MB; from a small process: children inherit peaks."""


def peak_memory(folder: Path, samples: int, *options: str) -> float:
    """MB that `vsacli invdyn` needs for the 7R arm."""
    motion = seven_joint_motion(folder / f"{samples}.yaml", rate=(samples - 1) / 3)
    command = [sys.executable, "-c", LAUNCH, COMMAND, "invdyn", SEVEN_JOINTS, motion, *options]
    command += ["-q", "-o", folder / f"{samples}.h5"]
    code, memory = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert code == "0"
    return float(memory)


@pytest.mark.slow
def test_memory_is_bounded_and_does_not_grow_with_the_trajectory(tmp_path):
    few = ("--variables", "tau_motor,flags")
    short, long = (peak_memory(tmp_path, samples, *few) for samples in (400_000, 1_600_000))
    assert long < MEMORY_LIMIT
    # What waits to be written, up to 34 MB, depends on the disk. The 1,200,000 samples more are 150 MB in the
    # file, 67 MB for every variable with a value for each joint.
    assert abs(long - short) < 10 + 34


@pytest.mark.slow
def test_a_file_that_is_written_behind_the_run_does_not_pile_up_in_memory(tmp_path):
    assert peak_memory(tmp_path, 400_000) < MEMORY_LIMIT  # the file has 740 MB
    assert (tmp_path / "400000.h5").stat().st_size > 700e6


class LineCount:
    """Counts executed lines of Python, and jumps back to one, in this thread and those it starts.

    What earlier tests left to the garbage collector, whose finalizers would count, is collected before.
    """

    def __init__(self) -> None:
        self.lines = 0

    def _trace(self, _frame, event, _argument):
        self.lines += event == "line"
        return self._trace

    def __enter__(self):
        self._before = sys.gettrace(), threading.gettrace()
        gc.collect()
        gc.disable()
        threading.settrace(self._trace)
        sys.settrace(self._trace)
        return self

    def __exit__(self, *_error):
        sys.settrace(self._before[0])
        threading.settrace(self._before[1])
        gc.enable()


@pytest.mark.slow
@pytest.mark.parametrize(
    "loop", [lambda n: [-k for k in range(n)], lambda n: sum(-k for k in range(n))], ids=["list", "sum"]
)
def test_line_count_sees_loops(loop):
    with LineCount() as short:
        loop(100)
    with LineCount() as long:
        loop(1100)
    assert long.lines - short.lines >= 1000


# Both lengths take one block, and the same number of chunks within it.
FEW, MANY = 7200, 8100


def executed_lines(motion: Path, *options: str) -> int:
    with LineCount() as count:
        assert run(["invdyn", str(SEVEN_JOINTS), str(motion), *options, "--overwrite", "-q"]) in (0, 3)
    return count.lines


@pytest.mark.slow
@pytest.mark.parametrize("end_stiffness", [2400, 1500], ids=["feasible", "infeasible"])
def test_no_python_loop_runs_over_samples(tmp_path, monkeypatch, end_stiffness):
    monkeypatch.chdir(tmp_path)
    lines = {}
    for samples in (FEW, FEW, MANY):  # the first run also counts what happens once in a process
        motion = seven_joint_motion(tmp_path / "m.yaml", rate=(samples - 1) / 3)
        edited(motion, motion, ("shoulder_yaw: 2400", f"shoulder_yaw: {end_stiffness}"))
        lines[samples] = executed_lines(motion, "-o", "r.h5")
    # A loop would run at least a line for each sample more; what else varies is about a hundred lines.
    assert abs(lines[MANY] - lines[FEW]) < (MANY - FEW) / 2


HEAVY = {"numpy", "scipy", "matplotlib", "h5py", "yaml"}

IMPORTED = f"""
import sys
from vsacli.cli.main import run
code = run(sys.argv[1:])
print(code, *sorted({HEAVY!r} & set(sys.modules)), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("arguments", "imported"),
    [
        (["--help"], []),
        (["--version"], []),
        (["invdyn", "--help"], []),
        (["plot", "--help"], []),
        (["invdyn", str(ROBOT), "move.yaml", "-q"], ["h5py", "numpy", "yaml"]),
        (["check-feasibility", str(ROBOT), "move.yaml"], ["numpy", "yaml"]),
    ],
    ids=lambda value: " ".join(value)[:20],
)
def test_what_a_command_imports(tmp_path, motion, arguments, imported):
    assert motion == tmp_path / "move.yaml"
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED, *arguments], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stderr.split() == ["0", *imported]
