"""Results stored in several ways: processor time to write and to read them, and bytes a sample.

Filters that every HDF5 library has are tried, and LZF, which comes with h5py; others are plug-ins that
whoever reads the file must have, too.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from stages import trajectory_of
from subjects import PAPER, seven_joints
from timing import cpu_seconds, medians

from vsacli import Result, Trajectory, inverse_dynamics, load_robot, load_trajectory
from vsacli.results.store.new_file import chunk_rows

SAMPLES = 20_000
POSITION_NOISE, STIFFNESS_NOISE = 2e-5, 0.5
"""Of a recording, standard deviations in rad and N m/rad."""

GZIP = {"compression": "gzip"}
WAYS: dict[str, dict[str, Any]] = {
    "double": {},
    "gzip 1": {**GZIP, "compression_opts": 1},
    "gzip 4": {**GZIP, "compression_opts": 4},
    "gzip 9": {**GZIP, "compression_opts": 9},
    "shuffle, gzip 1": {**GZIP, "compression_opts": 1, "shuffle": True},
    "shuffle, gzip 4": {**GZIP, "compression_opts": 4, "shuffle": True},
    "lzf": {"compression": "lzf"},
    "shuffle, lzf": {"compression": "lzf", "shuffle": True},
    "single": {"dtype": "<f4"},
    "single, shuffle, gzip 1": {"dtype": "<f4", **GZIP, "compression_opts": 1, "shuffle": True},
}
"""Options of the datasets of floating-point variables."""


class Stored(NamedTuple):
    """What a sample takes: seconds to write and to read, and bytes."""

    write: float
    read: float
    size: float


def compare(repeats: int) -> dict[str, dict[str, Stored]]:
    """What a sample of each subject takes, by subject and way."""
    return {name: dict(_stored(result.arrays(), repeats)) for name, result in _subjects()}


def _subjects() -> Iterator[tuple[str, Result]]:
    seven = seven_joints()
    yield "7R arm", inverse_dynamics(seven, trajectory_of(SAMPLES))
    arm = load_robot(PAPER[0])
    move = load_trajectory(PAPER[1], arm)
    time = np.linspace(*move.times.span, SAMPLES)
    motion, noise = move.at(time), np.random.default_rng(0).standard_normal
    exact = {name: values for name, values in motion.variables().items() if name != "time"}
    yield "3R arm", inverse_dynamics(arm, Trajectory.from_samples(time, **exact))
    q = motion.q + POSITION_NOISE * noise(motion.q.shape)
    stiffness = exact["stiffness"] + STIFFNESS_NOISE * noise(motion.q.shape)
    yield "3R arm, recorded", inverse_dynamics(arm, Trajectory.from_samples(time, q, stiffness))


def _stored(arrays: Mapping[str, np.ndarray], repeats: int) -> Iterator[tuple[str, Stored]]:
    with tempfile.TemporaryDirectory() as folder:
        paths = {way: Path(folder, f"{number}.h5") for number, way in enumerate(WAYS)}
        writing = medians(
            {
                way: cpu_seconds(lambda way=way, path=path: _write(path, arrays, WAYS[way]))
                for way, path in paths.items()
            },
            repeats,
        )
        reading = medians(
            {way: cpu_seconds(lambda path=path: _read(path)) for way, path in paths.items()}, repeats
        )
        for way, path in paths.items():
            taken = (writing[way], reading[way], path.stat().st_size)
            yield way, Stored(*(each / len(arrays["time"]) for each in taken))


def _write(path: Path, arrays: Mapping[str, np.ndarray], options: Mapping[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            kind = {"dtype": values.dtype, **(options if values.dtype.kind == "f" else {})}
            row = values[0].size * np.dtype(kind["dtype"]).itemsize
            chunks = (chunk_rows(len(values), row), *values.shape[1:])
            file.create_dataset(name, values.shape, chunks=chunks, **kind)[...] = values


def _read(path: Path) -> None:
    with h5py.File(path) as file:
        for dataset in file.values():
            dataset[...]
