"""A remedy as files: the trajectory, a CSV table for what is no formula, the robot with another preload."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.base.texts import for_yaml
from vsacli.base.wrench import wrench_columns
from vsacli.dynamics.inverse import usual_block
from vsacli.studies.remedies.fixed_robot import robot_text
from vsacli.studies.remedies.formulas import formula
from vsacli.studies.remedies.suggestions import Remedy
from vsacli.trajectory.file import FORMAT
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import UniformTimes
from vsacli.trajectory.trajectory import Trajectory


def fixed_paths(path: str | Path) -> tuple[Path, Path, Path]:
    """The YAML file, which is always written, and the CSV file and the robot file beside it."""
    document = Path(path)
    return document, document.with_suffix(".csv"), document.with_name(f"{document.stem}-robot.yaml")


def check_fixed_target(path: str | Path, outputs: Outputs) -> None:
    """Refuse a YAML path that cannot be written, or beside which the others cannot.

    Raises:
        InputError: it does not end in .yaml or .yml.
        StorageError: as `Outputs.file`.
    """
    if Path(path).suffix not in (".yaml", ".yml"):
        raise InputError.one("the fixed trajectory is a YAML file; give a name that ends in .yaml", path)
    for file in fixed_paths(path):
        outputs.check(file)


def write_fixed(remedy: Remedy, path: str | Path, outputs: Outputs) -> None:
    """Write the trajectory of a remedy, and its robot if that has another preload.

    Signals stay formulas where they are; else they are recorded at the steps with all their derivatives, in a
    CSV file of the same stem. The robot file is that of the robot with the preload changed.

    Raises:
        InputError, StorageError: as `check_fixed_target`, or the robot file cannot be changed so, or the disk
            fails.
    """
    document, table, robot = fixed_paths(path)
    trajectory, names = remedy.trajectory, remedy.robot.joint_names
    formulas = _formulas(trajectory)
    recorded = [signal for signal, declared in formulas.items() if declared is None]
    contents: dict[Path, Callable[[TextIO], object]] = {
        document: lambda file: file.writelines(_document(trajectory, formulas, table.name))
    }
    if recorded:
        contents[table] = lambda file: _write_table(trajectory, recorded, names, file)
    if remedy.preload is not None:
        contents[robot] = lambda file: file.write(robot_text(remedy, robot.parent))
    for target, write in contents.items():
        with outputs.file(target).opened() as stream:
            write(stream)


def _formulas(trajectory: Trajectory) -> dict[Signal, dict[str, Any] | None]:
    """How each signal is declared; None for those that are recorded, whose table has the times."""
    profiles: dict[Signal, Profile] = {POSITION: trajectory.position}
    chosen = [key for key in trajectory.commanded if trajectory.chosen(key).any()]
    profiles |= {COMMANDED[key]: trajectory.commanded[key] for key in chosen}
    if trajectory.wrench is not None:
        profiles[WRENCH] = trajectory.wrench.profile
    formulas = {signal: formula(profile) for signal, profile in profiles.items()}
    if None not in formulas.values() and not isinstance(trajectory.times, UniformTimes):
        formulas[POSITION] = None
    return formulas


def _document(
    trajectory: Trajectory, formulas: Mapping[Signal, dict[str, Any] | None], table: str
) -> Iterator[str]:
    """Lines of the trajectory file."""
    yield f"format: {FORMAT}\n"
    yield f"name: {for_yaml(trajectory.name)}\n"
    if None not in formulas.values():
        assert isinstance(trajectory.times, UniformTimes), "see _formulas"
        yield f"duration: {trajectory.times.duration!r}\nrate: {trajectory.times.rate!r}\n"
    for signal, declared in formulas.items():
        content = {"type": "csv", "file": table} if declared is None else declared
        if signal is WRENCH and trajectory.wrench is not None:
            content = {**content, "frame": trajectory.wrench.frame}
        yield f"{signal.key}: {_in_one_line(content)}\n"


def _in_one_line(content: Any) -> str:
    """Content as YAML in flow style, words without quotes."""
    match content:
        case dict():
            return "{" + ", ".join(f"{key}: {_in_one_line(each)}" for key, each in content.items()) + "}"
        case list():
            return "[" + ", ".join(map(_in_one_line, content)) + "]"
        case str() if content.isidentifier():
            return content
    return for_yaml(content) if isinstance(content, str) else json.dumps(content)


def _write_table(
    trajectory: Trajectory, recorded: Sequence[Signal], joint_names: Sequence[str], stream: TextIO
) -> None:
    names = [name for signal in recorded for name in signal.names]
    chosen = {name: trajectory.chosen(key) for key in trajectory.commanded for name in COMMANDED[key].names}
    headers = [np.array(_columns(name, joint_names))[chosen.get(name, ...)] for name in names]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *np.concatenate(headers).tolist()])
    samples = usual_block(len(joint_names))
    for start in range(0, trajectory.samples, samples):
        motion = trajectory.block(start, start + samples)
        variables = motion.variables()
        columns = [motion.time[:, None], *(variables[name][:, chosen.get(name, ...)] for name in names)]
        writer.writerows(np.concatenate(columns, axis=1).tolist())


def _columns(name: str, joint_names: Sequence[str]) -> list[str]:
    return wrench_columns(name) if name in WRENCH.names else [f"{joint}.{name}" for joint in joint_names]
