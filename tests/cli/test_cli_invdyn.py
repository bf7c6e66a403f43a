"""`vsacli invdyn`: the main job, from two files to a result file and a report."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from samples.command_line import (
    REPOSITORY,
    REST_TO_REST,
    ROBOT,
    SEVEN_JOINTS,
    SEVEN_JOINTS_MOTION,
    contents,
    installed,
)
from samples.spoiled import scaled, spoil_torque

GRAVITY = 9.81
SPRING, HARDENING = 400.0, 2000.0
"""K and K_c of every spring of the 3R arm."""


def root_attributes(path):
    with h5py.File(path) as file:
        return dict(file.attrs)


def static_shoulder_torque():
    """Of the 3R arm at (90, 45, -60) deg, by hand: two links of 0.3 m, centers of mass half-way."""
    upper, fore = 0.3 * np.cos(np.pi / 4), 0.3 * np.cos(np.pi / 12)
    return GRAVITY * (6.7858 * upper / 2 + 5.0894 * (upper + fore / 2))


def lowest_stiffness(torque):
    """2K + 6 Kc p^2 where 2 K p + 2 Kc p^3 carries the torque."""
    roots = np.roots([2 * HARDENING, 0, 2 * SPRING, -torque])
    deflection = float(roots[np.isreal(roots)].real[0])
    return 2 * SPRING + 6 * HARDENING * deflection**2


@pytest.mark.slow
def test_installed_command_does_the_shipped_example(tmp_path):
    done = installed("invdyn", ROBOT, REST_TO_REST, folder=tmp_path)
    assert done.returncode == 0
    assert done.stderr == "wrote vsa_3r-rest_to_rest.h5\n"
    headline, *lines = done.stdout.splitlines()
    assert headline == "OK  vsa-3r, rest-to-rest: 4001 samples, 4 s"
    assert [line.split()[0] for line in lines[1:6]] == ["joint", "N", "base", "shoulder", "elbow"]
    assert lines[-1].startswith("self-check passed")
    attributes = root_attributes(tmp_path / "vsa_3r-rest_to_rest.h5")
    assert attributes["verdict"] == "ok"
    assert attributes["complete"] == 1
    assert attributes["command_line"] == f"vsacli invdyn {ROBOT} {REST_TO_REST}"


def test_other_shipped_examples_are_feasible(vsacli):
    assert vsacli("invdyn", SEVEN_JOINTS, SEVEN_JOINTS_MOTION, "-q").code == 0
    sliding = vsacli("check-feasibility", ROBOT.parent / "rp_2.yaml", REST_TO_REST.parent / "rp_2.yaml", "-q")
    assert sliding.code == 0


def test_default_name_comes_from_the_file_names(vsacli, tmp_path, motion):
    assert vsacli("invdyn", ROBOT, motion).err == "wrote vsa_3r-move.h5\n"
    assert (tmp_path / "vsa_3r-move.h5").is_file()


def test_stiffness_below_reach_is_named_with_joint_time_and_what_is_reachable(vsacli, tmp_path, too_soft):
    done = vsacli("invdyn", ROBOT, too_soft)
    assert done.code == 3
    assert done.out.startswith(
        "INFEASIBLE  vsa-3r, rest-to-rest: 401 samples, 4 s; 3 of 3 joints infeasible\n"
    )
    # At the end the arm rests, the base without load: its bound is 2K exactly.
    assert "base: stiffness 790 N m/rad at t = 4.000 s is below the minimum of 800 N m/rad" in done.out
    bound = lowest_stiffness(static_shoulder_torque())
    assert f"shoulder: stiffness 790 N m/rad at t = 4.000 s is below the minimum of {bound:.4g} N" in done.out
    with h5py.File(tmp_path / "vsa_3r-soft.h5") as file:
        infeasible = (file["flags"][:] & 1) != 0
        assert np.isnan(file["tau_motor"][:]).any(axis=-1).tolist() == infeasible.tolist()
        assert file["stiffness_min"][-1, 1] == pytest.approx(bound, rel=1e-9)  # two roundings of one number
        assert file.attrs["verdict"] == "infeasible"
        first = file["time"][infeasible[:, 0].argmax()]
    count = infeasible[:, 0].sum()
    assert f"increase it ({count} samples, from {first:.3f} s)" in done.out


@pytest.mark.slow
def test_installed_command_exits_with_3_where_a_step_is_infeasible(tmp_path, too_soft):
    done = installed("invdyn", ROBOT, too_soft, folder=tmp_path)
    assert done.returncode == 3
    assert "is below the minimum of 800 N m/rad at this load" in done.stdout
    assert done.stderr == "wrote vsa_3r-soft.h5\n"


def test_stop_on_infeasible_ends_with_the_first_one(vsacli, tmp_path, too_soft):
    done = vsacli("invdyn", ROBOT, too_soft, "--stop-on-infeasible")
    assert done.code == 3
    assert "stopped early" in done.out
    with h5py.File(tmp_path / "vsa_3r-soft.h5") as file:
        infeasible = (file["flags"][:] & 1).any(axis=1)
        assert file.attrs["complete"] == 0
    assert infeasible[-1]
    assert not infeasible[:-1].any()
    assert f": {len(infeasible)} samples, stopped early, 4 s; " in done.out


def test_json_is_all_there_is_on_stdout(vsacli, tmp_path, too_soft):
    done = vsacli("invdyn", ROBOT, too_soft, "--json")
    report = json.loads(done.out)
    assert done.code == 3
    assert report["format"] == "vsacli-report/2"
    assert [joint["name"] for joint in report["joints"]] == ["base", "shoulder", "elbow"]
    with h5py.File(tmp_path / "vsa_3r-soft.h5") as file:
        assert json.loads(file["report/json"].asstr()[()]) == report
    assert done.err == "wrote vsa_3r-soft.h5\n"


@pytest.mark.usefixtures("no_computing")
@pytest.mark.parametrize("taken", ["r.h5", "figures/r-motion.png", "figures/r-elastic-torque.png"])
def test_existing_file_is_refused_before_anything_is_computed(vsacli, tmp_path, motion, taken):
    (tmp_path / "figures").mkdir()
    (tmp_path / taken).write_bytes(b"precious")
    before = contents(tmp_path)
    done = vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "--plot", "figures")
    assert (done.code, done.out) == (4, "")
    assert done.err == f"{taken}: exists already; choose another name, or replace it with --overwrite\n"
    assert contents(tmp_path) == before


def test_overwrite_replaces_result_and_figures(vsacli, tmp_path, motion):
    (tmp_path / "r.h5").write_bytes(b"old")
    figure = tmp_path / "r-motor-torque.png"
    figure.write_bytes(b"old")
    options = ["--plot", ".", "--variables", "tau_motor,flags", "--overwrite"]
    assert vsacli("invdyn", ROBOT, motion, "-o", "r.h5", *options).code == 0
    assert root_attributes(tmp_path / "r.h5")["verdict"] == "ok"
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("no_computing")
@pytest.mark.parametrize("output", ["link.h5"])
def test_an_input_is_not_replaced_even_with_overwrite(vsacli, tmp_path, motion, output):
    (tmp_path / "link.h5").symlink_to(motion)
    before = motion.read_bytes()
    done = vsacli("invdyn", ROBOT, motion, "-o", output, "--overwrite")
    assert done.code == 2
    assert done.err == f"{output}: is an input of this command; choose another name for the output\n"
    assert motion.read_bytes() == before


def test_variables_limits_what_is_stored(vsacli, motion):
    vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "--variables", "tau_motor, flags")
    with h5py.File("r.h5") as file:
        datasets = {name for name, item in file.items() if isinstance(item, h5py.Dataset)}
    assert datasets == {"time", "joint", "motor", "joint_type", "tau_motor", "flags"}


def test_every_unknown_variable_is_named(vsacli, tmp_path, motion):
    done = vsacli("invdyn", ROBOT, motion, "--variables", "tau_motr,q,flgs")
    assert done.code == 2
    assert done.err.splitlines() == [
        "--variables: no variable is called 'flgs'; did you mean 'flags'?",
        "--variables: no variable is called 'tau_motr'; did you mean 'tau_motor'?",
    ]
    assert contents(tmp_path).keys() == {"move.yaml"}


def test_no_variables_at_all_is_a_usage_error(vsacli, tmp_path, motion):
    done = vsacli("invdyn", ROBOT, motion, "--variables", ",")
    assert done.code == 2
    assert "expected names separated by commas, e.g. tau_motor,flags" in done.err
    assert contents(tmp_path).keys() == {"move.yaml"}


def test_plot_also_draws_the_figures(vsacli, tmp_path, motion):
    done = vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "--plot", "figures")
    names = [f"figures/r-{name}.png" for name in ("motion", "motor-torque", "elastic-torque", "energy")]
    assert done.err.splitlines() == ["wrote r.h5", *(f"wrote {name}" for name in names)]
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in names)


def test_quiet_and_verbose_change_stderr_alone(vsacli, motion):
    plain, quiet, verbose = (
        vsacli("invdyn", ROBOT, motion, "--overwrite", *option) for option in ([], ["-q"], ["-v"])
    )
    assert plain.out == quiet.out == verbose.out
    assert quiet.err == ""
    notes = "vsa-3r: 3 joints; rest-to-rest: 401 samples over 4 s\nNumPy computes: 401 samples are few\n"
    assert verbose.err == notes + plain.err


def test_derivative_wrong_by_one_percent_fails_the_self_check(vsacli, tmp_path, motion, monkeypatch):
    spoil_torque(monkeypatch, 2, scaled(1.01))
    done = vsacli("invdyn", ROBOT, motion)
    assert done.code == 1
    assert "SELF CHECK FAILED" in done.out.splitlines()[0]
    assert "do not use these torques" in done.out
    assert done.err == "wrote vsa_3r-move.h5\n"
    assert root_attributes(tmp_path / "vsa_3r-move.h5")["verdict"] == "self_check_failed"


def test_bug_leaves_a_traceback_a_sentence_and_no_file(vsacli, tmp_path, motion, computing_fails):
    computing_fails(RuntimeError("boom"))
    done = vsacli("invdyn", ROBOT, motion)
    assert (done.code, done.out) == (1, "")
    assert done.err.startswith("Traceback (most recent call last)")
    assert done.err.splitlines()[-2:] == [
        "RuntimeError: boom",
        "vsacli: this is a bug; please report it with the lines above",
    ]
    assert contents(tmp_path).keys() == {"move.yaml"}


def test_trajectory_of_another_robot_is_refused(vsacli, tmp_path):
    done = vsacli("invdyn", ROBOT, SEVEN_JOINTS_MOTION)
    assert (done.code, done.out) == (2, "")
    assert f"{SEVEN_JOINTS_MOTION}:11: end: expected 3 values, one for each joint (base, " in done.err
    assert contents(tmp_path) == {}


def test_figures_that_cannot_be_drawn_are_refused_before_anything_is_computed(vsacli, tmp_path, motion):
    done = vsacli("invdyn", ROBOT, motion, "--variables", "flags", "--plot", "figures")
    assert done.code == 2
    assert "nothing can be plotted" in done.err
    assert not list(tmp_path.glob("*.h5"))


def test_a_far_upper_end_of_the_attainable_range_is_none(vsacli):
    """That of a linkage is nearly stretched, at 9e10 N m/rad; its motors end at 519."""
    robot = REPOSITORY / "robots" / "devices" / "vsa_ii.yaml"
    motion = REPOSITORY / "trajectories" / "devices" / "vsa_ii.yaml"
    run = ("check-feasibility", robot, motion, "--set", "rate=50")
    rows = [line.split() for line in vsacli(*run).out.splitlines() if line.startswith("joint ")]
    assert rows[1][-3:-1] == ["from", "86.7"]
    (joint,) = json.loads(vsacli(*run, "--json").out)["joints"]
    assert joint["margin"]["attainable"][1] > 1e10
