"""The user's trajectory file with a fix applied: changed values are replaced in place, all else is kept.

Comments, layout, units and joint names remain as the user wrote them. Not every file admits this, for example
if aliases share values; so the new text is read back and used only if it reproduces the fix at every sample.
Profiles in closed form are declared by the keys and values of `formula`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.signals import COMMANDED, POSITION, Signal
from vsacli.base.storage import reading_copies, temporary_folder
from vsacli.documents.edited import MappingNode, Node, ScalarNode, edited, moved_files, node_at, root_of
from vsacli.documents.source import is_table
from vsacli.studies.search.fix_report import Fix
from vsacli.trajectory.curves import ClosedForm, ConstantProfile, RestToRest
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.curves.steps import PiecewiseProfile
from vsacli.trajectory.curves.via_points import ViaPoints
from vsacli.trajectory.file import load_trajectory
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.trajectory import Trajectory

SAME_TRANSITION = 1e-9
"""Largest relative difference of transition times that are equal but for rounding."""


def formula(profile: Profile | None) -> dict[str, Any] | None:
    """Return the keys and values that declare a profile over its span; None if it has no formula."""
    match profile:
        case RestToRest(degree=degree, start=start, end=end):
            return {
                "type": "polynomial",
                "degree": degree,
                "start": _values_or_null(start),
                "end": _values_or_null(end),
            }
        case ConstantProfile(value=value):
            return {"type": "constant", "value": _values_or_null(value)}
        case ViaPoints(degree=degree, points=points, breakpoints=passed):
            times = (passed - passed[0]).tolist()
            return {
                "type": "via",
                "degree": degree,
                "points": list(map(_values_or_null, points)),
                "times": times,
            }
        case Sinusoids():
            return _sinusoids(profile)
        case PiecewiseProfile():
            return _sequence(profile) if profile.signal is POSITION else _step_keys(profile)
    return None


def _sinusoids(profile: Sinusoids) -> dict[str, Any]:
    amplitudes = {
        "sine": list(map(_values_or_null, profile.sine)),
        "cosine": list(map(_values_or_null, profile.cosine)),
    }
    return {
        "type": "sinusoids",
        "frequency": profile.cycles / _profile_duration(profile),
        "offset": _values_or_null(profile.offset),
        **{name: harmonics for name, harmonics in amplitudes.items() if harmonics},
        "ramp": profile.ramp * _profile_duration(profile),
    }


def _sequence(chain: PiecewiseProfile) -> dict[str, Any] | None:
    """Return the keys of a sequence: its parts with their durations, constant ones as dwells."""
    parts = []
    for part in chain.parts:
        keys = formula(part)
        if keys is None:
            return None
        if isinstance(part, ConstantProfile):
            keys = {"type": "dwell"}
        parts.append(keys if "times" in keys else {**keys, "duration": _profile_duration(part)})
    return {"type": "sequence", "parts": parts}


def step_transitions(chain: PiecewiseProfile) -> list[RestToRest] | None:
    """Return the transitions of a step profile, which have equal durations; None for another chain."""
    transitions = [part for part in chain.parts if isinstance(part, RestToRest)]
    dwells = [part for part in chain.parts if isinstance(part, ConstantProfile)]
    durations = list(map(_profile_duration, transitions))
    if len(transitions) + len(dwells) < len(chain.parts) or not transitions:
        return None
    if len({change.degree for change in transitions}) > 1 or not math.isclose(
        min(durations), max(durations), rel_tol=SAME_TRANSITION
    ):
        return None
    return transitions


def _step_keys(chain: PiecewiseProfile) -> dict[str, Any] | None:
    """Return the keys of a step profile: levels, start times and duration of its transitions."""
    transitions = step_transitions(chain)
    if transitions is None:
        return None
    return {
        "type": "steps",
        "degree": transitions[0].degree,
        "levels": [
            _values_or_null(transitions[0].start),
            *(_values_or_null(change.end) for change in transitions),
        ],
        "times": [change.span[0] - chain.span[0] for change in transitions],
        "transition": min(map(_profile_duration, transitions)),
    }


def _profile_duration(profile: ClosedForm) -> float:
    start, end = profile.span
    return end - start


def _values_or_null(values: Sequence[float]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values]


SAME = 1e-9
"""Relative difference up to which values are equal but for rounding; limits tolerate it."""

CLOSE = 1e-8
"""Share of a variable's peak by which the text may miss it: rounding, amplified by four derivatives."""

DIGITS = 12
"""Significant digits of the new values."""

Values = dict[str, Any]


class TableFile(NamedTuple):
    """The table with the stiffness, next to the trajectory file.

    Attributes:
        name: file name.
        write: function that writes the table to a stream.
    """

    name: str
    write: Callable[[TextIO], object]


def edited_text(fix: Fix, table: TableFile | None, folder: Path) -> str | None:
    """Return the text of the user's file with the fix applied; None if the file does not admit it.

    Args:
        fix: fix to apply.
        table: table with the stiffness, if it no longer has a formula.
        folder: folder of the new file.
    """
    commanded = fix.asked
    source = None if commanded is None else next(iter(commanded.sources), None)
    if commanded is None or source is None or source.text is None or is_table(source.path):
        return None
    for values in _candidates(fix, commanded, source.text):
        try:
            text = _with_new_values(source.text, values, table)
            moved = dict(moved_files(source.text, Path(source.path).parent, folder))
            if _reproduces_fix(text, source.path, fix, table):
                moved_paths = {
                    path: file for path, file in moved.items() if table is None or path != "stiffness.file"
                }
                return edited(text, moved_paths)
        except InputError:
            continue
    return None


def _candidates(fix: Fix, commanded: Trajectory, text: str) -> Iterator[Values]:
    """Yield values by path that may declare the fix: first with other times, then with `slow_down`."""
    root, names = root_of(text), fix.robot.joint_names
    fixed = fix.declared
    name_value = {"name": fixed.name}
    if fix.factor == 1:
        yield (
            name_value
            | _changed_formula_values(root, commanded, fixed, names)
            | _duration_value(root, commanded, fixed)
        )
    factor = 1 + fix.longer
    unstretched = fixed if fix.factor != 1 else fixed.stretched(1 / factor)
    slow_down_node = node_at(root, "slow_down")
    declared_factor = float(slow_down_node.value) if isinstance(slow_down_node, ScalarNode) else 1.0
    slow_down_value = {} if factor == 1 else {"slow_down": _rounded_number(declared_factor * factor)}
    yield name_value | _changed_formula_values(root, commanded, unstretched, names) | slow_down_value


def _duration_value(root: Node, commanded: Trajectory, fixed: Trajectory) -> Values:
    if commanded.duration == fixed.duration or node_at(root, "duration") is None:
        return {}
    return {"duration": _rounded_number(fixed.duration)}


def _changed_formula_values(
    root: Node, commanded: Trajectory, fixed: Trajectory, names: Sequence[str]
) -> Values:
    """Return the values of formulas that differ, by path, where the text has them."""
    values: Values = {}
    for signal, profile in _profiles_by_signal(commanded).items():
        old, new = formula(profile), formula(_profiles_by_signal(fixed)[signal])
        node = node_at(root, signal.key)
        if old is not None and new is not None and node is not None:
            values |= dict(_changed_values(node, signal.key, old, new, names))
    return values


def _profiles_by_signal(trajectory: Trajectory) -> dict[Signal, Profile]:
    profiles: dict[Signal, Profile] = {POSITION: trajectory.position}
    profiles |= {COMMANDED[key]: profile for key, profile in trajectory.commanded.items()}
    if trajectory.wrench is not None:
        profiles |= trajectory.wrench.profiles
    return profiles


def _changed_values(
    node: Node, path: str, old: Any, new: Any, names: Sequence[str]
) -> Iterator[tuple[str, Any]]:
    """Yield paths below `path` and their new values: single values if the text has them, else whole lists."""
    if isinstance(old, dict):
        for key, value in old.items():
            child_node = node_at(node, key)
            if child_node is not None:
                yield from _changed_values(child_node, f"{path}.{key}", value, new[key], names)
    elif isinstance(old, list):
        if _equal_up_to_rounding(old, new):
            return
        keys = list(names) if isinstance(node, MappingNode) else list(map(str, range(len(old))))
        if isinstance(node, ScalarNode):
            yield path, _value_for_all(new)
            return
        for child_key, old_value, new_value in zip(keys, old, new, strict=True):
            child_node = node_at(node, child_key)
            if child_node is not None:
                yield from _changed_values(child_node, f"{path}.{child_key}", old_value, new_value, names)
    elif not _equal_up_to_rounding(old, new):
        yield path, _rounded_number(new)


def _equal_up_to_rounding(old: Any, new: Any) -> bool:
    """Return whether numbers, or lists of them, are equal but for rounding."""
    if isinstance(old, list):
        return all(map(_equal_up_to_rounding, old, new))
    if isinstance(old, float | int) and isinstance(new, float | int):
        return math.isclose(old, new, rel_tol=SAME, abs_tol=SAME * SAME)
    return bool(old == new)


def _value_for_all(values: list[Any]) -> Any:
    """Return one number if it holds for all joints, else the list."""
    rounded_values = [None if value is None else _rounded_number(value) for value in values]
    return (
        rounded_values[0] if all(value == rounded_values[0] for value in rounded_values) else rounded_values
    )


def _rounded_number(value: float) -> float | int:
    number = float(f"{value:.{DIGITS}g}")
    return int(number) if number.is_integer() and abs(number) < 10**DIGITS else number


def _with_new_values(text: str, values: Values, table: TableFile | None) -> str:
    """Return the text with new values; with a table, stiffness and times come from the table."""
    if table is None:
        return edited(text, values)
    values = {key: value for key, value in values.items() if not key.startswith("stiffness.")}
    values["stiffness"] = {"type": "csv", "file": table.name}
    text = edited(text, values)
    time_nodes = [node_at(root_of(text), key) for key in ("duration", "rate", "slow_down")]
    for node in sorted(
        (node for node in time_nodes if node is not None), key=lambda node: -node.start_mark.index
    ):
        line_start = text.rfind("\n", 0, node.start_mark.index) + 1
        text = f"{text[:line_start]}# {text[line_start:]}"
    return text


def _reproduces_fix(text: str, path: str, fix: Fix, table: TableFile | None) -> bool:
    """Return whether a text in place of the user's file reproduces the fix at every sample."""
    with temporary_folder() as folder:
        copies = {path: str(folder / "text")}
        (folder / "text").write_text(text, encoding="utf-8")
        if table is not None:
            copies[os.path.join(os.path.dirname(path), table.name)] = str(folder / "table")
            with (folder / "table").open("w", encoding="utf-8") as stream:
                table.write(stream)
        with reading_copies(copies):
            read_trajectory = load_trajectory(path, fix.robot)
    expected_trajectory = fix.trajectory
    if read_trajectory.samples != expected_trajectory.samples:
        return False
    blocks = (each.block(0, each.samples).variables() for each in (read_trajectory, expected_trajectory))
    read_variables, expected_variables = blocks
    return read_variables.keys() == expected_variables.keys() and all(
        np.allclose(
            read_variables[name],
            array,
            rtol=0,
            atol=CLOSE * np.nanmax(np.abs(array), initial=0.0),
            equal_nan=True,
        )
        for name, array in expected_variables.items()
    )
