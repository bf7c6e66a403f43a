"""Study files of a short motion of the 3R arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from samples.command_line import REST_TO_REST, ROBOT, edited

HEAD = "format: vsacli-study/1\nname: springs\nrobot: arm.yaml\ntrajectory: move.yaml\n"
GRID = "vary:\n  joints.*.actuator.spring.k: {linspace: [380, 440, 3]}\n  stiffness.end.elbow: [1000, 1275]\n"
DRAWN = "method: latin_hypercube\nsamples: 6\nseed: 5\nvary:\n  joints.*.actuator.spring.k: {normal: 5 %}\n"


def study(folder: Path, text: str = GRID, head: str = HEAD) -> Path:
    """A study in a folder with its robot and a motion of 13 steps."""
    (folder / "arm.yaml").write_text(ROBOT.read_text())
    edited(REST_TO_REST, folder / "move.yaml", ("rate: 1000 ", "rate: 3 "))
    path = folder / "study.yaml"
    path.write_text(head + text)
    return path


def content(path: Path | str) -> dict[str, Any]:
    """Everything that a table holds, but when it was made and by which command line."""
    found: dict[str, Any] = {}

    def add(name: str, each: Any) -> None:
        found[f"{name}@"] = {key: repr(value) for key, value in each.attrs.items() if key not in _REFERENCES}
        if isinstance(each, h5py.Dataset):
            values = each[...]
            found[name] = values.tolist() if values.dtype == object else values.tobytes()

    with h5py.File(path) as file:
        found["@"] = {
            key: value for key, value in file.attrs.items() if key not in ("created", "command_line")
        }
        file.visititems(add)
    return found


_REFERENCES = ("DIMENSION_LIST", "REFERENCE_LIST")
"""Attributes that point into the file."""


def column(path: Path | str, name: str) -> Any:
    """A column of a table, texts as `str`."""
    with h5py.File(path) as file:
        dataset = file[name]
        return dataset.asstr()[...] if dataset.dtype == object else np.asarray(dataset[...])
