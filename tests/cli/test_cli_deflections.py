"""`--deflection-solver`: following the deflections of the first step from the command line."""

from __future__ import annotations

import json

import h5py
import pytest
from samples.command_line import ROBOT, contents
from samples.marks import slow

COMMANDS = pytest.mark.parametrize("command", ["invdyn", "check-feasibility"])


@COMMANDS
def test_the_default_is_the_root(vsacli, motion, command):
    default = vsacli(command, ROBOT, motion, "--overwrite")
    root = vsacli(command, ROBOT, motion, "--overwrite", "--deflection-solver", "root")
    assert (default.code, default.out) == (root.code, root.out)
    assert "drift" not in default.out


@pytest.mark.slow
@pytest.mark.parametrize("command", [slow("invdyn"), "check-feasibility"])
def test_drift_is_reported(vsacli, motion, command):
    done = vsacli(command, ROBOT, motion, "--deflection-solver", "ode")
    assert done.code == 0
    (line,) = [line for line in done.out.splitlines() if line.startswith("integration drift: base ")]
    assert line.count(" rad at ") == 3


@pytest.mark.slow
def test_end_of_the_way_is_reported(vsacli, too_soft):
    done = vsacli("invdyn", ROBOT, too_soft, "--deflection-solver", "ode", "--set", "rate=25")
    assert done.code == 3
    for joint in ("base", "shoulder", "elbow"):
        assert f"\n{joint}: deflections cannot be integrated beyond t = " in done.out


@pytest.mark.slow
def test_result_file_and_json_hold_the_drift(vsacli, motion, tmp_path):
    done = vsacli("invdyn", ROBOT, motion, "--deflection-solver", "ode", "--json", "-o", "out.h5")
    deflections = json.loads(done.out)["deflections"]
    assert deflections["method"] == "ode"
    # Each of about 40 steps may err by 1e-12 of deflections of about 0.1 rad.
    assert all(0 < joint["drift"] < 1e-11 for joint in deflections["joints"])
    with h5py.File(tmp_path / "out.h5") as file:
        assert json.loads(file["report/json"].asstr()[()])["deflections"] == deflections


@pytest.mark.usefixtures("no_computing")
def test_existing_file_is_refused_before_the_integration(vsacli, motion, tmp_path):
    (tmp_path / "out.h5").write_text("mine")
    done = vsacli("invdyn", ROBOT, motion, "--deflection-solver", "ode", "-o", "out.h5")
    assert done.code == 4
    assert "out.h5: exists already" in done.err


@pytest.mark.usefixtures("no_computing")
def test_bad_threshold_is_refused_before_the_integration(vsacli, motion):
    done = vsacli("check-feasibility", ROBOT, motion, "--deflection-solver", "ode", "--min-margin", "2")
    assert done.code == 2
    assert "expected a share from 0 % to 100 %" in done.err


@COMMANDS
def test_unknown_way_is_a_usage_error(vsacli, motion, tmp_path, command):
    done = vsacli(command, ROBOT, motion, "--deflection-solver", "guess")
    assert done.code == 2
    assert "'guess' is not one of 'root', 'ode'" in done.err
    assert contents(tmp_path).keys() == {"move.yaml"}
