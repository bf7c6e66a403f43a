"""`vsacli simulate`: files, report, exit codes, and what it refuses."""

from __future__ import annotations

import json
import re

import h5py
import numpy as np
import pytest
import xarray
from samples.command_line import REPOSITORY, ROBOT, contents, edited

from vsacli import InputError, open_result
from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.base.variables import OF_ANY_ROBOT
from vsacli.cli.console import Exit
from vsacli.results.store.reader import StoredSimulation

FEEDBACK = ("--controller", "feedback-linearization")


@pytest.fixture
def quick(motion):
    """The rest-to-rest motion of the 3R arm in one second, 26 steps."""
    return edited(
        motion,
        motion.with_name("quick.yaml"),
        ("rate: 100 ", "rate: 25 "),
        ("duration: 4.0", "duration: 1.0"),
    )


def test_feedforward_is_simulated_and_stored(vsacli, quick, tmp_path):
    done = vsacli("simulate", ROBOT, quick)
    assert done.code == Exit.OK
    assert done.out.splitlines()[0].startswith("OK  vsa-3r, rest-to-rest: feedforward, 1 s; ")
    assert done.err == "wrote vsa_3r-quick-simulation.h5\n"
    with StoredSimulation.open(tmp_path / "vsa_3r-quick-simulation.h5") as stored:
        assert stored.attributes["format"] == "vsacli-simulation/2"
        assert (stored.verdict, stored.complete, stored.samples) == ("ok", True, 26)
        declared = [name for name, each in SIMULATION_VARIABLES.items() if each.requires in OF_ANY_ROBOT]
        assert list(stored.variables) == [name for name in declared[1:] if not name.endswith("_measured")]
        q, commanded, error = (stored.read(name) for name in ("q", "q_ref", "q_error"))
        assert np.array_equal(q - commanded, error)
        assert np.abs(error).max() < 1e-8  # the integrator's tolerance, as elsewhere
        assert stored.report_json["format"] == "vsacli-simulation-report/2"


def test_commanded_and_saturated_torques_are_distinguished(vsacli, quick):
    weak = ("--set", "joints.base.actuator.motor.max_torque=60")
    out = vsacli("simulate", ROBOT, quick, *weak, "-o", "s.h5").out
    (finding,) = [line for line in out.splitlines() if line.startswith("base: joint-side torque")]
    assert finding.endswith("limit of -60 N m: as commanded; the motor saturates at the limit")
    assert "N m, saturated" in out
    (row,) = [line.split() for line in out.splitlines() if line.startswith("base  ")]
    assert max(map(float, (row[-3], row[-1]))) == 60
    assert "saturated" not in vsacli("simulate", ROBOT, quick, "-o", "strong.h5").out


@pytest.mark.slow
def test_a_simulation_opens_in_xarray(vsacli, quick, tmp_path):
    vsacli("simulate", ROBOT, quick, "-o", "s.h5")
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf") as data:
        assert data.q.dims == ("time", "joint")
        assert data.tau_motor.dims == ("time", "joint", "motor")
        assert data.q.attrs["units"] == "rad"
        assert data.q.attrs["long_name"] == "joint position"
        assert data.q_ref.attrs["long_name"] == "commanded joint position"


@pytest.mark.slow
def test_feedback_from_a_poles_file(vsacli, quick, tmp_path):
    poles = tmp_path / "poles.yaml"
    rows = "".join(f"  - name: {name}\n    position: -25\n" for name in ("base", "shoulder", "elbow"))
    poles.write_text(f"format: vsacli-poles/1\njoints:\n{rows}")
    done = vsacli(
        "simulate", ROBOT, quick, *FEEDBACK, "--poles", poles, "--initial-error", "0.01,0,-0.01",
        "--initial-stiffness-error", "10", "-o", "s.h5", "--json", "--plot", "figures",
    )  # fmt: skip
    assert done.code == Exit.OK
    report = json.loads(done.out)
    assert [joint["q_error"]["peak"] for joint in report["joints"]] == pytest.approx(
        [0.01, 0, 0.01], abs=1e-9
    )
    assert all(abs(joint["q_error"]["final"]) < 1e-8 for joint in report["joints"])  # 1 s at 25/s
    names = ("motion", "position-error", "stiffness-error", "motor-torque")
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {f"s-{name}.png" for name in names}
    with h5py.File(tmp_path / "s.h5") as file:
        read = [group.attrs["path"] for name, group in file["inputs"].items() if name.startswith("file_")]
    assert set(read) == {str(ROBOT), str(quick), str(poles)}


def test_a_run_that_ends_early_is_written_with_exit_code_3(vsacli, too_soft, tmp_path):
    done = vsacli("simulate", ROBOT, too_soft, "-o", "s.h5")
    assert done.code == Exit.VERDICT
    assert "INFEASIBLE" in done.out
    assert "ended at t = " in done.out
    with StoredSimulation.open(tmp_path / "s.h5") as stored:
        assert (stored.verdict, stored.complete) == ("infeasible", False)
        assert 0 < stored.samples < 401


@pytest.mark.parametrize(
    ("tolerance", "code", "verdict"), [("1%", 3, "off_target"), ("30%", 0, "ok"), ("0.2", 0, "ok")]
)
def test_a_run_that_ends_off_the_command_is_off_target(vsacli, quick, tmp_path, tolerance, code, verdict):
    arguments = ("--perturb", "0.05", "--goal-tolerance", tolerance, "-o", "s.h5")
    done = vsacli("simulate", ROBOT, quick, *arguments)
    assert done.code == code
    headline, *_ = done.out.splitlines()
    assert headline.startswith(f"{verdict.upper().replace('_', ' ')}  ")
    assert headline.endswith("; 3 of 3 joints off target") == (verdict == "off_target")
    assert ("the goal tolerance" in done.out) == (verdict == "off_target")
    with StoredSimulation.open(tmp_path / "s.h5") as stored:
        assert (stored.verdict, stored.complete) == (verdict, True)
        ends, q = stored.read("q_error")[-1], stored.read("q_ref")
        joints = stored.report_json["joints"]
    ranges = q.max(axis=0) - q.min(axis=0)
    allowed = {"1%": 0.01 * ranges + 1e-3, "30%": 0.3 * ranges + 1e-3, "0.2": np.full(3, 0.2)}[tolerance]
    assert [joint["tolerance"] for joint in joints] == pytest.approx(allowed, rel=1e-12)
    assert (np.abs(ends) > allowed).any() == (verdict == "off_target")
    assert vsacli("info", "s.h5").out.rstrip().endswith(done.out.rstrip())


def test_a_run_whose_budget_is_used_up_is_written_with_exit_code_3(vsacli, quick, tmp_path):
    done = vsacli("simulate", ROBOT, quick, "--budget", "400", "-o", "s.h5", "--json")
    assert done.code == Exit.VERDICT
    report = json.loads(done.out)
    assert (report["verdict"], report["complete"], report["budget"]) == ("incomplete", False, 400)
    assert report["ending"].startswith("the budget of 400")
    assert [method["name"] for method in report["methods"]] == ["DOP853", "Radau"]
    assert 0 < report["methods"][1]["from"] < 1
    with StoredSimulation.open(tmp_path / "s.h5") as stored:
        assert (stored.verdict, stored.complete) == ("incomplete", False)
        assert 1 < stored.samples == report["samples"] < 26
        assert np.abs(stored.read("q_error")).max() < 1e-7
    assert "INCOMPLETE" in vsacli("info", "s.h5").out


@pytest.mark.slow
def test_perturbed_runs_are_repeatable(vsacli, quick):
    arguments = ("simulate", ROBOT, quick, "--perturb", "0.02", "--json", "--overwrite", "-o", "s.h5")
    first, second, other = vsacli(*arguments), vsacli(*arguments), vsacli(*arguments, "--seed", "1")
    assert first.out == second.out != other.out


@pytest.mark.slow
def test_measured_positions_are_reported(vsacli, quick):
    fine = edited(
        quick, quick.with_name("fine.yaml"), ("rate: 25 ", "rate: 250 "), ("duration: 1.0", "duration: 0.8")
    )
    done = vsacli("simulate", ROBOT, fine, *FEEDBACK, "--feedback", "positions", "--initial-error", "0.01")
    assert done.code == Exit.VERDICT  # at 250 Hz these poles miss the end by 0.1 rad
    header, _, base, *_ = done.out.split("\n\n")[1].splitlines()
    assert header.endswith("q error with full state")
    assert base.split("  ")[-1].strip().startswith("0.01 / ")


@pytest.mark.slow
def test_sensors_that_the_controller_does_not_read_are_noted(vsacli, quick):
    unread = "--sensor-noise and --encoder-bits affect the stored measurements only"
    bits = ("--encoder-bits", "16", "--overwrite", "-o", "s.h5")
    assert unread in vsacli("simulate", ROBOT, quick, *bits).err
    assert unread not in vsacli("simulate", ROBOT, quick, *FEEDBACK, "--feedback", "positions", *bits).err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*FEEDBACK, "--poles", "-1,-2,-3,1"), "pole 1 of the position"),
        ((*FEEDBACK, "--poles", "-1,-2"), "(5 with integral action), or 1 that is repeated, found 2"),
        ((*FEEDBACK, "--integral", "--poles", "-1,-2,-3,-4"), "expected 5 poles of the position error (4"),
        ((*FEEDBACK, "--stiffness-poles", "5"), "pole 5 of the stiffness"),
        ((*FEEDBACK, "--poles", "fast"), "expected poles such as -20,-21"),
        ((*FEEDBACK, "--poles", "none.yaml"), "none.yaml: no such file"),
        (("--poles", "-20"), "--poles needs --controller feedback-linearization"),
        (("--feedback", "positions"), "positions as feedback"),
        (("--initial-error", "0.1,0.2"), "expected 1 value, or 3 (base, shoulder, elbow), found 2"),
        (("--initial-error", "much"), "expected a value in rad (m), or one for each joint"),
        (("--goal-tolerance", "tight"), "--goal-tolerance: expected a number in rad (m) such as 0.01, or"),
        (("--goal-tolerance", "300%"), "must be from 0 % to 100 % of a joint's range, not 300%"),
        (("--rtol", "0"), "must be positive, not 0; expected a relative tolerance, e.g. 1e-9"),
        (("--rtol", "0.1"), "the relative tolerance must be from 1e-13 to 0.001, not 0.1"),
        (("--atol", "0.1"), "the absolute tolerance must be above 0 and at most 0.001, not 0.1"),
        (("--budget", "0"), "must be at least 1, not 0; expected a number of evaluations"),
        (("--sensor-noise", "-1"), "the sensor noise must be from 0 to 1e+30, not -1"),
        (("--encoder-bits", "100"), "an encoder must have 1 to 48 bits, not 100"),
        ((*FEEDBACK, "--poles", "-1e6"), "its poles are too fast to be simulated: rounding of"),
        (("--perturb", "2"), "'2': expected a share from 0 % to 100 %"),
        (("--perturb", "100%"), "the model error must be at least 0 and below 1, e.g. 0.05 for 5 %"),
        (("--initial-stiffness-error", "-100"), "is below the minimum of 819.4 N m/rad at this"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)  # fmt: skip
def test_what_cannot_be_simulated_is_refused(vsacli, quick, tmp_path, arguments, message):
    before = contents(tmp_path)
    done = vsacli("simulate", ROBOT, quick, *arguments)
    assert done.code == Exit.USAGE
    assert message in done.err
    assert "Traceback" not in done.err
    assert contents(tmp_path) == before


def test_a_rigid_joint_among_others_is_refused_by_name(vsacli, tmp_path):
    done = vsacli(
        "simulate", REPOSITORY / "robots/mixed_3r.yaml", REPOSITORY / "trajectories/mixed_3r.yaml", *FEEDBACK
    )
    assert done.code == Exit.USAGE
    assert "at none: base is rigid" in done.err
    assert contents(tmp_path) == {}


@pytest.mark.parametrize(
    ("wrench", "message"),
    [
        (
            "{frame: base, type: constant, value: [1, 2, 3, 4, 5]}",
            "expected 6 numbers",
        ),
        (
            "{frame: base, type: polynomial, degree: 1, start: [0, 0, 0, 0, 0, 0], end: [1, 0, 0, 0, 0, 0]}",
            "degree: must be odd, from 3 to 15",
        ),
    ],
    ids=["too short", "not smooth"],
)
def test_a_wrench_that_cannot_act_is_refused(vsacli, quick, tmp_path, wrench, message):
    quick.write_text(f"{quick.read_text()}\nwrench: {wrench}\n")
    done = vsacli("simulate", ROBOT, quick)
    assert done.code == Exit.USAGE
    assert re.match(r"\S*quick.yaml:\d+: ", done.err)
    assert message in done.err
    assert not list(tmp_path.glob("*.h5"))


def test_files_that_exist_are_kept(vsacli, quick, tmp_path):
    (tmp_path / "s.h5").write_text("mine")
    done = vsacli("simulate", ROBOT, quick, "-o", "s.h5")
    assert done.code == Exit.STORAGE
    assert (tmp_path / "s.h5").read_text() == "mine"
    assert vsacli("simulate", ROBOT, quick, "-o", quick, "--overwrite").code == Exit.USAGE


def test_a_simulation_is_no_result_of_invdyn(vsacli, quick, tmp_path):
    vsacli("simulate", ROBOT, quick, "-o", "s.h5")
    with pytest.raises(InputError, match="is a simulation, expected a result"):
        open_result(tmp_path / "s.h5")
