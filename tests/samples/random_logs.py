"""Random headers and layouts of logs, built from words of real ones, with what their columns mean.

Words and layouts are those of ROS (`rostopic -p`, PlotJuggler, joint trajectory controllers), RTDE, MATLAB,
spreadsheets and laboratories' own programs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

JOINTS = ("shoulder", "elbow")

MEASURED = ("act", "actual", "meas", "measured", "real", "ist", "fbk", "")
COMMANDED = ("des", "desired", "cmd", "ref", "set", "target", "goal", "con", "command", "reference", "soll")
OTHERS = {
    "raw": ("raw", "unfiltered"),
    "filtered": ("filt", "filtered", "lowpass"),
    "error": ("err", "error"),
}

QUANTITIES = {
    "q": ("q", "pos", "position", "angle", "enc"),
    "dq": ("dq", "vel", "velocity", "qd", "speed"),
    "tau": ("tau", "torque", "effort", "trq"),
}

TIMES = ("time", "t", "stamp", "timestamp", "__time", "%time", "header.stamp", "Time")
UNIT_SIZES = {"": 1.0, "ms": 1e-3, "us": 1e-6}

PATTERNS = (
    *("{joint}_{quantity}_{role}", "{role}_{joint}_{quantity}", "{joint}.{quantity}.{role}"),
    *("{quantity}_{role}_{number}", "{quantity}_{role}{number}", "{role}_{quantity}_{index}"),
    *("/joint_states/{role}/{joint}/{quantity}", "/robot/{role}/{quantity}[{index}]"),
    *("{quantity}{number}_{role}", "{joint} {quantity} {role}", "{quantity}{role}{number}"),
)


class Log(NamedTuple):
    """A log, and the meaning of its columns.

    Attributes:
        content: text of the file.
        roles: role of each column by its name: measured, commanded, raw, filtered or error.
        positions: columns of measured positions (raw and filtered ones included) in the order of the joints.
        unusable: why no trajectory can be proposed; empty if one must be.
    """

    content: str
    roles: Mapping[str, str]
    positions: tuple[str, ...]
    unusable: str


def name_of(pattern: str, joint: int, quantity: str, role: str) -> str:
    name = pattern.format(joint=JOINTS[joint], quantity=quantity, role=role, number=joint + 1, index=joint)
    for doubled in ("__", "//", "..", "  "):
        name = name.replace(doubled, doubled[0])
    return name.strip("_. ")


def random_log(seed: int) -> Log:
    """Return a log of a two-joint arm, at 100 Hz and more."""
    random = np.random.default_rng(seed)
    pattern = str(random.choice(PATTERNS))
    columns, roles, positions = _signals(random, pattern)
    rate = float(random.choice([100.0, 125.0, 250.0, 500.0]))
    rows = int(random.integers(80, 160))
    clock, name, unusable, start = _clock(random, rate, rows)
    time = np.arange(rows) / rate
    values = {
        column: np.sin(2 * time + 0.3 * number) * (0.9 if roles[column] != "error" else 0.01)
        for number, column in enumerate(columns)
    }
    cells = {column: [f"{value:.6f}" for value in row] for column, row in values.items()}
    _spoil(random, cells)
    numbered = any("[" in column or column[-1:].isdigit() for column in columns)  # by whose order joints go
    mixed = random.random() < 0.3 and not numbered
    order = list(random.permutation(columns)) if mixed else columns
    table = {**({name: clock} if name else {}), **{column: cells[column] for column in order}}
    return Log(_written(random, table, start), roles, positions, unusable)


def _signals(random: np.random.Generator, pattern: str) -> tuple[list[str], dict[str, str], tuple[str, ...]]:
    words = {kind: str(random.choice(choices)) for kind, choices in QUANTITIES.items()}
    roles = {"measured": str(random.choice(MEASURED)), "commanded": str(random.choice(COMMANDED))}
    for role, choices in OTHERS.items():
        if random.random() < 0.3:
            roles[role] = str(random.choice(choices))
    if random.random() < 0.15:
        del roles["measured"]
        roles.pop("raw", None)
        roles.pop("filtered", None)
    kinds = ["q", *(kind for kind in ("dq", "tau") if random.random() < 0.6)]
    order = list(random.permutation(list(roles)))
    columns: dict[str, str] = {}
    positions: dict[str, tuple[str, ...]] = {}
    for kind in kinds:
        for role in order:
            names = tuple(name_of(pattern, joint, words[kind], roles[role]) for joint in range(len(JOINTS)))
            columns |= dict.fromkeys(names, role)
            if kind == "q":
                positions[role] = names
    measured = [name for role in ("measured", "raw", "filtered") for name in positions.get(role, ())]
    return list(columns), columns, tuple(measured)


def _clock(random: np.random.Generator, rate: float, rows: int) -> tuple[list[str], str, str, str]:
    """Return the cells of the stamps, their name, why they cannot be used, and their unit."""
    unit = str(random.choice(list(UNIT_SIZES)))
    stamps = (float(random.choice([0.0, 12.5, 1000.0])) + np.arange(rows) / rate) / UNIT_SIZES[unit]
    name = str(random.choice(TIMES)) + (f"[{unit}]" if unit else "")
    draw = random.random()
    if draw < 0.1:
        return [], "", "no column holds times", unit
    if draw < 0.2:
        stamps[rows // 2 :] -= stamps[rows // 2] - stamps[0]
        return [f"{stamp:.9g}" for stamp in stamps], name, "the recording begins again", unit
    if draw < 0.3:
        return [f"{stamp:.{2 if unit == '' else 12}g}" for stamp in stamps], name, "", unit
    return [f"{stamp:.12g}" for stamp in stamps], name, "", unit


def _spoil(random: np.random.Generator, cells: dict[str, list[str]]) -> None:
    """Make cells of some rows missing, in all columns."""
    if random.random() < 0.3:
        word = str(random.choice(["", "nan", "NA", "-nan(ind)", "null"]))
        for row in random.integers(10, 60, 3).tolist():
            for column in cells.values():
                column[row] = word


def _written(random: np.random.Generator, table: dict[str, list[str]], unit: str) -> str:
    separator = str(random.choice([",", ";", "\t"]))
    lines = [separator.join(table), *(separator.join(row) for row in zip(*table.values(), strict=True))]
    draw = random.random()
    if draw < 0.15:
        units = [
            unit or "s" if column in TIMES or column.partition("[")[0] in TIMES else "-" for column in table
        ]
        lines.insert(1, separator.join(units))
    elif draw < 0.3:
        lines = [*_preamble(random), *lines]
    return "\n".join(lines) + "\n"


def _preamble(random: np.random.Generator) -> Iterator[str]:
    yield "Recorder version 3.1"
    if random.random() < 0.5:
        yield f"Rate,{random.integers(100, 500)} Hz"
    if random.random() < 0.5:
        yield ""
