"""A trajectory with recorded stiffness as files: YAML, and a CSV table beside it."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from vsacli.base.atomic_files import AtomicFile, check_target, reporting_storage_errors
from vsacli.base.errors import InputError
from vsacli.base.signals import COMMANDED, POSITION, WRENCH, Signal
from vsacli.base.wrench import wrench_columns
from vsacli.dynamics.inverse import usual_block
from vsacli.trajectory.curves import Constant, RestToRest
from vsacli.trajectory.file import FORMAT
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.trajectory import Trajectory


def fixed_paths(path: str | Path) -> tuple[Path, Path]:
    """The YAML file, and the CSV file beside it."""
    return Path(path), Path(path).with_suffix(".csv")


def check_fixed_target(path: str | Path, *, overwrite: bool) -> None:
    """Refuse a YAML path that cannot be written, or whose CSV file beside it cannot.

    Raises:
        InputError: it does not end in .yaml or .yml.
        StorageError: a file exists and `overwrite` is false, or its folder does not exist.
    """
    if Path(path).suffix not in (".yaml", ".yml"):
        raise InputError.one("the fixed trajectory is a YAML file; give a name that ends in .yaml", path)
    for file in fixed_paths(path):
        check_target(file, overwrite=overwrite)


def write_fixed(
    trajectory: Trajectory, joint_names: Sequence[str], path: str | Path, *, overwrite: bool = False
) -> tuple[Path, Path]:
    """Write a trajectory with recorded stiffness as a YAML file and a CSV file of the same stem.

    Position and wrench stay formulas if they are constants or polynomials from rest to rest; else they are
    recorded at the steps with all their derivatives.

    Returns:
        The two paths.

    Raises:
        InputError, StorageError: as `check_fixed_target`, or the disk fails; nothing is written then.
    """
    check_fixed_target(path, overwrite=overwrite)
    document_path, table_path = fixed_paths(path)
    with (
        AtomicFile(table_path, overwrite=overwrite) as table,
        AtomicFile(document_path, overwrite=overwrite) as document,
    ):
        with (
            reporting_storage_errors(table_path),
            table.temporary.open("w", encoding="utf-8", newline="") as stream,
        ):
            _write_table(trajectory, joint_names, stream)
        with reporting_storage_errors(document_path):
            document.temporary.write_text(_document(trajectory, table_path.name), encoding="utf-8")
        table.publish()
        document.publish()
    return document_path, table_path


def _document(trajectory: Trajectory, table: str) -> str:
    lines = [
        f"format: {FORMAT}",
        f"name: {json.dumps(trajectory.name)}",
        f"position: {{{_declaration(trajectory.position, table)}}}",
        *(f"{key}: {{{_declaration(profile, table)}}}" for key, profile in trajectory.commanded.items()),
    ]
    if trajectory.wrench is not None:
        declaration = _declaration(trajectory.wrench.profile, table)
        lines.append(f"wrench: {{{declaration}, frame: {trajectory.wrench.frame}}}")
    return "\n".join([*lines, ""])


def _declaration(profile: Profile, table: str) -> str:
    return _formula(profile) or f"type: csv, file: {json.dumps(table)}"


def _formula(profile: Profile) -> str | None:
    """How a profile that does not depend on the times of the steps is declared; None for the others."""
    match profile:
        case RestToRest(degree=degree, start=start, end=end):
            return f"type: polynomial, degree: {degree}, start: {_numbers(start)}, end: {_numbers(end)}"
        case Constant(value=value):
            return f"type: constant, value: {_numbers(value)}"
    return None


def _numbers(values: Sequence[float]) -> str:
    return json.dumps([None if math.isnan(value) else value for value in values])


def _write_table(trajectory: Trajectory, joint_names: Sequence[str], stream: TextIO) -> None:
    names = [name for signal in _recorded(trajectory) for name in signal.names]
    chosen = {name: trajectory.chosen(key) for key, signal in COMMANDED.items() for name in signal.names}
    headers = [np.array(_columns(name, joint_names))[chosen.get(name, ...)] for name in names]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *np.concatenate(headers).tolist()])
    samples = usual_block(len(joint_names))
    for start in range(0, trajectory.samples, samples):
        motion = trajectory.block(start, start + samples)
        variables = motion.variables()
        columns = [motion.time[:, None], *(variables[name][:, chosen.get(name, ...)] for name in names)]
        writer.writerows(np.concatenate(columns, axis=1).tolist())


def _recorded(trajectory: Trajectory) -> Iterator[Signal]:
    """The signals that are not declared as formulas."""
    profiles = {POSITION: trajectory.position}
    profiles |= {COMMANDED[key]: profile for key, profile in trajectory.commanded.items()}
    if trajectory.wrench is not None:
        profiles[WRENCH] = trajectory.wrench.profile
    for signal, profile in profiles.items():
        if _formula(profile) is None:
            yield signal


def _columns(name: str, joint_names: Sequence[str]) -> list[str]:
    return wrench_columns(name) if name in WRENCH.names else [f"{joint}.{name}" for joint in joint_names]
