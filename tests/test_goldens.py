"""The comparison of recorded outputs finds every kind of difference."""

from __future__ import annotations

import re
from pathlib import Path

import goldens
import h5py
import numpy as np
import pytest


@pytest.fixture
def records(tmp_path: Path) -> list[Path]:
    """Two equal records of one case: a result file and what a command printed."""
    for name in ("before", "after"):
        folder = tmp_path / name / "cases" / "pair"
        folder.mkdir(parents=True)
        (folder / "0-invdyn.txt").write_text("exit code 0\nOK\n")
        with h5py.File(folder / "result.h5", "w") as file:
            file["tau"] = np.array([1.0, -4.0, np.nan])
            file["flags"] = np.array([0, 1, 2])
            file["report/json"] = '{"verdict": "ok", "residual": 1e-12}'
            file.attrs.update({"verdict": "ok", "created": name})
    return [tmp_path / "before", tmp_path / "after"]


def result(records: list[Path]) -> Path:
    return records[1] / "cases/pair/result.h5"


def test_equal_records_agree(records: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert goldens.compare(*records)
    assert "1 HDF5, equal" in capsys.readouterr().out


@pytest.mark.parametrize(("change", "agrees"), [(1e-13, True), (1e-12, False), (np.nan, False)])
def test_numbers_are_compared_with_the_peak(records: list[Path], change: float, agrees: bool) -> None:
    with h5py.File(result(records), "a") as file:
        file["tau"][0] += change  # a 4e13th and a 4e12th of the peak
    assert goldens.compare(*records) == agrees


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("flags", np.array([0, 1, 3]), "flags: differs in 1 of 3 entries"),
        ("report/json", '{"verdict": "singular", "residual": 1e-12}', r"JSON differs at \.verdict"),
        ("tau", np.zeros(4), r"tau: has shape \(4,\) instead of \(3,\)"),
    ],
)
def test_other_datasets(
    records: list[Path], capsys: pytest.CaptureFixture[str], name: str, value: object, message: str
) -> None:
    with h5py.File(result(records), "a") as file:
        del file[name]
        file[name] = value
    assert not goldens.compare(*records)
    assert re.search(message, capsys.readouterr().out)


def test_attributes_printed_lines_and_missing_files(
    records: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    with h5py.File(result(records), "a") as file:
        file.attrs["verdict"] = "infeasible"
    (records[1] / "cases/pair/0-invdyn.txt").write_text("exit code 3\nOK\n")
    (records[0] / "cases/pair/torques.csv").write_text("time\n")
    assert not goldens.compare(*records)
    printed = capsys.readouterr().out
    for text in ("attribute verdict: ok -> infeasible", "- exit code 0", "missing: pair/torques.csv"):
        assert text in printed


def test_variants_are_forty() -> None:
    cases = [case for case in goldens.cases(goldens.REPOSITORY) if case.name.startswith("variant-")]
    assert len({case.name for case in cases}) == 40
