"""`vsacli study`: rows, parts, what varies, and from Python."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, ROBOT, edited
from samples.marks import needs_compiler, slow_but
from samples.studies import HEAD, column, content, study
from scipy.stats import binomtest

from vsacli import InputError, StorageError, StudySummary, run_study
from vsacli.results.charts.study_points import StudyPoints
from vsacli.results.store.study_table import StoredStudy
from vsacli.studies.sweeps.study import load_study

PATHS = ("joints.*.actuator.spring.k", "stiffness.end.elbow")


NEEDED = (
    "method",
    "seed",
    "engine",
    "compiler",
    "numpy",
    "command_line",
    "created",
    "generated_by",
    "study_name",
)


@pytest.mark.parametrize("attribute", slow_but(["created", "numpy"], NEEDED))
def test_an_attribute_of_a_table_that_is_missing_is_named(
    vsacli: Any, grid_table: Path, attribute: str
) -> None:
    shutil.copy(grid_table, "t.h5")
    with h5py.File("t.h5", "r+") as file:
        del file.attrs[attribute]
    checked, shown = vsacli("validate", "t.h5"), vsacli("info", "t.h5")
    assert (checked.code, attribute in checked.out) == (2, True)
    assert (shown.code, shown.out, attribute in shown.err) == (2, "", True)


@pytest.mark.slow
def test_a_row_is_what_a_run_with_its_values_says(vsacli: Any, grid_study: str) -> None:
    """The report of `check-feasibility --set`, bit for bit; peaks beside infeasible steps are none."""
    done = vsacli("study", grid_study)
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
            if joint["samples"]["infeasible"]:
                assert np.isnan([*peak, spent]).all()
            else:
                assert (peak.tolist(), spent) == (joint["peak"]["tau_motor"], joint["energy"]["spent"])


@pytest.mark.slow
def test_what_varies_is_a_coordinate_of_run(grid_table: Path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(grid_table, engine="h5netcdf") as table:
        assert table.peak_tau_motor.dims == ("run", "joint", "motor")
        assert table[PATHS[0]].attrs["units"] == "N m/rad"
        assert table[PATHS[0]].values.tolist() == [380, 380, 410, 410, 440, 440]
        assert table[PATHS[1]].values.tolist() == [1000, 1275] * 3
        assert {*PATHS, "trajectory"} <= set(table.margin.coords)
        assert table.margin.sel(joint="elbow").where(table[PATHS[1]] == 1000).min() < 0.2


@pytest.mark.slow
def test_parts_make_the_same_table(vsacli: Any, grid_study: str, grid_table: Path) -> None:
    """Times and command lines aside; what is missing is named."""
    for part in (1, 2, 3):
        assert vsacli("study", grid_study, "--shard", f"{part}/3", "-q").code == 0
    parts = [f"study-{part}-of-3.h5" for part in (3, 1, 2)]
    assert vsacli("study", "--merge", *parts, "-o", "whole.h5", "-q").code == 0
    assert content("whole.h5") == content(grid_table)
    assert vsacli("validate", "whole.h5", grid_study).code == 0
    shown = vsacli("info", "whole.h5").out
    assert shown.startswith("springs: 6 runs of vsa-3r: 4 ok, 2 infeasible\n")
    assert f"\n{PATHS[0]}: 380 to 440 N m/rad, 3 values\n" in shown
    assert vsacli("info", "whole.h5", "--field", "verdicts.ok").out == "4\n"
    assert vsacli("info", "whole.h5", "--extract", "again").code == 0
    assert {each.name for each in Path("again").iterdir()} == {"study.yaml", "arm.yaml", "move.yaml"}
    lacking = vsacli("study", "--merge", *parts[:2], "-o", "lacking.h5")
    missing = (
        "the tables hold 4 of 6 runs; runs 1, 4 are missing: give the tables of all shards (--shard K/N)"
    )
    assert (lacking.code, lacking.err) == (2, f"{missing}\n")
    twice = vsacli("study", "--merge", *parts, f"./{parts[0]}", "-o", "twice.h5")
    assert (twice.code, twice.err) == (2, f"./{parts[0]}: is given twice; give each table once\n")
    alone = vsacli("study", "--merge", "study-1-of-3.h5", "-o", "alone.h5")
    assert alone.err.startswith("study-1-of-3.h5 holds 2 of 6 runs; runs 1, 2, 4, 5 are missing: ")
    Path(grid_study).write_text(Path(grid_study).read_text().replace("1000", "1100"))
    assert vsacli("study", grid_study, "--shard", "2/3", "-o", "other.h5", "-q").code == 0
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
    assert "trajectory" in done.out
    assert [Path(each).name for each in column("study.h5", "trajectory")] == [
        "move.yaml",
        "move_on.yaml",
        "other.yaml",
    ]


def test_a_file_that_a_value_names_counts_as_its_content(own_folder: Path) -> None:
    """Rows of springs from a table are others when the table is another one."""
    table = (REPOSITORY / "robots" / "measured_spring.csv").read_text()
    (own_folder / "spring.csv").write_text(table)
    path = study(own_folder, "vary:\n  joints.*.actuator.spring: [{type: table, file: spring.csv}]\n")
    keys = [load_study(path).key(load_study(path).point(0))]
    (own_folder / "spring.csv").write_text(table + "# the same numbers\n")
    keys.append(load_study(path).key(load_study(path).point(0)))
    assert len(set(keys)) == 2


@pytest.mark.slow
def test_the_table_from_python_is_that_of_the_command(own_folder: Path, grid_table: Path) -> None:
    study(own_folder)
    path, said = "study.yaml", list[str]()
    with run_study(path, "mine.h5", processes=1, engine="auto", tell=said.append) as table:
        assert content(table.path) == content(grid_table)
        assert table.read("margin").shape == (6, 3)
        assert StudySummary.of(table).verdicts == {"ok": 4, "infeasible": 2}
    assert said == []
    with pytest.raises(StorageError, match="exists already"):
        run_study(path, "mine.h5")
    with pytest.raises(InputError, match="shard must be the number of a part and how many there are"):
        run_study(path, shard=(3, 2))
    with pytest.raises(InputError, match="unknown engine 'C'"):
        run_study(path, engine="C")
    with pytest.raises(TypeError, match="path must be a path, not None; call run_study"):
        run_study(None)  # type: ignore[arg-type]


@needs_compiler
@pytest.mark.parametrize(
    ("vary", "engine"),
    [
        ("rate: [1000], duration: {linspace: [3, 4, 900]}", "c"),
        ("rate: [1000], duration: {linspace: [3, 4, 30]}", "numpy"),
        ("rate: [5], duration: {linspace: [3, 4, 300]}", "numpy"),
        ("rate: [1000], joints.elbow.link.mass: {linspace: [3, 4, 300]}", "c"),
        ("rate: [1000], joints.elbow.actuator.motor.max_torque: {linspace: [300, 400, 300]}", "numpy"),
        ("rate: [1000], joints.elbow.link.mass: [3, 4], duration: {linspace: [3, 4, 900]}", "c"),
    ],
)
def test_compiled_code_pays_by_the_runs_of_each_robot(own_folder: Path, vary: str, engine: str) -> None:
    """Three million samples of one robot repay compiling, and 120,000 do not."""
    chosen = load_study(study(own_folder, f"vary: {{{vary}}}"), "auto")
    assert (chosen.engine, bool(chosen.compiler)) == (engine, engine == "c")


@pytest.mark.slow
def test_implausible_values_are_reported_once(vsacli: Any, tmp_path: Path) -> None:
    path = study(tmp_path)
    edited(ROBOT, tmp_path / "arm.yaml", ("com: [0, 0, 0] ", "com: [0, 0, 150] "))
    done = vsacli("study", str(path), "--processes", "1")
    assert done.err.count("warning: ") == 1
    assert "joints.base.link.com.2 (z) = 150 m is " in done.err


LIMITED = (
    "vary:\n  joints.*.actuator.motor.max_torque: [60, 200]\n  joints.shoulder.limits.position: [[-3, 0.1]]\n"
)


def test_the_first_limit_that_a_run_exceeds_is_named(vsacli: Any, own_folder: Path) -> None:
    """The earliest of all joints and limits in the report of its run; the study's report counts it."""
    done = vsacli("study", study(own_folder, LIMITED))
    assert done.out.startswith("springs: 2 runs of vsa-3r: 2 over limit\n")
    expected = []
    for torque in (30, 200):
        options = (
            "--set",
            f"joints.*.actuator.motor.max_torque={torque}",
            "--set",
            "joints.shoulder.limits.position=[-3, 0.1]",
        )
        report = json.loads(vsacli("check-feasibility", "arm.yaml", "move.yaml", *options, "--json").out)
        times = {
            f"{joint['name']} {kind}": time
            for joint in report["joints"]
            for kind, time in joint["first_time"].items()
            if kind.endswith("_limit") and kind != "over_limit"
        }
        expected.append(min(times, key=lambda name: times[name]))
    assert column("study.h5", "first_limit").tolist() == expected
    assert expected[1] == "shoulder position_limit"
    assert f"first limit exceeded: {expected[0]} (1 run), shoulder position_limit (1 run)" in done.out
    assert json.loads(vsacli("info", "study.h5", "--json").out)["first_limits"] == dict.fromkeys(expected, 1)


def test_runs_within_all_limits_name_none(vsacli: Any, grid_table: Path) -> None:
    assert set(column(grid_table, "first_limit")) == {""}
    shown = vsacli("info", grid_table, "--json").out
    assert not {"first_limits", "ok_share"} & json.loads(shown).keys()  # its runs are no random draws


def test_a_table_from_before_limits_were_named_is_read(vsacli: Any, grid_table: Path) -> None:
    shutil.copy(grid_table, "old.h5")
    with h5py.File("old.h5", "r+") as file:
        del file["first_limit"]
    assert vsacli("validate", "old.h5").code == 0
    assert vsacli("info", "old.h5").out.startswith("springs: 6 runs of vsa-3r: 4 ok, 2 infeasible\n")
    with StoredStudy("old.h5") as table:
        assert set(StudyPoints(table).first_limits) == {""}
    assert vsacli("study", "--merge", "old.h5", "-o", "whole.h5").code == 0
    assert set(column("whole.h5", "first_limit")) == {""}


@pytest.mark.slow
def test_the_share_of_ok_runs_has_its_interval_for_random_draws(vsacli: Any, own_folder: Path) -> None:
    drawn = "method: random\nsamples: 8\nvary:\n  joints.*.actuator.spring.k: {normal: 8 %}\n"
    found = json.loads(vsacli("study", study(own_folder, drawn), "--json").out)
    interval = binomtest(found["verdicts"]["ok"], 8).proportion_ci(method="wilson")
    assert found["ok_share"] == pytest.approx(
        {"share": found["verdicts"]["ok"] / 8, "low": interval.low, "high": interval.high}, abs=1e-5
    )  # 1.96 for the quantile
    low, high = (f"{100 * end:.3g}" for end in interval)
    assert f"95 % confidence interval {low} to {high} %" in vsacli("info", "study.h5").out
