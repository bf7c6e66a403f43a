"""Variables that changed their names before 0.1: the error for an old name says the new one."""

from __future__ import annotations

import re
import shutil

import h5py
import numpy as np
import pytest
from samples.command_line import ROBOT, rest_to_rest
from samples.marks import slow

from vsacli import inverse_dynamics, load_robot, load_trajectory, open_result, simulate
from vsacli.base.renamed import RENAMINGS, successor
from vsacli.base.simulation_variables import SIMULATED, SIMULATION_VARIABLES
from vsacli.cli.main import run

STORED = {
    "tau_spring": "tau_transmission",
    "stiffness_lower": "stiffness_min",
    "stiffness_upper": "stiffness_max",
}


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """A result, `r.h5`, and a simulation, `s.h5`, of the trajectory `move.yaml`; not to be changed."""
    folder = tmp_path_factory.mktemp("computed")
    rest_to_rest(folder / "move.yaml")
    inputs = (str(ROBOT), str(folder / "move.yaml"))
    assert run(["invdyn", *inputs, "-q", "-o", str(folder / "r.h5")]) == 0
    assert run(["simulate", *inputs, "--sensor-noise", "1e-4,0.5", "-q", "-o", str(folder / "s.h5")]) == 0
    return folder


@pytest.fixture
def files(computed, own_folder):
    """Copies of them in the folder in which the test runs."""
    return shutil.copytree(computed, own_folder, dirs_exist_ok=True)


@pytest.mark.parametrize("name", STORED)
def test_an_old_variable_of_results_is_refused_with_the_new_one(vsacli, files, name):
    for arguments in (("export", "r.h5"), ("plot", "r.h5"), ("invdyn", ROBOT, "move.yaml", "-o", "t.h5")):
        outcome = vsacli(*arguments, "--variables", name)
        assert outcome.code == 2
        assert f"no variable is called {name!r}; it is now {STORED[name]!r}" in outcome.err
    with (
        open_result(files / "r.h5") as result,
        pytest.raises(AttributeError, match=f"{name!r}; it is now {STORED[name]!r}"),
    ):
        getattr(result, name)


def test_every_simulated_variable_had_an_old_name():
    old = {"tau_spring" if name == "tau_transmission" else name: name for name in SIMULATED}
    assert len(old) == 22
    for name, now in old.items():
        assert successor(f"{name}_actual", SIMULATION_VARIABLES) == now


@pytest.mark.parametrize("name", ["q", "stiffness", "tau_motor", "det_A"])
def test_an_actual_variable_is_refused_with_the_simulated_one(vsacli, files, name):
    for command in ("export", "plot"):
        outcome = vsacli(command, "s.h5", "--variables", f"{name}_actual")
        assert outcome.code == 2
        assert f"no variable is called '{name}_actual'; it is now {name!r}" in outcome.err
    robot = load_robot(ROBOT)
    past = simulate(robot, load_trajectory(files / "move.yaml", robot)).history
    with pytest.raises(AttributeError, match=f"has no variable '{name}_actual'; it is now '{name}'"):
        getattr(past, f"{name}_actual")


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("new", "old"),
    [
        ("base.q", "base.q_actual"),
        slow("base.q", "base.q_actual [rad]"),
        slow("base.tau_motor_1", "base.tau_motor_actual_1"),
        slow("base.tau_transmission_2", "base.tau_spring_2"),
        slow("base.stiffness_min", "base.stiffness_lower"),
        ("q1", "q_actual1"),
    ],
)
def test_a_recording_with_an_old_column_is_refused_with_the_new_one(vsacli, files, new, old):
    variables = "q,tau_motor,tau_transmission,stiffness_min"
    assert vsacli("export", "r.h5", "--variables", variables, "-o", "m.csv").code == 0
    column = new if "." in new else "base.q"
    text = (files / "m.csv").read_text()
    assert f",{column}," in text
    (files / "m.csv").write_text(text.replace(f",{column},", f",{old},", 1))
    outcome = vsacli("compare", "r.h5", "m.csv")
    assert outcome.code == 2
    expected = f"m.csv:1: unknown column '{re.sub(r' .*', '', old)}'; it is now '{new}'"
    assert expected in " ".join(outcome.err.split())
    mapped = f"columns: {{{column}: {{column: {re.sub(r' .*', '', old)}}}}}\n"
    (files / "columns.yaml").write_text("format: vsacli-columns/1\n" + mapped)
    assert vsacli("compare", "r.h5", "m.csv", "--columns", "columns.yaml").code == 0


RENAMED_COLUMNS = "base.q_actual, shoulder.q_actual, elbow.q_actual; they are now base.q, shoulder.q, elbow.q"


def test_an_identification_names_the_new_column(vsacli, files):
    names = "q_measured,theta_measured,tau_motor_measured"
    assert vsacli("export", "s.h5", "--variables", names, "-o", "m.csv").code == 0
    (files / "m.csv").write_text((files / "m.csv").read_text().replace("q_measured", "q_actual"))
    outcome = vsacli("identify", ROBOT, "m.csv")
    assert outcome.code == 2
    assert outcome.err == f"m.csv:1: 3 unknown columns: {RENAMED_COLUMNS}\n"


def test_a_recorded_motion_names_the_new_column(vsacli, files):
    assert vsacli("export", "s.h5", "--variables", "q,stiffness", "-o", "m.csv").code == 0
    (files / "m.csv").write_text((files / "m.csv").read_text().replace(".q,", ".q_actual,"))
    outcome = vsacli("invdyn", ROBOT, "m.csv")
    assert outcome.code == 2
    assert outcome.err == f"m.csv:1: 3 unknown columns: {RENAMED_COLUMNS}\n"


def test_a_simulation_of_an_older_format_is_refused(vsacli, files):
    with h5py.File(files / "s.h5", "r+") as file:
        file.attrs["format"] = "vsacli-simulation/1"
    outcome = vsacli("info", "s.h5")
    assert outcome.code == 2
    assert "has the format vsacli-simulation/1, but this version reads vsacli-simulation/2" in outcome.err
    assert "run simulate again" in outcome.err


def test_the_command_has_a_name_of_its_own(files):
    """Plain names are simulated, `_ref` is the trajectory, `tau_motor_cmd` the controller's torque."""
    robot = load_robot(ROBOT)
    plan = inverse_dynamics(robot, load_trajectory(files / "move.yaml", robot))
    with h5py.File(files / "s.h5") as file:
        for name in ("q", "dq", "ddq", "stiffness", "dstiffness"):
            planned = getattr(plan, name)  # the reference is a table of polynomials, with rounding
            largest = np.abs(planned).max()
            np.testing.assert_allclose(file[f"{name}_ref"], planned, rtol=0, atol=1e-9 * largest)
        for name in ("q", "dq", "stiffness", "dstiffness"):
            np.testing.assert_array_equal(file[name][...] - file[f"{name}_ref"][...], file[f"{name}_error"])
        assert not np.array_equal(file["q"], file["q_ref"])
        np.testing.assert_array_equal(file["tau_motor"], file["tau_motor_cmd"])  # no motor is too weak
    changed = [each.new for each in RENAMINGS if each.place == "simulations: the command"]
    assert changed == [
        *(f"{name}_ref" for name in ("q", "dq", "ddq", "stiffness", "dstiffness")),
        "tau_motor_cmd",
    ]
