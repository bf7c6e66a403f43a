"""`vsacli plot`, `export` and `info` of simulation files."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, contents, edited, installed

from vsacli.results.plots import compare_files
from vsacli.results.store.reader import open_stored

FIGURES = ("motion", "position-error", "stiffness-error", "motor-torque")
JOINTS = ("base", "shoulder", "elbow")
HEAD = """\
format: vsacli-robot/1
name: rig
joints:
  - name: a
    type: revolute
    dh: {a: 0.2, alpha: 0}
    link: {mass: 2, com: [0.1, 0, 0], inertia: {xx: 0.1, yy: 0.2, zz: 0.2}}
"""
GEARED = """\
    actuator:
      type: antagonistic
      motor: [{inertia: 0.02, gear_ratio: -10, side: shaft}, {inertia: 0.001, gear_ratio: 40, side: shaft}]
      spring: {type: cubic, k: 400, k_c: 2000}
"""
MOVE = """\
format: vsacli-trajectory/1
name: move
duration: 0.5
rate: 50
position: {type: polynomial, degree: 7, start: 0, end: 0.3}
"""
FEEDBACK = ("--controller", "feedback-linearization", "--initial-error", "0.01,0,-0.02")
SHORT = (("rate: 1000 ", "rate: 25 "), ("duration: 4.0", "duration: 1.0"))


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a simulation `s.h5` of 26 samples, and what was printed."""
    folder = tmp_path_factory.mktemp("simulated")
    edited(REST_TO_REST, folder / "quick.yaml", *SHORT)
    done = installed("simulate", ROBOT, "quick.yaml", *FEEDBACK, "-o", "s.h5", folder=folder)
    assert done.returncode == 0
    (folder / "printed").write_text(done.stdout)
    return folder


def stored(path: Path, name: str) -> np.ndarray:
    """A variable, read without vsacli; (samples, ...)."""
    with h5py.File(path) as file:
        values: np.ndarray = file[name][:]
    return values


def parsed(text: str) -> tuple[list[str], np.ndarray]:
    header, *rows = csv.reader(io.StringIO(text))
    return header, np.array(rows, dtype=float)


@pytest.mark.slow
def test_installed_command_draws_the_figures_that_simulate_drew(tmp_path: Path, simulated: Path) -> None:
    inputs = (ROBOT, simulated / "quick.yaml")
    assert (
        installed(
            "simulate", *inputs, *FEEDBACK, "-o", "s.h5", "--plot", "figures", folder=tmp_path
        ).returncode
        == 0
    )
    done = installed("plot", "s.h5", "-o", "later", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.splitlines() == [f"wrote later/s-{name}.png" for name in FIGURES]
    assert contents(tmp_path / "later") == contents(tmp_path / "figures")


@pytest.mark.slow
def test_format_and_overwrite(vsacli: Callable[..., Any], tmp_path: Path, simulated: Path) -> None:
    (tmp_path / "s-motor-torque.svg").write_bytes(b"precious")
    done = vsacli("plot", simulated / "s.h5", "--format", "svg")
    assert (done.code, contents(tmp_path)) == (4, {"s-motor-torque.svg": b"precious"})
    assert vsacli("plot", simulated / "s.h5", "--format", "svg", "--overwrite").code == 0
    files = contents(tmp_path)
    assert files.keys() == {f"s-{name}.svg" for name in FIGURES}
    assert all(content.startswith(b"<?xml") for content in files.values())


@pytest.mark.slow
def test_rigid_joints_have_no_stiffness_error(vsacli: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(HEAD + "    actuator: {type: rigid, motor: {inertia: 0.1}}\n")
    (tmp_path / "move.yaml").write_text(MOVE)
    (tmp_path / "s-stiffness-error.png").write_bytes(b"of another simulation")
    assert vsacli("simulate", "arm.yaml", "move.yaml", "-o", "s.h5", "--plot", ".").code == 0
    assert (tmp_path / "s-stiffness-error.png").read_bytes() == b"of another simulation"
    assert vsacli("plot", "s.h5", "-o", "later").code == 0
    assert contents(tmp_path / "later").keys() == {
        f"s-{name}.png" for name in ("motion", "position-error", "motor-torque")
    }


@pytest.mark.slow
def test_several_simulations_are_compared(
    vsacli: Callable[..., Any], tmp_path: Path, simulated: Path
) -> None:
    shutil.copy(simulated / "s.h5", tmp_path / "t.h5")
    done = vsacli("plot", simulated / "s.h5", "t.h5", "-o", "both", "--format", "svg")
    assert (done.code, done.err) == (0, "wrote both/s-t-compare.svg\n")


@pytest.mark.slow
def test_a_comparison_shows_the_position_errors(tmp_path: Path, simulated: Path) -> None:
    other = shutil.copy(simulated / "s.h5", tmp_path / "t.h5")
    with h5py.File(other, "r+") as file:
        file["q_error"][...] *= 2
    with open_stored(simulated / "s.h5") as first, open_stored(other) as second:
        figure = compare_files([first, second])["compare"]
    assert figure.get_suptitle() == "comparison of 2 simulations of vsa-3r: position errors"
    error = stored(simulated / "s.h5", "q_error")
    for joint, axes in enumerate(figure.axes[::2]):
        assert (axes.get_title(loc="left"), axes.get_ylabel()) == (JOINTS[joint], "$q - q_d$ [rad]")
        one, two = (line.get_ydata() for line in axes.lines)
        np.testing.assert_array_equal(one, error[:, joint])
        np.testing.assert_array_equal(two, 2 * error[:, joint])


def test_results_and_simulations_are_not_compared(
    vsacli: Callable[..., Any], tmp_path: Path, simulated: Path, feasible_result: Path
) -> None:
    shutil.copy(simulated / "s.h5", tmp_path / "s.h5")
    shutil.copy(feasible_result, tmp_path / "r.h5")
    before = contents(tmp_path)
    done = vsacli("plot", "r.h5", "s.h5")
    assert (done.code, done.out, contents(tmp_path)) == (2, "", before)
    assert done.err == (
        "r.h5 is a result, s.h5 is a simulation; compare results with results, and simulations with "
        "simulations\n"
    )


@pytest.mark.slow
def test_installed_command_exports_what_happened(tmp_path: Path, simulated: Path) -> None:
    done = installed("export", simulated / "s.h5", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    header, values = parsed(done.stdout)
    torques = [f"{joint}.tau_motor_{motor}" for joint in JOINTS for motor in (1, 2)]
    of_joints = [f"{joint}.{name}" for name in ("q", "stiffness") for joint in JOINTS]
    assert header == ["time", *of_joints, *torques]
    names = ("q", "stiffness", "tau_motor")
    expected = [stored(simulated / "s.h5", name).reshape(26, -1) for name in names]
    np.testing.assert_array_equal(values[:, 1:], np.hstack(expected))
    np.testing.assert_array_equal(values[:, 0], np.arange(26) / 25)


def test_variables_and_rate(vsacli: Callable[..., Any], simulated: Path) -> None:
    done = vsacli("export", simulated / "s.h5", "--variables", "flags,q_error,q", "--rate", "5")
    header, values = parsed(done.out)
    names = ("q", "q_error", "flags")  # as declared
    assert header == ["time", *(f"{joint}.{name}" for name in names for joint in JOINTS)]
    expected = np.hstack([stored(simulated / "s.h5", name) for name in names])[::5]
    np.testing.assert_array_equal(values[:, 1:], expected)


def test_the_simulated_motion_reads_back_as_a_trajectory(
    vsacli: Callable[..., Any], tmp_path: Path, simulated: Path
) -> None:
    vsacli("export", simulated / "s.h5", "--variables", "q,stiffness", "-o", "again.csv")
    vsacli("invdyn", ROBOT, "again.csv", "-o", "again.h5")
    np.testing.assert_array_equal(stored(tmp_path / "again.h5", "q"), stored(simulated / "s.h5", "q"))


@pytest.mark.slow
def test_joints_of_every_kind_have_the_columns_they_have_in_a_result(
    vsacli: Callable[..., Any], tmp_path: Path
) -> None:
    robot = REPOSITORY / "robots" / "mixed_3r.yaml"
    motion = edited(
        REPOSITORY / "trajectories" / "mixed_3r.yaml", tmp_path / "m.yaml", ("rate: 1000", "rate: 25")
    )
    assert vsacli("invdyn", robot, motion, "-o", "r.h5").code == 0
    vsacli("simulate", robot, motion, "-o", "s.h5")
    of_result = vsacli("export", "r.h5", "--variables", "tau_motor,stiffness,det_A").out
    names = "tau_motor,stiffness,det_A"
    of_simulation = vsacli("export", "s.h5", "--variables", names)
    assert of_simulation.code == 0
    columns = of_simulation.out.splitlines()[0].split(",")
    assert sorted(columns) == sorted(of_result.splitlines()[0].split(","))
    assert len(columns) < 1 + 3 * 4


def test_shafts_of_the_motors(vsacli: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(HEAD + GEARED)
    (tmp_path / "move.yaml").write_text(MOVE + "stiffness: {type: constant, value: 1000}\n")
    assert vsacli("simulate", "rig.yaml", "move.yaml", "-o", "s.h5").code == 0
    names = "q,theta,dtheta,tau_motor_cmd,tau_motor,phi"
    done = vsacli("export", "s.h5", "--side", "motor", "--variables", names)
    assert done.code == 0
    header, values = parsed(done.out)
    columns = dict(zip(header, values.T, strict=True))
    ratio = np.array([-10.0, 40.0])
    for name, factor in {"theta": ratio, "dtheta": ratio, "tau_motor_cmd": 1 / ratio}.items():
        for motor in (0, 1):
            shaft, joint = (
                columns[f"a.{name}_shaft_{motor + 1}"],
                stored(tmp_path / "s.h5", name)[:, 0, motor],
            )
            np.testing.assert_allclose(shaft, factor[motor] * joint, rtol=1e-15)  # one rounding
    expected = {"a.q", "a.tau_motor_shaft_1", "a.phi_1", "a.phi_2"}
    assert expected < set(header)


def test_without_a_ratio_nothing_is_guessed(vsacli: Callable[..., Any], simulated: Path) -> None:
    done = vsacli("export", simulated / "s.h5", "--side", "motor")
    assert (done.code, done.out) == (2, "")
    assert "--side motor needs" in done.err
    assert "add it and run simulate again, or use --side joint" in done.err


@pytest.mark.parametrize(
    ("name", "there"),
    [
        ("ddtheta", "'dtheta'"),
        ("ddq_error", "'dq_error'"),
    ],
)
def test_a_name_without_a_variable_leads_to_the_nearest(
    vsacli: Callable[..., Any], simulated: Path, name: str, there: str
) -> None:
    done = vsacli("export", simulated / "s.h5", "--variables", name)
    assert (done.code, done.out) == (2, "")
    assert done.err == f"--variables: no variable is called {name!r}; did you mean {there}?\n"


@pytest.mark.slow
def test_a_run_that_ended_early(vsacli: Callable[..., Any], too_soft: Path, tmp_path: Path) -> None:
    printed = vsacli("simulate", ROBOT, too_soft, "-o", "s.h5", "--plot", "figures").out
    assert vsacli("plot", "s.h5", "-o", "later").code == 0
    assert contents(tmp_path / "later") == contents(tmp_path / "figures")
    done = vsacli("export", "s.h5")
    assert done.code == 0
    assert len(done.out.splitlines()) == 1 + len(stored(tmp_path / "s.h5", "time"))
    assert vsacli("info", "s.h5").out.endswith(f"\n\n{printed}")


def test_info_ends_with_what_simulate_printed(vsacli: Callable[..., Any], simulated: Path) -> None:
    done = vsacli("info", simulated / "s.h5")
    assert (done.code, done.err) == (0, "")
    assert done.out.endswith("\n\n" + (simulated / "printed").read_text())


@pytest.mark.slow
def test_info_of_measured_positions_shows_what_they_cost(vsacli: Callable[..., Any], tmp_path: Path) -> None:
    feedback = ("--controller", "feedback-linearization", "--feedback", "positions")
    motion = edited(
        REST_TO_REST,
        tmp_path / "fine.yaml",
        ("rate: 1000 ", "rate: 250 "),
        ("duration: 4.0", "duration: 0.8"),
    )
    printed = vsacli("simulate", ROBOT, motion, *feedback, "-o", "s.h5").out
    assert "q error with full state" in printed
    assert vsacli("info", "s.h5").out.endswith(f"\n\n{printed}")


@pytest.mark.slow
def test_notes_are_no_warnings(vsacli: Callable[..., Any], tmp_path: Path) -> None:
    motion = edited(REST_TO_REST, tmp_path / "odd.yaml", ("rate: 1000 ", "rate: 25.1 "))
    sentence = "the rate is 25 Hz, not 25.1 Hz, for a whole number of intervals in 4 s"
    for command in ("invdyn", "simulate"):
        done = vsacli(command, ROBOT, motion, "-o", f"{command}.h5")
        assert f"\nnote: {sentence}\n" in done.out
        assert "warning" not in done.out
        report = json.loads(vsacli("info", f"{command}.h5", "--field", "report").out)
        assert (report["warnings"], report["notes"]) == ([], [sentence])
        assert vsacli("info", f"{command}.h5").out.endswith(f"\n\n{done.out}")
    assert f"odd.yaml: note: {sentence}\n" in vsacli("validate", motion, ROBOT).out
    assert f"\nnote: {sentence}\n" in vsacli("info", motion).out
