"""Random recordings of computed motions, with planted faults and what a comparison should find; nothing of
`vsacli compare`.

The truth is the same motion computed at eight times the rate, between whose samples SciPy interpolates.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from samples.command_line import REPOSITORY, edited
from vsacli.cli.main import run

RATE, FINE = 250, 2000
"""Samples per second of the result, and of the truth."""

MOTIONS: Mapping[str, tuple[str, str, tuple[tuple[str, str], ...]]] = {
    "all": ("vsa_3r", "rest_to_rest", (("rate: 1000 ", "rate: {} "),)),
    "still": (
        "vsa_3r",
        "rest_to_rest",
        (("rate: 1000 ", "rate: {} "), ("end: [90 deg, 45 deg, -60 deg]", "end: [0, 45 deg, -60 deg]")),
    ),
    "seven": (
        "lwr_7r_vsa",
        "lwr_7r",
        (("rate: 1000 ", "rate: {} "), ("-30 deg, 75 deg, 20 deg, -40 deg", "0, 75 deg, 0, -40 deg")),
    ),
    "via": ("vsa_3r", "vsa_3r_via", (("rate: 1000", "rate: {}"),)),
    "waves": ("vsa_3r", "vsa_3r_excitation", (("rate: 250", "rate: {}"),)),
}
"""Robot, trajectory and changes of it, by a name."""

VARIABLES = ("q", "theta", "tau_motor")

STILL = 1e-8
"""Share of the largest value of a variable below which a signal holds still."""


@dataclass(frozen=True)
class Motion:
    """A computed motion: its file, and the truth as functions of time."""

    result: Path
    duration: float
    signals: Mapping[str, CubicSpline]
    ranges: Mapping[str, float]
    largest: Mapping[str, float]

    def still(self, column: str) -> bool:
        return self.ranges[column] <= STILL * self.largest[variable_of(column)]


@dataclass
class Planted:
    """A random recording, and what is true of it.

    `gains` and `offsets` are of the columns that can be judged; `faults` say, for a column, with which words
    a note must name it.
    """

    path: Path
    motion: Motion
    time_offset: float
    gains: dict[str, float] = field(default_factory=dict)
    offsets: dict[str, float] = field(default_factory=dict)
    noises: dict[str, float] = field(default_factory=dict)
    samples: dict[str, int] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)

    @cached_property
    def vague(self) -> set[str]:
        """Columns that move so little beyond their noise that they need not be judged."""
        return {
            column
            for column, noise in self.noises.items()
            if self.motion.ranges[column] < 60 * noise / math.sqrt(self.samples[column])
        }


def variable_of(column: str) -> str:
    """`elbow.tau_motor_1` is of `tau_motor`."""
    name = column.partition(".")[2]
    return name.rstrip("12").rstrip("_")


def computed_motion(name: str, folder: Path) -> Motion:
    """Compute a motion twice."""
    robot, trajectory, changes = MOTIONS[name]
    columns: dict[int, dict[str, np.ndarray]] = {}
    for rate in (RATE, FINE):
        stem = folder / f"{name}_{rate}"
        source = REPOSITORY / "trajectories" / f"{trajectory}.yaml"
        motion = edited(source, stem.with_suffix(".yaml"), *((old, new.format(rate)) for old, new in changes))
        files = [str(REPOSITORY / "robots" / f"{robot}.yaml"), str(motion)]
        assert run(["invdyn", *files, "-q", "-o", f"{stem}.h5"]) in (0, 3)
        assert (
            run(["export", f"{stem}.h5", "--variables", ",".join(VARIABLES), "-o", f"{stem}.csv", "-q"]) == 0
        )
        with stem.with_suffix(".csv").open() as file:
            header, *rows = csv.reader(file)
        columns[rate] = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    fine = columns[FINE]
    time = fine.pop("time")
    largest: dict[str, float] = {}
    for column, values in fine.items():
        variable = variable_of(column)
        largest[variable] = max(largest.get(variable, 0.0), float(np.abs(values).max()))
    return Motion(
        result=folder / f"{name}_{RATE}.h5",
        duration=float(time[-1]),
        signals={column: CubicSpline(time, values) for column, values in fine.items()},
        ranges={column: float(np.ptp(values)) for column, values in fine.items()},
        largest=largest,
    )


def random_recording(motion: Motion, path: Path, seed: int) -> Planted:
    """Write a recording of a motion with faults in less than a third of the columns that move."""
    draw = np.random.default_rng(seed)
    time, time_offset = _times(draw, motion.duration)
    columns = _chosen(draw, motion)
    planted = Planted(path, motion, time_offset)
    inside = np.clip(time - time_offset, 0, motion.duration)
    held = {column: motion.signals[column](inside) for column in columns}
    if draw.random() < 0.2:
        _approach(draw, held, time, time_offset)
    faults = _faults(draw, motion, columns)
    recorded, units = {}, {}
    for column in columns:
        fault = faults.get(column, "")
        source = fault.removeprefix("exchanged ") if fault.startswith("exchanged") else column
        clean, units[column] = _faulty(draw, planted, column, held[source], fault)
        recorded[column] = _noisy(draw, planted, column, clean)
    kept = _rows(draw, columns, len(time))
    for column, values in recorded.items():
        kept[column] |= (
            np.abs(values - np.median(values)) > 10 * planted.motion.ranges[column]
        )  # wild ones stay
    for column in columns:
        there = kept[column] & (time >= time_offset) & (time <= time_offset + motion.duration)
        planted.samples[column] = int(np.count_nonzero(there))
    _write(path, time, recorded, units, kept)
    return planted


def _times(draw: np.random.Generator, duration: float) -> tuple[np.ndarray, float]:
    """Stamps from 0 on, and when the motion begins: within the recording, or before it."""
    rate = draw.choice([100.0, 125.0, 200.0, 333.3, 500.0, 1000.0])
    time_offset = draw.uniform(-0.25 * duration, 1.0)
    end = (
        time_offset + duration * draw.uniform(0.75, 1.0)
        if draw.random() < 0.3
        else time_offset + duration + draw.uniform(0, 1)
    )
    time = np.arange(0, end, 1 / rate)
    if draw.random() < 0.3:
        time[1:] += draw.uniform(-0.3, 0.3, len(time) - 1) / rate
    return time, float(time_offset)


def _chosen(draw: np.random.Generator, motion: Motion) -> list[str]:
    """Positions and motor positions, or torques as well, in any order."""
    kinds = draw.choice(["q theta", "q theta tau_motor", "q tau_motor", "tau_motor", "theta"]).split()
    columns = [column for column in motion.signals if variable_of(column) in kinds]
    draw.shuffle(columns)
    return columns


def _approach(
    draw: np.random.Generator, held: dict[str, np.ndarray], time: np.ndarray, time_offset: float
) -> None:
    """Another motion before this one, as of a robot that is driven to its start."""
    before = time_offset - 0.2
    if before < 0.3:
        return
    shape = np.where(time < before, np.sin(np.pi * np.clip(time / before, 0, 1)) ** 2, 0.0)
    for column, values in held.items():
        held[column] = values + draw.uniform(-0.3, 0.3) * np.ptp(values) * shape


def _faults(draw: np.random.Generator, motion: Motion, columns: list[str]) -> dict[str, str]:
    """Kinds of faults by columns, of less than a third of those that decide on the alignment."""
    moving = [column for column in columns if not motion.still(column)]
    deciding = [column for column in moving if variable_of(column) != "tau_motor"] or moving
    others = [column for column in moving if column not in deciding]
    count = draw.integers(0, (len(deciding) - 1) // 3 + 1)
    chosen = [
        *draw.permutation(deciding)[:count].tolist(),
        *draw.permutation(others)[: len(others) // 3].tolist(),
    ]
    faults: dict[str, str] = {}
    while chosen:
        column = chosen.pop()
        partner = next((each for each in chosen if variable_of(each) == variable_of(column)), None)
        if partner is not None and draw.random() < 0.6 and _differ(motion, column, partner):
            chosen.remove(partner)
            faults |= {column: f"exchanged {partner}", partner: f"exchanged {column}"}
        else:
            faults[column] = str(draw.choice(["offset", "gain", "sign", "unit", "wild", "stuck"]))
            if variable_of(column) != "tau_motor" and draw.random() < 0.1:
                faults[column] = "marked"
    return faults


def _differ(motion: Motion, one: str, other: str) -> bool:
    """Whether it can be seen that two columns are exchanged."""
    time = np.linspace(0, motion.duration, 500)
    apart = motion.signals[one](time) - motion.signals[other](time)
    return bool(np.sqrt(np.mean(apart**2)) > 0.1 * max(motion.ranges[one], motion.ranges[other]))


def _faulty(
    draw: np.random.Generator, planted: Planted, column: str, values: np.ndarray, fault: str
) -> tuple[np.ndarray, str]:
    """Values with a fault, and the unit in the header."""
    gain, offset, unit = 1.0, 0.0, ""
    rotates, span = variable_of(column) != "tau_motor", planted.motion.ranges[column]
    if fault.startswith("exchanged"):
        planted.faults[column] = "columns look exchanged"
        return values, unit
    if fault == "stuck":
        planted.faults[column] = "does not move"
        return np.full_like(values, values[0]), unit
    if fault == "offset":
        offset = draw.choice([-1, 1]) * draw.uniform(0.05, 0.2) * span
        planted.faults[column] = " off"
    elif fault == "gain":
        gain = draw.choice([draw.uniform(0.75, 0.94), draw.uniform(1.06, 1.3)])
        planted.faults[column] = "times as large as computed"
    elif fault == "sign":
        gain = -1.0
        planted.faults[column] = "runs the other way"
    elif fault == "unit":
        gain = 180 / math.pi if rotates else 1000.0
        planted.faults[column] = "is in degrees" if rotates else "in thousandths of the unit"
    elif fault == "marked":
        gain, unit = math.pi / 180, " [deg]"
        planted.faults[column] = "marked as degrees"
    elif fault == "wild":
        planted.faults[column] = "far from all others"
    if not planted.motion.still(column):
        planted.gains[column], planted.offsets[column] = gain, offset
    return gain * values + offset, unit


def _noisy(draw: np.random.Generator, planted: Planted, column: str, values: np.ndarray) -> np.ndarray:
    """White noise, or colored one, of a share of what the variable does; wild samples if that is the
    fault."""
    size = np.ptp(values) or planted.motion.largest[variable_of(column)]
    noise = size * 10 ** draw.uniform(-5, -1.7)
    white = draw.standard_normal(len(values))
    if draw.random() < 0.3:
        for sample in range(1, len(white)):
            white[sample] = 0.8 * white[sample - 1] + 0.6 * white[sample]
    planted.noises[column] = noise / abs(planted.gains.get(column, 1.0))
    noisy = values + noise * white
    if planted.faults.get(column) == "far from all others":
        middle = len(values) // 2
        noisy[draw.integers(middle - 20, middle + 20, 3)] = draw.choice([-1e308, 1e6, 50 * size])
    return noisy


def _rows(draw: np.random.Generator, columns: list[str], count: int) -> dict[str, np.ndarray]:
    """Which rows a column has: most have all, some lack a half at random, a stretch, or three of four."""
    kept = {}
    for column in columns:
        there = np.ones(count, dtype=bool)
        kind = draw.random()
        if kind < 0.15:
            there = draw.random(count) < 0.5
        elif kind < 0.25:
            there[count // 3 : count // 3 + count // 6] = False
        elif kind < 0.35:
            there[:] = np.arange(count) % 4 == 0
        kept[column] = there
    kept[columns[0]][:] = True
    return kept


def _write(
    path: Path,
    time: np.ndarray,
    recorded: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    kept: Mapping[str, np.ndarray],
) -> None:
    headings = ["time", *(f"{column}{units[column]}" for column in recorded)]
    as_written = {column: math.degrees(1) if unit else 1.0 for column, unit in units.items()}
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(headings)
        cells = [
            [
                repr(float(value)) if there else ""
                for value, there in zip(values * as_written[column], kept[column], strict=True)
            ]
            for column, values in recorded.items()
        ]
        writer.writerows(zip(map(repr, time.tolist()), *cells, strict=True))
