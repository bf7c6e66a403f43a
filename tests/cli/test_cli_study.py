"""`vsacli study`: rows, exit codes, faults, and what is kept whatever happens."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.studies import GRID, HEAD, column, content, study

from vsacli.cli.main import run
from vsacli.studies.sweeps import journal as journal_module
from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.rows import Computer
from vsacli.studies.sweeps.run_study import gather
from vsacli.studies.sweeps.study import load_study

PATHS = ("joints.*.actuator.spring.k", "stiffness.end.elbow")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table of the study of the fixture `grid`, undisturbed."""
    folder = tmp_path_factory.mktemp("whole")
    study(folder)
    with contextlib.chdir(folder):
        assert run(["study", "study.yaml", "-q"]) == 0
    return folder / "study.h5"


@pytest.fixture
def grid(own_folder: Path) -> str:
    study(own_folder)
    return "study.yaml"


def test_a_row_is_what_a_run_with_its_values_says(vsacli: Any, grid: str) -> None:
    """The report of `check-feasibility --set`, bit for bit; peaks beside infeasible steps are none."""
    done = vsacli("study", grid)
    assert (done.code, done.err.splitlines()[-1]) == (0, "wrote study.h5")
    assert done.out.startswith("springs: 6 runs of vsa-3r: 4 ok, 2 infeasible\n")
    for number in (0, 5):
        values = {path: float(column("study.h5", path)[number]) for path in PATHS}
        options = [part for path, value in values.items() for part in ("--set", f"{path}={value!r}")]
        report = json.loads(vsacli("check-feasibility", "arm.yaml", "move.yaml", *options, "--json").out)
        assert column("study.h5", "verdict")[number] == report["verdict"]
        for place, joint in enumerate(report["joints"]):
            row = {
                name: column("study.h5", name)[number, place].tolist()
                for name in ("margin", "first_infeasible")
            }
            assert row["margin"] == joint["margin"]["min"]
            assert joint["first_time"].get("infeasible", np.nan) == pytest.approx(
                row["first_infeasible"], abs=0, nan_ok=True
            )
            peak, spent = (
                column("study.h5", name)[number, place] for name in ("peak_tau_motor", "energy_spent")
            )
            if joint["steps"]["infeasible"]:
                assert np.isnan([*peak, spent]).all()
            else:
                assert (peak.tolist(), spent) == (joint["peak"]["tau_motor"], joint["energy"]["spent"])


@pytest.mark.slow
def test_what_varies_is_a_coordinate_of_run(whole: Path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(whole, engine="h5netcdf") as table:
        assert table.peak_tau_motor.dims == ("run", "joint", "motor")
        assert table[PATHS[0]].attrs["units"] == "N m/rad"
        assert table[PATHS[0]].values.tolist() == [380, 380, 410, 410, 440, 440]
        assert table[PATHS[1]].values.tolist() == [1000, 1275] * 3
        assert {*PATHS, "trajectory"} <= set(table.margin.coords)
        assert table.margin.sel(joint="elbow").where(table[PATHS[1]] == 1000).min() < 0.2


def test_parts_make_the_same_table(vsacli: Any, grid: str, whole: Path) -> None:
    """Times and command lines aside; what is missing is named."""
    for part in (1, 2, 3):
        assert vsacli("study", grid, "--shard", f"{part}/3", "-q").code == 0
    parts = [f"study-{part}-of-3.h5" for part in (3, 1, 2)]
    assert vsacli("study", "--merge", *parts, "-o", "whole.h5", "-q").code == 0
    assert content("whole.h5") == content(whole)
    assert vsacli("validate", "whole.h5", grid).code == 0
    shown = vsacli("info", "whole.h5").out
    assert shown.startswith("springs: 6 runs of vsa-3r: 4 ok, 2 infeasible\n")
    assert f"\n{PATHS[0]}: 380 to 440 N m/rad, 3 values\n" in shown
    assert vsacli("info", "whole.h5", "--field", "verdicts.ok").out == "4\n"
    assert vsacli("info", "whole.h5", "--extract", "again").code == 0
    assert {each.name for each in Path("again").iterdir()} == {"study.yaml", "arm.yaml", "move.yaml"}
    lacking = vsacli("study", "--merge", *parts[:2], "-o", "lacking.h5")
    assert (lacking.code, lacking.err) == (2, "2 of 6 runs are in none of the files: 1, 4\n")
    Path(grid).write_text(Path(grid).read_text().replace("1000", "1100"))
    assert vsacli("study", grid, "--shard", "2/3", "-o", "other.h5", "-q").code == 0
    strange = vsacli("study", "--merge", *parts[:2], "other.h5", "-o", "x.h5")
    assert (strange.code, "other.h5: is part of another study than study-3-of-3.h5" in strange.err) == (
        2,
        True,
    )


@pytest.mark.slow
def test_variables_over_time_are_those_of_a_run(vsacli: Any, own_folder: Path) -> None:
    """At each third step; a run that is shorter ends with NaN, in parts that are put together as well."""
    study(own_folder, "vary: {duration: [4, 3]}\nvariables: [tau_motor, q]\nevery: 3\n")
    assert vsacli("study", "study.yaml", "-q").code == 0
    assert vsacli("invdyn", "arm.yaml", "move.yaml", "--set", "duration=3", "-o", "r.h5", "-q").code == 0
    for name in ("time", "tau_motor", "q"):
        whole, kept = column("r.h5", name), column("study.h5", name)
        assert kept.shape[:2] == (2, 5)  # of 13 and of 10 steps
        np.testing.assert_array_equal(kept[1, :4], whole[::3])
        assert np.isnan(kept[1, 4:]).all()
    for part in (1, 2):
        assert vsacli("study", "study.yaml", "--shard", f"{part}/2", "-q").code == 0
    assert vsacli("study", "--merge", "study-1-of-2.h5", "study-2-of-2.h5", "-o", "whole.h5", "-q").code == 0
    assert content("whole.h5") == content("study.h5")
    refused = vsacli("study", str(study(own_folder, "variables: [current]\n")))
    assert (refused.code, "variables: no joint of vsa-3r has a current" in refused.err) == (2, True)


@pytest.mark.slow
def test_motions_alone_are_a_study(vsacli: Any, own_folder: Path) -> None:
    path = study(own_folder, "", HEAD.replace("move.yaml", "['move*.yaml', other.yaml]"))
    for name, end in (("move_on.yaml", "1300"), ("other.yaml", "700")):
        (own_folder / name).write_text(
            (own_folder / "move.yaml").read_text().replace("end: 1275", f"end: {end}")
        )
    done = vsacli("study", path, "-q")
    assert (done.code, done.out.splitlines()[0]) == (0, "springs: 3 runs of vsa-3r: 2 ok, 1 infeasible")
    assert "in run 2 (trajectory = " in done.out
    assert [Path(each).name for each in column("study.h5", "trajectory")] == [
        "move.yaml",
        "move_on.yaml",
        "other.yaml",
    ]


def test_a_run_that_fails_is_a_row(vsacli: Any, own_folder: Path) -> None:
    """A mass that is drawn below zero makes no robot; the others are computed."""
    text = "method: random\nsamples: 4\nvary:\n  joints.elbow.link.mass: {normal: 100 %}\n"
    done = vsacli("study", study(own_folder, text))
    masses, verdicts = column("study.h5", "joints.elbow.link.mass"), column("study.h5", "verdict")
    assert done.code == 3
    assert 0 < (masses < 0).sum() < 4
    np.testing.assert_array_equal(verdicts == "failed", masses < 0)
    assert all("must be zero or positive" in error for error in column("study.h5", "error")[masses < 0])
    np.testing.assert_array_equal(np.isnan(column("study.h5", "margin")).all(axis=1), masses < 0)
    assert "failed: joints.elbow.link.mass: must be zero or positive" in done.out


def test_an_interrupted_study_goes_on(vsacli: Any, grid: str, whole: Path) -> None:
    """From the rows in the journal, of which the last was cut off."""
    journal = Path("study.h5.journal")
    with Journal(journal) as rows:
        gather(map(Computer(load_study(grid)).row, range(5)), rows, lambda _: None)
    journal.write_bytes(journal.read_bytes()[:-9])
    done = vsacli("study", grid)
    assert done.err.splitlines() == [f"4 of 6 runs are in {journal} already", "wrote study.h5"]
    assert content("study.h5") == content(whole)
    assert not journal.exists()


def test_a_file_that_a_value_names_counts_as_its_content(own_folder: Path) -> None:
    """Rows of springs from a table are others when the table is another one."""
    table = (REPOSITORY / "robots" / "measured_spring.csv").read_text()
    (own_folder / "spring.csv").write_text(table)
    path = study(own_folder, "vary:\n  joints.*.actuator.spring: [{type: table, file: spring.csv}]\n")
    keys = [load_study(path).key(load_study(path).point(0))]
    (own_folder / "spring.csv").write_text(table + "# the same numbers\n")
    keys.append(load_study(path).key(load_study(path).point(0)))
    assert len(set(keys)) == 2


def test_a_full_disk_costs_no_finished_row(
    vsacli: Any, grid: str, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = [2]

    def write(file: int, data: memoryview) -> int:
        room[0] -= 1
        if room[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return original(file, data if room[0] else data[:40])  # the disk becomes full in the second row

    original = os.write
    with monkeypatch.context() as patch:
        patch.setattr(journal_module.os, "write", write)
        full = vsacli("study", grid)
    assert full.code == 4
    assert "the disk is full; the 1 rows in it stay" in full.err
    assert not Path("study.h5").exists()
    assert vsacli("study", grid).err.startswith("1 of 6 runs are in ")
    assert content("study.h5") == content(whole)


def test_two_do_not_compute_the_same_study(vsacli: Any, grid: str) -> None:
    with Journal(Path("study.h5.journal")):
        done = vsacli("study", grid)
    assert (done.code, "another process computes this study" in done.err) == (4, True)


SPRING = "joints.*.actuator.spring.k"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"vary: {{{SPRING}x: [1]}}", f"study.yaml:5: {SPRING}x: joints.0.actuator.spring has no 'kx'"),
        (f"vary: {{{SPRING}: [400, -1]}}", "study.yaml:5: joints.*.actuator.spring.k: joints.0"),
        (f"vary: {{{SPRING}: []}}", f"study.yaml:5: {SPRING}: expected a list of values, "),
        (f"vary: {{{SPRING}: {{linspace: [1, 2, 0]}}}}", "linspace: expected a count from 1 to 1,000,000"),
        (f"vary: {{{SPRING}: {{linspce: [1, 2, 3]}}}}", "did you mean 'linspace'?"),
        (f"vary: {{{SPRING}: {{normal: 5 %}}}}", "vary: a grid has no values drawn from distributions"),
        ("vary: {foo.k: [1]}", "study.yaml:5: foo.k: neither robot nor trajectory has a 'foo'"),
        ("vary: {name: [a, b]}", "study.yaml:5: name says what the file is and stays"),
        ("vary: {duration: [1, 2], rate: {linked: durations}}", "no path above it that varies by itself"),
        ("method: random\nvary: {duration: [1]}", "samples: how many runs? The method random draws them"),
        ("method: random\nsamples: 3", "vary: nothing varies that the method random could draw"),
        ("method: random\nsamples: 3\nvary: {joints.*.link.com: {normal: 5 %}}", "is zero, of which a share"),
        ("keep: [margins]", "keep: unknown word 'margins'; did you mean 'margin'?"),
        ("trajectry: x", "unknown key 'trajectry'"),
        (
            "vary:\n" + "".join(f"  joints.{i}.link.mass: {{linspace: [1, 2, 1000]}}\n" for i in range(3)),
            "study.yaml: 1,000,000,000 runs (1 x 1,000 x 1,000 x 1,000) are more than 1,000,000",
        ),
    ],
)  # fmt: skip
def test_a_study_that_cannot_be_computed(vsacli: Any, own_folder: Path, text: str, message: str) -> None:
    study(own_folder, text)
    done = vsacli("study", "study.yaml")
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert not list(own_folder.glob("*.h5*"))


def test_command_lines_that_make_no_sense(vsacli: Any, grid: str) -> None:
    assert "a study is read by several processes" in vsacli("study", "-").err
    assert "expected one study, found 2 files" in vsacli("study", grid, grid).err
    assert "expected K/N with K from 1 to N" in vsacli("study", grid, "--shard", "4/3").err
    assert "give -o FILE" in vsacli("study", "--merge", grid).err
    assert "is not an HDF5 file" in vsacli("study", "--merge", grid, "-o", "x.h5").err


def test_no_file_is_replaced_or_read_for_nothing(vsacli: Any, own_folder: Path) -> None:
    study(own_folder, GRID, HEAD.replace("move.yaml", "moves/*.yaml"))
    none = vsacli("study", "study.yaml")
    assert (none.code, none.err) == (2, "study.yaml: trajectory: no file fits 'moves/*.yaml'\n")
