"""How whole runs grow with samples and joints: each a command in a process of its own, with its memory."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from commands import VSACLI, Taken, taken
from matplotlib.figure import Figure
from subjects import SEVEN_JOINTS

ENGINES = ("numpy", "c")
SAMPLES = (10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000)
STORED = ("tau_motor", "flags")
"""Of the arm, so that ten million samples leave a file of 1.3 GB, not one of 18."""

JOINTS = (1, 3, 10, 30, 100, 300, 1000)
SAMPLES_OF_CHAIN = 1_000


class Growth(NamedTuple):
    """What runs take, by engine and number."""

    by_samples: Mapping[str, Mapping[int, Taken]]
    by_joints: Mapping[str, Mapping[int, Taken]]


def measure() -> Growth:
    """Run the arm for each number of samples, and chains of each length, whose variables are all stored."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arm = {engine: {each: _arm(each, engine, folder) for each in SAMPLES} for engine in ENGINES}
        chains = {engine: {each: _chain(each, engine, folder) for each in JOINTS} for engine in ENGINES}
    return Growth(arm, chains)


def _arm(samples: int, engine: str, folder: Path) -> Taken:
    robot, trajectory = map(_read, SEVEN_JOINTS)
    return _run(robot, {**trajectory, "rate": (samples - 1) / trajectory["duration"]}, engine, folder, STORED)


def _chain(joints: int, engine: str, folder: Path) -> Taken:
    return _run(*chain_documents(joints), engine, folder)


def chain_documents(joints: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Robot and trajectory: the joints of the arm over and over again, without gravity.

    The longer, the shorter is their way, since the inertia that a joint moves grows with the cube of what is
    beyond it: so hardly a joint leaves its corridor.
    """
    robot, trajectory = map(_read, SEVEN_JOINTS)
    arm = robot["joints"]
    names = [f"joint{number + 1}" for number in range(joints)]
    chain = [{**arm[index % len(arm)], "name": name} for index, name in enumerate(names)]
    way = min(1.0, (len(arm) / joints) ** 3)
    ends = [f"{way * float(angle.split()[0])} deg" for angle in trajectory["position"]["end"]]
    stiffness = {key: list(trajectory["stiffness"][key].values()) for key in ("start", "end")}
    moved = {
        "rate": (SAMPLES_OF_CHAIN - 1) / trajectory["duration"],
        "position": {**trajectory["position"], "end": _repeated(ends, joints)},
        "stiffness": {
            **trajectory["stiffness"],
            **{key: _repeated(values, joints) for key, values in stiffness.items()},
        },
    }
    return {**robot, "gravity": [0, 0, 0], "joints": chain}, {**trajectory, **moved}


def _read(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    return document


def _repeated(values: list[Any], count: int) -> list[Any]:
    return [values[index % len(values)] for index in range(count)]


def _run(
    robot: Mapping[str, Any],
    trajectory: Mapping[str, Any],
    engine: str,
    folder: Path,
    variables: tuple[str, ...] = (),
) -> Taken:
    """Time and memory of `vsacli invdyn`; compiled code is there, as it is from a robot's second run on."""
    files = {"robot.yaml": robot, "motion.yaml": trajectory}
    for name, document in files.items():
        (folder / name).write_text(json.dumps(document))  # which is YAML, too
    line = [VSACLI, "invdyn", *(str(folder / name) for name in files), "-q", "--overwrite"]
    line += ["-o", str(folder / "result.h5"), "--engine", engine]
    if engine == "c":
        taken([*line, "--variables", "flags", "--set", "rate=10"])
    return taken([*line, *(["--variables", ",".join(variables)] if variables else [])])


def draw(growth: Growth, path: Path) -> None:
    """Seconds over both, and the memory."""
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex="col", sharey="row")
    names = {"numpy": "NumPy", "c": "compiled"}
    for column, (by_number, title, label) in enumerate(
        (
            (growth.by_samples, "7R arm", "samples"),
            (growth.by_joints, f"chains, {SAMPLES_OF_CHAIN:,} samples", "joints"),
        )
    ):
        above, below = panels[:, column]
        for engine, found in by_number.items():
            above.loglog([*found], [each.seconds for each in found.values()], "o-", label=names[engine])
            below.semilogx([*found], [each.memory / 1e6 for each in found.values()], "o-")
        above.set(title=title)
        below.set(xlabel=label)
    panels[0, 0].set(ylabel="whole run, s")
    panels[1, 0].set(ylabel="at most resident, MB", ylim=(0, None))  # once all is drawn
    panels[0, 0].legend(frameon=False)
    for axes in panels.flat:
        axes.grid(visible=True, which="major", alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
