"""`vsacli export`: columns of a result as CSV."""

from __future__ import annotations

import csv
import io
import json
import re

import h5py
import numpy as np
import pytest
from pyarrow import parquet
from samples.command_line import ROBOT, contents, installed
from samples.joint_trajectory import check_message
from scipy.io import loadmat

TORQUES = [f"{joint}.tau_motor_{motor}" for joint in ("base", "shoulder", "elbow") for motor in (1, 2)]


def parsed(text):
    header, *rows = csv.reader(io.StringIO(text))
    return header, rows


def stored(path, name):
    with h5py.File(path) as file:
        return file[name][:]


@pytest.mark.slow
def test_installed_command_prints_the_torques_to_send(tmp_path, feasible_result):
    done = installed("export", feasible_result, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    header, rows = parsed(done.stdout)
    assert header == ["time", *TORQUES]
    values = np.array(rows, dtype=float)
    np.testing.assert_array_equal(values[:, 0], stored(feasible_result, "time"))
    np.testing.assert_array_equal(values[:, 1:], stored(feasible_result, "tau_motor").reshape(401, 6))


def test_file_holds_what_stdout_would(vsacli, tmp_path, feasible_result):
    printed = vsacli("export", feasible_result, "--variables", "theta,flags").out
    done = vsacli("export", feasible_result, "--variables", "theta,flags", "-o", "t.csv")
    assert (done.code, done.out, done.err) == (0, "", "wrote t.csv\n")
    assert (tmp_path / "t.csv").read_text() == printed


def test_rate_thins_the_samples(vsacli, feasible_result):
    _, all_rows = parsed(vsacli("export", feasible_result).out)
    _, rows = parsed(vsacli("export", feasible_result, "--rate", "20").out)
    assert rows == all_rows[::5]


@pytest.mark.parametrize("rate", ["1e20", "0", "nan"])
def test_impossible_rate_is_refused(vsacli, feasible_result, rate):
    done = vsacli("export", feasible_result, "--rate", rate)
    assert (done.code, done.out) == (2, "")
    assert re.search(r"--rate.*(Hz|expected samples per second)", done.err)


def test_undefined_samples_are_refused_and_nothing_written(vsacli, tmp_path, infeasible_result):
    for output in ([], ["-o", "t.csv"]):
        done = vsacli("export", infeasible_result, *output)
        assert (done.code, done.out) == (3, "")
        assert "base.tau_motor has no" in done.err
        assert "--allow-nan" in done.err
    assert contents(tmp_path) == {}


def test_allow_nan_leaves_cells_empty(vsacli, infeasible_result):
    done = vsacli("export", infeasible_result, "--allow-nan")
    assert done.code == 0
    _, rows = parsed(done.out)
    empty = np.array([[cell == "" for cell in row[1:]] for row in rows])
    np.testing.assert_array_equal(empty, np.isnan(stored(infeasible_result, "tau_motor").reshape(401, 6)))
    assert empty.any()


def test_exported_motion_and_stiffness_are_a_trajectory(vsacli, tmp_path, feasible_result):
    columns = "q,dq,ddq,d3q,d4q,stiffness,dstiffness,ddstiffness"
    vsacli("export", feasible_result, "--variables", columns, "-o", "recorded.csv")
    done = vsacli("invdyn", ROBOT, "recorded.csv")
    assert done.code == 0
    again = tmp_path / "vsa_3r-recorded.h5"
    for name in ("time", *columns.split(","), "tau_e", "theta"):
        np.testing.assert_array_equal(stored(again, name), stored(feasible_result, name), err_msg=name)


def test_position_and_stiffness_alone_are_a_trajectory(vsacli, tmp_path, feasible_result):
    vsacli("export", feasible_result, "--variables", "q,stiffness", "-o", "recorded.csv")
    done = vsacli("invdyn", ROBOT, "recorded.csv")
    assert done.code == 0
    assert "warning: dq, ddq, d3q, d4q come from a C6 spline through q; " in done.out
    again = tmp_path / "vsa_3r-recorded.h5"
    for name in ("time", "q", "stiffness"):
        np.testing.assert_array_equal(stored(again, name), stored(feasible_result, name), err_msg=name)


def test_existing_file_is_refused_and_overwrite_replaces_it(vsacli, tmp_path, feasible_result):
    (tmp_path / "t.csv").write_text("precious")
    done = vsacli("export", feasible_result, "-o", "t.csv")
    assert (done.code, (tmp_path / "t.csv").read_text()) == (4, "precious")
    assert done.err == "t.csv: exists already; choose another name, or replace it with --overwrite\n"
    assert vsacli("export", feasible_result, "-o", "t.csv", "--overwrite").code == 0
    assert (tmp_path / "t.csv").read_text().startswith("time,base.tau_motor_1,")


def test_the_result_itself_is_not_replaced(vsacli, tmp_path, motion):
    vsacli("invdyn", ROBOT, motion, "-o", "result")  # a name that ends as results do is refused before
    before = contents(tmp_path)
    done = vsacli("export", "result", "-o", "result", "--overwrite")
    assert done.code == 2
    assert done.err == "result: is an input of this command; choose another name for the output\n"
    assert contents(tmp_path) == before


def test_variable_that_is_not_stored_is_named(vsacli, motion):
    vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "--variables", "flags")
    done = vsacli("export", "r.h5")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("r.h5: holds no tau_motor")


def test_unknown_variable_is_named(vsacli, feasible_result):
    done = vsacli("export", feasible_result, "--variables", "torque")
    assert done.code == 2
    assert done.err.startswith("--variables: no variable is called 'torque'")


def test_verbose_describes_the_result(vsacli, infeasible_result):
    done = vsacli("export", infeasible_result, "--variables", "q", "-v")
    assert done.err == f"{infeasible_result}: vsa-3r, rest-to-rest, 401 samples, infeasible\n"


def test_a_format_of_bytes_needs_a_file(vsacli, tmp_path, feasible_result):
    for form in ("mat", "parquet"):
        done = vsacli("export", feasible_result, "--format", form)
        assert done.code == 2
        assert done.err.endswith(f"Error: --format {form} needs -o FILE: the file is binary\n")
        done = vsacli("export", feasible_result, "--format", form, "-o", f"out.{form}", "--rate", "50")
        assert (done.code, done.err) == (0, f"wrote out.{form}\n")
    times = loadmat(tmp_path / "out.mat")["time"][:, 0]
    np.testing.assert_array_equal(times, stored(feasible_result, "time")[::2])
    assert parquet.read_table(tmp_path / "out.parquet").column_names == ["time", *TORQUES]


@pytest.mark.slow
def test_a_simulation_becomes_a_joint_trajectory_as_it_went(vsacli, tmp_path, motion):
    vsacli("simulate", ROBOT, motion, "-o", "s.h5")
    done = vsacli("export", "s.h5", "--format", "joint-trajectory", "--rate", "20")
    assert (done.code, done.err) == (0, "")
    message = json.loads(done.out)
    check_message(message)
    assert message["joint_names"] == ["base", "shoulder", "elbow"]
    positions = [point["positions"] for point in message["points"]]
    np.testing.assert_array_equal(positions, stored(tmp_path / "s.h5", "q")[::5])


@pytest.mark.parametrize(
    ("name", "begins"),
    [
        ("m.mat", b"MATLAB "),
        ("P.PARQUET", b"PAR1"),
        ("j.json", b'{"header"'),
        ("t.csv", b"time,"),
        ("t", b"time,"),
    ],
)
def test_the_ending_of_the_name_is_the_format(vsacli, tmp_path, feasible_result, name, begins):
    done = vsacli("export", feasible_result, "-o", name)
    assert (done.code, done.err) == (0, f"wrote {name}\n")
    assert (tmp_path / name).read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("of", "options", "message"),
    [
        ("result", "-o r.h5", "r.h5: export of a result writes .csv, .mat, .parquet, "),
        ("result", "-o a.urdf", "a.urdf: export of a result writes .csv"),
        (
            "result",
            "--format csv -o m.mat",
            "m.mat: --format csv does not match the ending .mat; name the file .csv",
        ),
        (
            "result",
            "--format joint-trajectory -o m.csv",
            "m.csv: --format joint-trajectory does not match the ending .csv; name the file .json",
        ),
        ("robot", "-o a.csv", "a.csv: export of a robot writes .urdf, .xml, .mjcf"),
        ("robot", "-o a.xml", "is a robot; choose its format: --format urdf or --format mjcf"),
    ],
)
def test_a_name_that_promises_another_format_is_refused(
    vsacli, tmp_path, feasible_result, of, options, message
):
    done = vsacli("export", ROBOT if of == "robot" else feasible_result, *options.split())
    assert (done.code, done.out, contents(tmp_path)) == (2, "", {})
    assert message in done.err
