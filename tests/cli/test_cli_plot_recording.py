"""`vsacli plot` of recordings, and of results that were computed from one."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, contents

ROBOT = REPOSITORY / "robots" / "planar_2r.yaml"
COMPUTED = ("motion", "motor-torque", "elastic-torque", "energy")


@pytest.fixture
def log(own_folder: Path) -> Path:
    """A noisy recording of an arm with two joints, `log.csv`."""
    time = np.arange(401) / 100
    rng = np.random.default_rng(4)
    columns = {"time [s]": time}
    for number, joint in enumerate(("shoulder", "elbow")):
        motion = 0.4 * np.sin(2 * np.pi * 0.5 * time + number)
        columns[f"{joint}.q [rad]"] = motion + 1e-4 * rng.standard_normal(len(time))
        columns[f"{joint}.stiffness [N m/rad]"] = np.full(len(time), 2e4)
    path = own_folder / "log.csv"
    header = ",".join(columns)
    np.savetxt(path, np.array(list(columns.values())).T, delimiter=",", header=header, comments="")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("robot", [(), ("--robot", ROBOT)])
def test_a_recording_is_drawn(vsacli, log, robot):
    done = vsacli("plot", log.name, *robot, "-o", "drawn", "--format", "svg")
    assert (done.code, done.out, done.err) == (0, "", "wrote drawn/log-recording.svg\n")


@pytest.mark.slow
def test_positions_alone_are_drawn_of_a_robot_that_takes_a_stiffness(vsacli, log):
    rows = np.loadtxt(log, delimiter=",", skiprows=1)[:, [0, 1, 3]]
    np.savetxt("q.csv", rows, delimiter=",", header="time,q1,q2", comments="")
    assert vsacli("plot", "q.csv", "--robot", ROBOT, "--joints", "elbow", "--format", "svg").code == 0


@pytest.mark.slow
def test_a_trajectory_with_recorded_signals_is_drawn(vsacli, log, own_folder):
    text = f"format: vsacli-trajectory/1\nname: half\nposition: {{type: csv, file: {log.name}}}\n"
    (own_folder / "half.yaml").write_text(text + "stiffness: {type: constant, value: 2e4}\n")
    done = vsacli("plot", "half.yaml", "--robot", ROBOT, "--format", "svg")
    assert (done.code, done.err) == (0, "wrote half-recording.svg\n")


@pytest.mark.slow
def test_a_result_of_a_recording_shows_it_as_invdyn_does_and_as_the_recording_itself(vsacli, log, own_folder):
    done = vsacli("invdyn", ROBOT, log.name, "-o", "log.h5", "--plot", "with", "-q")
    assert done.code in {0, 3}
    assert vsacli("plot", "log.h5", "-o", "after").code == 0
    assert vsacli("plot", log.name, "-o", "alone").code == 0
    drawn = contents(own_folder)
    names = {f"log-{name}.png" for name in (*COMPUTED, "recording")}
    for folder in ("with", "after"):
        assert {Path(path).name for path in drawn if path.startswith(folder)} == names
        assert drawn[f"{folder}/log-recording.png"] == drawn["alone/log-recording.png"]


@pytest.fixture
def result(vsacli, log):
    """A result of the recording, `r.h5`."""
    vsacli("invdyn", ROBOT, log.name, "-o", "r.h5", "-q")
    return "r.h5"


@pytest.mark.slow
def test_a_result_of_another_version_says_why_its_recording_is_not_drawn(vsacli, result):
    with h5py.File(result, "r+") as file:
        file.attrs["generated_by"] = "vsacli 0.0.1"
    done = vsacli("plot", result, "--format", "svg")
    assert done.code == 0
    expected = "r.h5: no figure of its recording: the result was computed by vsacli 0.0.1, and this is vsacli"
    assert done.err.startswith(expected)
    assert "recording.svg" not in done.err


@pytest.mark.slow
def test_variables_of_a_result_leave_its_recording_out(vsacli, result):
    done = vsacli("plot", result, "--variables", "q", "--format", "svg")
    assert (done.code, done.err) == (0, "wrote r-q.svg\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("log.csv", "move.yaml"), "recordings are drawn one at a time"),
        (("log.csv", "--variables", "q"), "--variables needs a result, which `vsacli invdyn` computes"),
        (("log.csv", "--format", "html"), "--format html needs a result"),
        (("log.csv", "--joints", "elbw"), "log.csv: has no joint 'elbw'; did you mean 'elbow'?"),
        (("log.csv", "--from", "9"), "log.csv: has no samples from t = 9 s on; it spans 0 to "),
        (
            ("move.yaml",),
            "move.yaml: has no recorded signals to plot; compute a result first: vsacli invdyn ROBOT",
        ),
        (("r.h5", "--robot", ROBOT), "--robot is only for recordings; leave it out"),
    ],
)
@pytest.mark.usefixtures("log", "motion")
def test_what_is_not_drawn_is_refused(vsacli, own_folder, arguments, message):
    before = contents(own_folder)
    done = vsacli("plot", *arguments)
    assert done.code == 2
    assert message in done.err
    assert contents(own_folder) == before


@pytest.mark.usefixtures("no_computing")
def test_an_existing_figure_is_refused_before_anything_is_fitted(vsacli, log):
    (log.parent / "log-recording.png").write_bytes(b"precious")
    done = vsacli("plot", log.name)
    assert done.code == 4
    assert done.err.startswith("log-recording.png: exists already;")
