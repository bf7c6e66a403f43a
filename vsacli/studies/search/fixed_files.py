"""A fix as files: the trajectory, a CSV table for signals without a formula, a robot with another branch."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from vsacli.base import file_formats
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.signals import COMMANDED, POSITION, STIFFNESS, WRENCHES, Signal, wrench_on
from vsacli.base.texts import for_yaml
from vsacli.base.wrench import wrench_columns
from vsacli.documents.edited import edited, format_on_one_line, moved_files
from vsacli.dynamics.inverse import usual_block
from vsacli.robot.file import text_to_change
from vsacli.studies.search.fix_report import Fix, branch_path
from vsacli.studies.search.fixed_text import TableFile, edited_text, formula
from vsacli.trajectory.fits import INTERPOLATE
from vsacli.trajectory.profile import Profile, WrenchProfile
from vsacli.trajectory.times import ResampledTimes, UniformTimes
from vsacli.trajectory.trajectory import Trajectory


class _TableColumns(NamedTuple):
    """The columns of a signal or of a derivative.

    Attributes:
        signal: described signal.
        variable: result variable with its values at the samples.
        headers: header of each component.
        raw: recorded values, (components, samples); None if those at the samples are written.
    """

    signal: Signal
    variable: str
    headers: list[str]
    raw: FloatArray | None


def fixed_paths(path: str | Path) -> tuple[Path, Path, Path]:
    """Return the paths of the YAML file, which is always written, and of the CSV file and the robot file."""
    document = Path(path)
    return document, document.with_suffix(".csv"), document.with_name(f"{document.stem}-robot.yaml")


def check_fixed_target(path: str | Path, outputs: Outputs) -> None:
    """Check that a fix can be written to a YAML path and to the other `fixed_paths`.

    Raises:
        InputError: the path does not end in .yaml or .yml.
        StorageError: see `Outputs.file`.
    """
    if Path(path).suffix not in (".yaml", ".yml"):
        raise InputError.one("the fixed trajectory is a YAML file; give a name that ends in .yaml", path)
    for file in fixed_paths(path):
        outputs.check(file)


def write_fixed(fix: Fix, path: str | Path, outputs: Outputs) -> None:
    """Write the trajectory of a fix, and its robot if that has another branch.

    Signals in closed form remain formulas; the others are written to a CSV file of the same stem, at the
    samples and with all derivatives. The robot file is a copy of the user's file with the branch changed.

    Raises:
        InputError, StorageError: see `check_fixed_target`; or the robot file does not admit the change, or
            writing fails.
    """
    document, table, robot = fixed_paths(path)
    trajectory, names = fix.declared, fix.robot.joint_names
    signal_keys = _signal_declarations(trajectory, table.name, fix.robot.tool_names)
    table_signals = [signal for signal, keys in signal_keys.items() if keys["type"] == "csv"]
    table_file = None
    if table_signals:
        table_file = TableFile(table.name, lambda file: _write_table(trajectory, table_signals, names, file))
    text = edited_text(fix, table_file, document.parent) if table_signals in ([], [STIFFNESS]) else None
    lines = _document_lines(trajectory, fix.factor, signal_keys) if text is None else [text]
    contents: dict[Path, Callable[[TextIO], object]] = {document: lambda file: file.writelines(lines)}
    if table_file is not None:
        contents[table] = table_file.write
    if fix.branch is not None:
        contents[robot] = lambda file: file.write(robot_text(fix, robot.parent))
    for target, write in contents.items():
        with outputs.file(target).opened() as stream:
            write(stream)


def _signal_declarations(
    trajectory: Trajectory, table: str, tools: Sequence[str]
) -> dict[Signal, dict[str, Any]]:
    """Return the keys and values that declare each signal; signals without a formula refer to the table."""
    profiles: dict[Signal, Profile | None] = {POSITION: trajectory.position}
    commanded_keys = [key for key in trajectory.commanded if trajectory.chosen(key).any()]
    profiles |= {COMMANDED[key]: trajectory.commanded[key] for key in commanded_keys}
    wrenches = {} if trajectory.wrench is None else _wrenches_on(tools, trajectory.wrench)
    profiles |= {signal: profile for signal, (profile, _) in wrenches.items()}
    formulas = {signal: formula(profile) for signal, profile in profiles.items()}
    if None not in formulas.values() and not isinstance(trajectory.times, UniformTimes):
        formulas[POSITION] = None  # the table has the times
    signal_keys = {
        signal: {"type": "csv", "file": table, **_fit_options(profiles[signal])} if keys is None else keys
        for signal, keys in formulas.items()
    }
    for signal, (_, frame) in wrenches.items():
        signal_keys[signal]["frame"] = frame
    return signal_keys


def _wrenches_on(tools: Sequence[str], wrench: WrenchProfile) -> dict[Signal, tuple[Profile | None, str]]:
    """Return profile and frame of the wrench on each tool, named as in the robot's file.

    The profile is None if one profile holds the wrenches on all tools.
    """
    if isinstance(wrench.frame, str):
        return {signal: (profile, wrench.frame) for signal, profile in wrench.profiles.items()}
    profile_by_column = {signal.first: profile for signal, profile in wrench.profiles.items() if signal.tool}
    frames = zip(map(wrench_on, tools, range(len(tools))), wrench.frame, strict=True)
    return {
        signal: (profile_by_column.get(signal.first), frame) for signal, frame in frames if frame is not None
    }


def _fit_options(profile: Profile | None) -> dict[str, Any]:
    """Return the options of a recording's fit that were given, by key; computed samples are interpolated."""
    estimate = None if profile is None else profile.estimate
    if estimate is None:
        return {"fit": INTERPOLATE}
    fit_choice = estimate.choice
    noise = None if fit_choice.noise is None else list(fit_choice.noise)
    options = {"fit": fit_choice.method, "noise": noise, "bandwidth": fit_choice.bandwidth}
    return {key: value for key, value in options.items() if value is not None}


def _document_lines(
    trajectory: Trajectory, factor: float, signal_keys: Mapping[Signal, dict[str, Any]]
) -> Iterator[str]:
    """Yield the lines of the trajectory file."""
    yield f"format: {file_formats.TRAJECTORY}\n"
    yield f"name: {for_yaml(trajectory.name)}\n"
    if factor != 1:
        yield f"slow_down: {factor!r}\n"
    if isinstance(trajectory.times, UniformTimes) and not any(
        keys["type"] == "csv" for keys in signal_keys.values()
    ):
        yield f"duration: {trajectory.times.duration!r}\nrate: {trajectory.times.rate!r}\n"
    if isinstance(trajectory.times, ResampledTimes) and trajectory.estimates:
        yield f"rate: {trajectory.times.rate!r}\n"
    for signal, keys in signal_keys.items():
        if signal.tool and signal == next(each for each in signal_keys if each.tool):
            yield f"{WRENCHES}:\n"
        indent = "  " if signal.tool else ""
        yield f"{indent}{signal.tool or signal.key}:\n"
        yield from (f"{indent}  {key}: {format_on_one_line(value)}\n" for key, value in keys.items())


def _write_table(
    trajectory: Trajectory, recorded: Sequence[Signal], joint_names: Sequence[str], stream: TextIO
) -> None:
    """Write fitted recordings as they were recorded, and other signals with derivatives at the samples."""
    recorded_rows = {
        (variable, signal.first): each.record.columns[name]
        for signal, each in trajectory.estimates.items()
        for name, variable in zip(signal.names, signal.variables, strict=True)
        if name in each.record.columns
    }
    columns = [
        _TableColumns(
            signal,
            variable,
            _column_headers(signal, name, joint_names),
            recorded_rows.get((variable, signal.first)),
        )
        for signal in recorded
        for name, variable in zip(signal.names, signal.variables, strict=True)
        if (signal.variables[0], signal.first) not in recorded_rows
        or (variable, signal.first) in recorded_rows
    ]
    component_masks = {key: trajectory.chosen(key) for key in trajectory.commanded}
    masks = [component_masks.get(each.signal.key, ...) for each in columns]
    headers = [np.array(each.headers)[mask] for each, mask in zip(columns, masks, strict=True)]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *np.concatenate(headers).tolist()])
    needs_samples = any(each.raw is None for each in columns)
    times, block_samples = _table_times(trajectory), usual_block(len(joint_names))
    for start in range(0, len(times), block_samples):
        block_slice = slice(start, start + block_samples)
        variables = trajectory.block(start, start + block_samples).variables() if needs_samples else {}
        signal_rows = (
            variables[each.variable][:, each.signal.columns]
            if each.raw is None
            else each.raw[:, block_slice].T
            for each in columns
        )
        selected = [of_signal[:, mask] for of_signal, mask in zip(signal_rows, masks, strict=True)]
        writer.writerows(np.concatenate([times[block_slice, None], *selected], axis=1).tolist())


def _table_times(trajectory: Trajectory) -> FloatArray:
    """Return the times of the table: those of a resampled recording, otherwise those of the samples."""
    for estimate in trajectory.estimates.values():
        if estimate.resampled:
            return estimate.record.start + estimate.record.time
    return trajectory.times.block(0, trajectory.samples)


def _column_headers(signal: Signal, name: str, joint_names: Sequence[str]) -> list[str]:
    return wrench_columns(name) if signal.is_wrench else [f"{joint}.{name}" for joint in joint_names]


def robot_text(fix: Fix, folder: Path) -> str:
    """Return the text of the robot's file with the branches of a fix, for a file in `folder`.

    Everything else, comments included, remains as the user wrote it; paths still refer to the same files.

    Raises:
        InputError: the robot was not read from a file, or its text does not admit the change.
    """
    assert fix.branch is not None
    robot_source, source_folder = text_to_change(fix.robot)
    values = {
        branch_path(fix.robot, fix.robot.joint_names.index(joint)): branch
        for joint, branch in fix.branch.branches.items()
    }
    try:
        return edited(robot_source, values | dict(moved_files(robot_source, source_folder, folder)))
    except InputError as error:
        raise InputError.one(
            f"{fix.branch.sentence} there by hand: {error}", fix.robot.sources[0].path
        ) from None
