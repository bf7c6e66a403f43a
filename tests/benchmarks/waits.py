"""Commands that users wait for: processor time and memory, from starting Python to the finished file."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from commands import VSACLI, Taken, taken
from growth import chain_documents
from subjects import PAPER, ROBOTS, SEVEN_JOINTS, TRAJECTORIES

from vsacli import load_robot, load_trajectory

EXPORTED = 1_200_000
"""Samples of the table that is written as CSV."""

RECORDED = 10.0
"""Duration of the recordings, s."""

ONE_JOINT = ROBOTS / "maccepa_1r.yaml", TRAJECTORIES / "maccepa_1r.yaml"

SEVEN_MIXED = ROBOTS / "panda_7r.yaml", TRAJECTORIES / "panda_7r.yaml"
HURRIED = 0.45
"""Share of its duration in which a recorded motion of that arm exceeds the torque limit of one motor."""

LINEARIZED = ("--controller", "feedback-linearization")

_PANDAS = """
import sys, h5py, pandas
with h5py.File(sys.argv[1]) as file:
    torques = file["tau_motor"][...].reshape(len(file["time"]), -1)
    pandas.DataFrame(torques, file["time"][...]).to_csv(sys.argv[2])
"""

Line = list[str]


class Wait(NamedTuple):
    """What a command takes.

    Attributes:
        name: of the case.
        taken: medians.
    """

    name: str
    taken: Taken


def compare(repeats: int) -> Iterator[Wait]:
    """Run every command `repeats` times, in turn; code that is compiled is kept nowhere."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines = dict(_lines(folder))
        runs: dict[str, list[Taken]] = {case: [] for case in lines}
        for turn in range(repeats):
            for case, line in lines.items():
                with patch.dict(os.environ, XDG_CACHE_HOME=str(folder / f"cache {case} {turn}")):
                    runs[case].append(taken(line, folder))
    for case, found in runs.items():
        yield Wait(case, Taken(*(median(column) for column in zip(*found, strict=True))))


def _lines(folder: Path) -> Iterator[tuple[str, Line]]:
    """Command lines by what they do, whose inputs are made in the folder."""
    run = partial(_line, folder)
    yield "simulate 3R, feedforward, 4 s", run("simulate", *PAPER)
    for seconds in (3, 10):
        simulated = run("simulate", *SEVEN_JOINTS, *LINEARIZED, "--set", f"duration={seconds}")
        yield f"simulate 7R, feedback linearization, {seconds} s", simulated
    yield "optimize, one joint", _command("optimize", *ONE_JOINT)
    soft = (*PAPER, "--set", "stiffness.end=790")
    yield "fixes, 3R below its minimum stiffness", _command("check-feasibility", *soft, "--fixes")
    yield (
        "fixes, recorded 7R beyond a torque limit",
        _command("check-feasibility", *_hurried(folder), "--fixes"),
    )
    yield from _chains(folder, run)
    yield from _recordings(folder, run)
    yield from _exports(folder)


def _chains(folder: Path, run: Callable[..., Line]) -> Iterator[tuple[str, Line]]:
    files = [folder / f"chain {name}.yaml" for name in ("robot", "trajectory")]
    for path, document in zip(files, chain_documents(100), strict=True):
        path.write_text(json.dumps(document))  # which is YAML, too
    for engine, name in (("numpy", "NumPy"), ("c", "compiled, first use")):
        yield f"100 joints, 1,000 samples, {name}", run("invdyn", *files, "--engine", engine)


def _recordings(folder: Path, run: Callable[..., Line]) -> Iterator[tuple[str, Line]]:
    """A slow motion in steps of an encoder, and noise that hides every derivative."""
    time = np.arange(0, RECORDED, 1e-3)
    noise = np.random.default_rng(0).standard_normal
    clean = np.round(0.5 * np.sin(np.pi * time / RECORDED) ** 4 / 1e-5) * 1e-5
    for name, q in (("resolved", clean), ("nothing resolved", 0.1 * noise(time.size))):
        path = folder / f"{name}.csv"
        stiffness = np.full(time.size, 0.2)
        _save(path, {"time [s]": time, "elbow.q [rad]": q, "elbow.stiffness [N m/rad]": stiffness})
        yield f"a recording of 10 s, {name}", run("invdyn", ONE_JOINT[0], path)


def _hurried(folder: Path) -> tuple[Path, Path]:
    """Return a robot, and a file of its motion in steps of an encoder, faster than its motors can follow."""
    robot = load_robot(SEVEN_MIXED[0])
    trajectory = load_trajectory(SEVEN_MIXED[1], robot)
    motion = trajectory.block(0, trajectory.samples)
    signals = {"q": np.round(motion.q / 1e-5) * 1e-5, "stiffness": motion.commanded["stiffness"]}
    columns = {"time": HURRIED * motion.time}
    for name, values in signals.items():
        for index, joint in enumerate(robot.joints):
            if name == "q" or name in joint.commanded:
                columns[f"{joint.name}.{name}"] = values[:, index]
    path = folder / "hurried.csv"
    _save(path, columns)
    return SEVEN_MIXED[0], path


def _save(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, "%.9g", ",", header=",".join(columns), comments="")


def _exports(folder: Path) -> Iterator[tuple[str, Line]]:
    result = folder / "long.h5"
    rate = (EXPORTED - 1) / 4
    made = _command("invdyn", *PAPER, "--set", f"rate={rate}", "--variables", "tau_motor", "-q", "-o", result)
    taken(made, folder)
    columns = ("--variables", "tau_motor", "--overwrite", "-o", folder / "table.csv")
    yield "export 1.2 million samples, CSV", _command("export", result, *columns)
    yield "the same by pandas", [sys.executable, "-c", _PANDAS, str(result), str(folder / "pandas.csv")]


def _line(folder: Path, command: str, *arguments: object) -> Line:
    return _command(command, *arguments, "-q", "--overwrite", "-o", folder / f"{command}.h5")


def _command(*arguments: object) -> Line:
    return [VSACLI, *map(str, arguments)]
