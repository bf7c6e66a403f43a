"""A result is computed again from what it holds, and its inputs are had back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, contents
from samples.marks import needs_compiler

from vsacli import open_result
from vsacli.results.store import inputs

RUNS = {
    "plain": (ROBOT, REST_TO_REST),
    "integrated": (ROBOT, REST_TO_REST, "--deflection-solver", "ode"),
    "compiled": (ROBOT, REST_TO_REST, "--engine", "c"),
    "some variables": (ROBOT, REST_TO_REST, "--variables", "tau_motor,flags"),
    "a table": tuple(REPOSITORY / folder / "measured_1r.yaml" for folder in ("robots", "trajectories")),
}


@pytest.fixture
def elsewhere(vsacli: Any, tmp_path: Path) -> Path:
    """A robot and a recording that lie in folders of their own, referred to from a third."""
    (tmp_path / "arms").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "arms" / "arm.yaml").write_text(ROBOT.read_text(encoding="utf-8"), encoding="utf-8")
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "-o", "first.h5", "-q").code == 0
    names = "q,dq,ddq,d3q,d4q,stiffness,dstiffness,ddstiffness"
    assert vsacli("export", "first.h5", "--variables", names, "-o", "data/motion.csv", "-q").code == 0
    (tmp_path / "arms" / "move.yaml").write_text(
        "format: vsacli-trajectory/1\nname: move\nposition: {type: csv, file: ../data/motion.csv}\n"
        "stiffness: {type: csv, file: ../data/motion.csv}\n"
    )
    return tmp_path


MARKS = {"integrated": pytest.mark.slow, "compiled": [needs_compiler, pytest.mark.slow]}


@pytest.mark.parametrize(
    "run",
    [pytest.param(key, marks=MARKS[key]) if key in MARKS else key for key in RUNS],
)
def test_a_result_is_computed_again_bit_for_bit(vsacli: Any, run: str) -> None:
    assert vsacli("invdyn", *RUNS[run], "-o", "r.h5", "-q").code == 0
    done = vsacli("validate", "r.h5", "--recompute")
    assert (done.code, done.out.splitlines()[-1]) == (0, "r.h5: computed again, equal bit for bit")


@pytest.mark.slow
def test_its_inputs_may_have_gone(vsacli: Any, elsewhere: Path) -> None:
    """Large ones, too: all are in the result, and where they stand to each other."""
    assert vsacli("invdyn", "arms/arm.yaml", "arms/move.yaml", "-o", "r.h5", "-q").code == 0
    kept = {path: content for path, content in contents(elsewhere).items() if "/" in path}
    assert max(map(len, kept.values())) > 1_000_000  # beyond what is stored as text
    for path in kept:
        (elsewhere / path).unlink()
    assert vsacli("validate", "r.h5", "--recompute").code == 0
    assert vsacli("info", "r.h5", "--extract", "again").code == 0
    had_back = {path: content for path, content in contents(elsewhere).items() if path.startswith("again/")}
    assert had_back == {f"again/{path}": content for path, content in kept.items()}
    assert vsacli("invdyn", "again/arms/arm.yaml", "again/arms/move.yaml", "-q", "-o", "s.h5").code == 0
    with h5py.File("r.h5") as first, h5py.File("s.h5") as second:
        np.testing.assert_array_equal(first["tau_motor"][...], second["tau_motor"][...])


def test_what_differs_is_told_with_its_amount(vsacli: Any) -> None:
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "-o", "r.h5", "-q").code == 0
    with h5py.File("r.h5", "r+") as file:
        peak = np.abs(file["tau_motor"][...]).max()
        file["tau_motor"][7, 1, 0] += 0.01 * peak
        file["phi"][3, 0, 1] = np.nan
    done = vsacli("validate", "r.h5", "--recompute", "-q")
    assert done.code == 3
    assert done.out.splitlines() == [
        "r.h5: computed again, phi differs in 1 values, where only one of both is a number",
        "r.h5: computed again, tau_motor differs in 1 values, by at most 0.01 of its peak",
    ]


def test_a_result_is_known_by_what_it_holds(vsacli: Any) -> None:
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "-o", "result", "-q").code == 0
    done = vsacli("validate", "result", "--recompute", "-q")
    assert (done.code, done.out) == (0, "result: computed again, equal bit for bit\n")


@pytest.mark.slow
def test_engine_and_options_are_on_record(vsacli: Any) -> None:
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "--engine", "numpy", "-o", "r.h5", "-q").code == 0
    with open_result("r.h5") as result:
        provenance = result.provenance()
    assert (provenance["engine"], provenance["compiler"]) == ("numpy", "")
    assert provenance["options"] == {
        "stop_on_infeasible": False,
        "min_margin": 0.01,
        "deflection_solver": "root",
    }
    assert provenance["versions"]["scipy"] == scipy.__version__
    assert "engine: numpy" in vsacli("info", "r.h5").out.splitlines()


@pytest.mark.slow
def test_what_a_result_does_not_hold(vsacli: Any, elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inputs, "LARGEST_STORED", 1000)
    assert vsacli("invdyn", "arms/arm.yaml", "arms/move.yaml", "-o", "r.h5", "-q").code == 0
    told = r"r\.h5: does not hold \S*motion\.csv"
    for arguments in (("validate", "r.h5", "--recompute"), ("info", "r.h5", "--extract", "again")):
        done = vsacli(*arguments)
        assert done.code == 2
        assert re.search(told, done.err)
    assert not (elsewhere / "again").exists()


def test_a_result_of_an_older_version(vsacli: Any) -> None:
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "-o", "r.h5", "-q").code == 0
    with h5py.File("r.h5", "r+") as file:
        for number in (1, 2):
            del file[f"inputs/file_{number}"].attrs["role"]
    done = vsacli("validate", "r.h5", "--recompute")
    assert done.code == 2
    assert "does not say from which files it was computed, so it cannot be repeated" in done.err
