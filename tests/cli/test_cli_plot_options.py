"""`vsacli plot` with a stretch of time, joints and variables."""

from __future__ import annotations

import shutil

import h5py
import numpy as np
import pytest
from samples.command_line import contents
from samples.marks import slow

from vsacli.base import file_formats

OF_JOINTS = ("q", "stiffness", "tau_motor", "tau_e", "elastic_energy", "motor_energy", "dtheta", "phi")
NAMES = ("motion", "motor-torque", "elastic-torque", "energy")


@pytest.mark.slow
def test_a_part_of_a_result_is_drawn(vsacli, tmp_path, feasible_result):
    done = vsacli(
        "plot", feasible_result, "--from", "1", "--to", "1.5", "--joints", "elbow", "--format", "svg"
    )
    assert (done.code, done.out) == (0, "")
    assert contents(tmp_path).keys() == {f"result-{name}.svg" for name in NAMES}


def test_variables_give_a_figure_each(vsacli, feasible_result):
    done = vsacli("plot", feasible_result, "--variables", "theta,det_A", "--format", "svg")
    assert (done.code, done.err) == (0, "wrote result-theta.svg\nwrote result-det_A.svg\n")


@pytest.mark.slow
def test_variables_of_several_results_are_compared(vsacli, tmp_path, feasible_result):
    shutil.copy(feasible_result, tmp_path / "again.h5")
    done = vsacli("plot", feasible_result, "again.h5", "--variables", "q,dtheta", "--format", "svg")
    assert (done.code, done.err) == (
        0,
        "wrote result-again-compare-q.svg\nwrote result-again-compare-dtheta.svg\n",
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--from", "7"), "r.h5: has no samples from t = 7 s on; it spans 0 to 4 s"),
        (("--from", "1", "--to", "0.5"), "--from 1 must be before --to 0.5"),
        (("--joints", "elbw"), "r.h5: has no joint 'elbw'; did you mean 'elbow'?"),
        (("--variables", "tau_moter"), "no variable is called 'tau_moter'; did you mean 'tau_motor'?"),
        (("--variables", "flags"), "r.h5: flags are bits, not a curve;"),
        (
            ("--variables", "damping"),
            "r.h5: has no damping: no joint of vsa-3r has damping, or --variables left it out",
        ),
        (("--variables", ","), "expected names separated by commas, e.g. theta,dtheta"),
        (("--from", "now"), "'now' is not a number; expected a time in seconds"),
    ],
)
@pytest.mark.parametrize("files", [1, 2])
def test_what_cannot_be_shown_is_refused(vsacli, tmp_path, feasible_result, options, message, files):
    for name in ("r.h5", "s.h5")[:files]:
        shutil.copy(feasible_result, tmp_path / name)
    before = contents(tmp_path)
    done = vsacli("plot", *("r.h5", "s.h5")[:files], *options)
    assert (done.code, done.out, contents(tmp_path)) == (2, "", before)
    assert message in done.err


@pytest.mark.parametrize("options", [slow(()), slow(("--to", "0")), ("--variables", "dtheta")])
def test_results_without_a_number_are_drawn(vsacli, tmp_path, feasible_result, options):
    """Warnings of matplotlib are errors here."""
    shutil.copy(feasible_result, tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        for name in OF_JOINTS:
            file[name][...] = np.nan
        file["flags"][...] = 1
    assert vsacli("plot", "r.h5", "--format", "svg", *options).code == 0


@pytest.mark.slow
def test_results_without_a_number_are_compared(vsacli, tmp_path, feasible_result):
    shutil.copy(feasible_result, tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        file["tau_motor"][...] = np.nan
    (tmp_path / "same.h5").write_bytes((tmp_path / "r.h5").read_bytes())
    assert vsacli("plot", "r.h5", "same.h5").code == 0


def test_studies_have_no_joints_to_choose(vsacli, tmp_path):
    with h5py.File(tmp_path / "s.h5", "w") as file:
        file.attrs["format"] = file_formats.STUDY_TABLE
    done = vsacli("plot", "s.h5", "--joints", "elbow")
    assert (done.code, done.err.splitlines()[-1]) == (
        2,
        "Error: --joints cannot be used with study tables; leave it out",
    )
