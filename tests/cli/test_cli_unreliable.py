"""Recorded motions on the command line: deviations in files, and what they do not determine."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from samples.command_line import ROBOT

JOINTS = ("base", "shoulder", "elbow")
DURATION = 2.0


@pytest.fixture
def noisy(tmp_path):
    """A trajectory of 401 samples with noise of 1e-5 rad, and the key `fit`."""
    time = np.linspace(0, DURATION, 401)
    turns = 0.4 * np.sin(2 * np.pi * time[:, None] / DURATION * [1, 2, 2] + [0, 1, 2])
    noise = 1e-5 * np.random.default_rng(0).standard_normal(turns.shape)
    header = ",".join(["time", *(f"{joint}.q" for joint in JOINTS)])
    table = np.column_stack([time, turns + noise])
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=header, comments="")

    def write(fit):
        (tmp_path / f"{fit}.yaml").write_text(
            f"format: vsacli-trajectory/1\nname: {fit}\nposition: {{type: csv, file: arm.csv, fit: {fit}}}\n"
            "stiffness: {type: constant, value: 1500}\n"
        )
        return f"{fit}.yaml"

    return write


@pytest.mark.slow
def test_a_record_that_determines_the_torques(vsacli, tmp_path, noisy):
    done = vsacli("invdyn", ROBOT, noisy("lsq"), "-o", "r.h5")
    assert done.code == 0
    assert any(
        line.startswith("standard deviation of motor torque, random noise only: base +- 0.0")
        for line in done.out.splitlines()
    )
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["tau_motor_std"].shape == (401, 3, 2)
        assert file["d4q_std"].attrs["units"] == "rad/s^4"
        assert file["tau_motor_std"].attrs["long_name"].startswith("standard deviation of the motor torque")
        assert "stiffness_std" not in file
        deviations = file["tau_motor_std"][:]
    header, first, *_ = vsacli("export", "r.h5", "--variables", "tau_motor_std").out.splitlines()
    assert header.startswith("time,base.tau_motor_std_1,base.tau_motor_std_2,shoulder.")
    assert [float(cell) for cell in first.split(",")[1:]] == deviations[0].ravel().tolist()


@pytest.mark.slow
def test_a_fit_that_follows_the_noise_is_used_and_unreliable(vsacli, tmp_path, noisy):
    done = vsacli("invdyn", ROBOT, noisy("interpolate"), "-o", "r.h5")
    assert done.code == 3
    headline, *_ = done.out.splitlines()
    assert headline == "UNRELIABLE  vsa-3r, interpolate: 401 samples, 2 s; 3 of 3 joints unreliable"
    assert "base: tau_motor is not" in done.out
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["verdict"] == "unreliable"
    shown = vsacli("info", "r.h5")
    assert "verdict unreliable" in shown.out


@pytest.mark.slow
def test_what_is_asked_for_decides(vsacli, noisy):
    path = noisy("interpolate")
    assert vsacli("invdyn", ROBOT, path, "-o", "q.h5", "--variables", "q,q_std").code == 0
    assert vsacli("invdyn", ROBOT, path, "-o", "d4q.h5", "--variables", "q,d4q").code == 3
    feasible = vsacli("check-feasibility", ROBOT, path, "--json")
    report = json.loads(feasible.out)
    assert report["joints"][0]["uncertainty"]["asked"] == ["tau_e"]  # the arm has no limits
    share = report["joints"][0]["uncertainty"]["variables"]["tau_e"]["share"]
    assert (feasible.code, share < 0.1) in {(0, True), (3, False)}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stiffness_std", "wrench_std"])
def test_a_deviation_that_there_is_not_is_refused(vsacli, noisy, name):
    done = vsacli("invdyn", ROBOT, noisy("lsq"), "-o", "r.h5", "--variables", name)
    assert done.code == 2
    assert f"there is no {name}" in done.err


def test_a_formula_has_no_deviations(vsacli, tmp_path):
    (tmp_path / "still.yaml").write_text(
        "format: vsacli-trajectory/1\nname: still\nduration: 1\nrate: 100\n"
        "position: {type: constant, value: 0}\nstiffness: {type: constant, value: 1500}\n"
    )
    assert vsacli("invdyn", ROBOT, "still.yaml", "-o", "r.h5").code == 0
    with h5py.File(tmp_path / "r.h5") as file:
        assert not any(name.endswith("_std") for name in file)
    done = vsacli("invdyn", ROBOT, "still.yaml", "-o", "s.h5", "--variables", "q_std")
    assert (done.code, done.out) == (2, "")
    assert "there is no q_std: q does not come from a fit of recorded samples" in done.err
