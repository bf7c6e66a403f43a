"""A further signal by which joints are commanded: declared once, it is carried by everything."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples import second_signal
from samples.command_line import REPOSITORY, edited

pytestmark = pytest.mark.slow

NAMES = second_signal.PRETENSION.names
ARM, MIXED = "vsa_3r.yaml", "mixed_3r.yaml"

MOTION = """\
format: vsacli-trajectory/1
name: pretensioned
duration: 0.5
rate: 100
position: {type: polynomial, degree: 7, start: [0, 0, 0], end: [0.1, 0.1, -0.1]}
"""
FILES = {
    "arm": "stiffness: {type: polynomial, degree: 3, start: 1500, end: 2000}\n"
    "pretension: {type: via, degree: 5, points: [0.1, 0.3, -0.2], times: [0, 0.2, 0.5]}\n",
    "soft": "stiffness: {type: polynomial, degree: 3, start: 1500, end: 790}\n"
    "pretension: {type: constant, value: [0.1, 0.2, 0.3]}\n",
    "mixed": "stiffness: {type: constant, value: {elbow: 1500}}\n"
    "pretension: {type: polynomial, degree: 3, start: [null, null, 0.1], end: {elbow: 0.2}}\n",
    "without": "stiffness: {type: constant, value: 1500}\n",
    "rough": "stiffness: {type: constant, value: 1500}\n"
    "pretension: {type: polynomial, degree: 4, start: 0, end: 1}\n",
    "foreign": "stiffness: {type: constant, value: {elbow: 1500}}\n"
    "pretension: {type: constant, value: {shoulder: 0.1, elbow: 0.1}}\n",
}

LINES = {
    "schema": ["schema", "trajectory"],
    "validate": ["validate", ARM, "arm.yaml"],
    "info": ["info", "arm.yaml", "--robot", ARM],
    "invdyn": ["invdyn", ARM, "arm.yaml", "-o", "numpy.h5"],
    "compiled": ["invdyn", ARM, "arm.yaml", "-o", "c.h5", "--engine", "c"],
    "plot": ["plot", "numpy.h5", "--joints", "elbow", "-o", "figures"],
    "export": ["export", "numpy.h5", "--variables", ",".join(["q", "stiffness", *NAMES]), "-o", "table.csv"],
    "table": ["invdyn", ARM, "table.csv", "-o", "table.h5"],
    "check": ["check-feasibility", ARM, "soft.yaml", "--write-fix", "1", "-o", "fixed.yaml"],
    "fixed": ["invdyn", ARM, "fixed.yaml", "-o", "fixed.h5"],
    "mixed": ["invdyn", MIXED, "mixed.yaml", "-o", "mixed.h5"],
    "columns": ["export", "mixed.h5", "--variables", "stiffness,pretension"],
    "simulate": ["simulate", ARM, "arm.yaml", "-o", "simulated.h5"],
    "codegen": ["codegen", ARM, "-o", "code"],
    "new": ["new", "trajectory", "--robot", ARM, "-o", "new.yaml"],
    "from new": ["check-feasibility", ARM, "new.yaml"],
    "without": ["invdyn", ARM, "without.yaml", "-o", "refused.h5"],
    "rough": ["invdyn", ARM, "rough.yaml", "-o", "refused.h5"],
    "foreign": ["invdyn", MIXED, "foreign.yaml", "-o", "refused.h5"],
}
"""Later lines take what earlier ones wrote."""

CODES = {"without": 2, "rough": 2, "foreign": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("second")
    for name, commanded in FILES.items():
        (folder / f"{name}.yaml").write_text(MOTION + commanded)
    for name in (ARM, MIXED):
        edited(REPOSITORY / "robots" / name, folder / name, ("type: antagonistic", "type: pretensioned"))
    return folder


@pytest.fixture(scope="module")
def outcomes(folder: Path) -> dict[str, tuple[int, str]]:
    done = subprocess.run(
        [sys.executable, second_signal.__file__],
        input=json.dumps(list(LINES.values())),
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(zip(LINES, json.loads(done.stdout), strict=True))


def stored(path: Path, name: str) -> np.ndarray:
    with h5py.File(path) as file:
        return np.asarray(file[name])


@pytest.mark.parametrize("line", LINES)
def test_every_command_takes_it(line: str, outcomes: dict[str, tuple[int, str]]) -> None:
    code, text = outcomes[line]
    assert code == CODES.get(line, 0), text


def test_results_hold_what_was_commanded(outcomes: dict[str, tuple[int, str]], folder: Path) -> None:
    assert outcomes
    pretension = stored(folder / "numpy.h5", "pretension")
    np.testing.assert_allclose(pretension[[0, 20, -1]], [[0.1] * 3, [0.3] * 3, [-0.2] * 3])
    with h5py.File(folder / "numpy.h5") as file:
        names = list(file)
        assert names[names.index("ddstiffness") + 1 :][:3] == list(NAMES)
        assert dict(file["dpretension"].attrs)["units"] == "rad/s"
    for name in NAMES:
        np.testing.assert_array_equal(stored(folder / "c.h5", name), stored(folder / "numpy.h5", name))
        np.testing.assert_array_equal(stored(folder / "table.h5", name), stored(folder / "numpy.h5", name))


def test_joints_that_do_not_take_it_have_none(outcomes: dict[str, tuple[int, str]], folder: Path) -> None:
    assert outcomes
    pretension = stored(folder / "mixed.h5", "pretension")
    assert np.isnan(pretension[:, :2]).all()
    np.testing.assert_array_equal(pretension[[0, -1], 2], [0.1, 0.2])
    assert outcomes["columns"][1].startswith("time,shoulder.stiffness,elbow.stiffness,elbow.pretension\n")


def test_a_file_that_fixes_the_stiffness_keeps_it(outcomes: dict[str, tuple[int, str]], folder: Path) -> None:
    assert outcomes
    np.testing.assert_array_equal(stored(folder / "fixed.h5", "pretension"), [[0.1, 0.2, 0.3]] * 51)


def test_what_is_said_of_it(outcomes: dict[str, tuple[int, str]], folder: Path) -> None:
    said = {line: text for line, (_, text) in outcomes.items()}
    key = json.loads(said["schema"])["properties"]["pretension"]
    assert key["description"] == "pretension of the springs"
    assert "stiffness N m/rad (N/m if prismatic); pretension rad (m if prismatic)" in said["info"]
    assert said["without"].startswith("without.yaml:1: missing key 'pretension' (pretension of the springs;")
    rest = "its rate must vanish at both ends"
    assert f"rough.yaml:7: degree: must be odd, from 3 to 15 ({rest}), not 4" in said["rough"]
    assert "its actuator takes no pretension" in said["foreign"]
    header = (folder / "code" / "vsa_3r.h").read_text()
    assert all(f"double {name}[3];" in header for name in NAMES)
