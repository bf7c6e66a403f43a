"""Recordings of simulations: measured and simulated columns stand for what the robot did."""

from __future__ import annotations

import json
import shutil

import pytest
from samples.command_line import REPOSITORY, edited

from vsacli.cli.main import run

ROBOT = REPOSITORY / "robots" / "planar_2r.yaml"
OFF = 0.02
"""Position errors that a model with wrong parameters leaves at least, rad."""


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """A folder with a plan, `plan.h5`, and a simulation that does not follow it, `lab.h5`; kept unchanged."""
    folder = tmp_path_factory.mktemp("computed")
    move = edited(
        REPOSITORY / "trajectories" / "planar_2r.yaml", folder / "move.yaml", ("rate: 1000", "rate: 250")
    )
    assert run(["invdyn", str(ROBOT), str(move), "-q", "-o", str(folder / "plan.h5")]) == 0
    options = ["--controller", "feedback-linearization", "--perturb", "0.3", "--sensor-noise", "1e-4,0.5"]
    assert run(["simulate", str(ROBOT), str(move), *options, "-q", "-o", str(folder / "lab.h5")]) == 3
    return folder


@pytest.fixture
def simulated(vsacli, own_folder, computed):
    """The command line, in a folder with copies of them."""
    shutil.copytree(computed, own_folder, dirs_exist_ok=True)
    return vsacli


def compared(vsacli, result, recording):
    report = json.loads(vsacli("compare", result, recording, "--time-offset", "0", "--json").out)
    return {signal["column"]: signal for signal in report["signals"]}, report["notes"]


@pytest.mark.slow
def test_a_default_export_is_compared_with_its_plan(simulated):
    assert simulated("export", "lab.h5", "-o", "m.csv").code == 0
    signals, _ = compared(simulated, "plan.h5", "m.csv")
    assert {column.partition(".")[2].rstrip("_12"): each["variable"] for column, each in signals.items()} == {
        "q": "q",
        "stiffness": "stiffness",
        "tau_motor": "tau_motor",
    }
    assert signals["shoulder.q"]["rms"] > OFF


@pytest.mark.slow
@pytest.mark.parametrize("result", ["plan.h5", "lab.h5"])
def test_what_sensors_read_goes_before_the_simulated_value_and_the_command(simulated, result):
    names = "q,q_ref,q_measured,tau_motor_cmd"
    assert simulated("export", "lab.h5", "--variables", names, "-o", "m.csv").code == 0
    signals, notes = compared(simulated, result, "m.csv")
    assert {column: each["variable"] for column, each in signals.items()} == {
        "shoulder.q_measured": "q",
        "elbow.q_measured": "q",
    }
    torques = ", ".join(
        f"{joint}.tau_motor_cmd_{motor}" for joint in ("shoulder", "elbow") for motor in (1, 2)
    )
    commands = f"shoulder.q_ref, elbow.q_ref, {torques}"
    assert notes[-2:] == [
        "not compared, as other columns say what the robot did: shoulder.q, elbow.q",
        f"not compared, as these are commands, not what the robot did: {commands}",
    ]


@pytest.mark.slow
def test_commands_alone_are_nothing_to_compare(simulated):
    assert simulated("export", "lab.h5", "--variables", "q_ref", "-o", "m.csv").code == 0
    outcome = simulated("compare", "plan.h5", "m.csv")
    assert outcome.code == 2
    assert (
        "expected columns such as time, shoulder.q, shoulder.tau_motor_1; if they have other names"
        in outcome.err
    )


@pytest.mark.slow
def test_a_simulation_says_what_happened_not_what_was_commanded(simulated):
    """A recorded q of the plan is off by as much as the simulated arm was, and that of the arm is not."""
    for file in ("plan", "lab"):
        assert simulated("export", f"{file}.h5", "--variables", "q", "-o", f"{file}.csv").code == 0
    plan, _ = compared(simulated, "lab.h5", "plan.csv")
    arm, _ = compared(simulated, "lab.h5", "lab.csv")
    assert plan["shoulder.q"]["variable"] == arm["shoulder.q"]["variable"] == "q"
    assert plan["shoulder.q"]["rms"] > OFF
    assert arm["shoulder.q"]["rms"] < 1e-12  # numbers are printed with all digits


@pytest.mark.slow
def test_the_report_names_the_variable(simulated):
    assert simulated("export", "lab.h5", "--variables", "q_measured", "-o", "m.csv").code == 0
    lines = simulated("compare", "plan.h5", "m.csv").out.splitlines()
    header, _, first, *_ = lines[lines.index("") + 1 :]
    assert header.split()[:3] == ["measured", "compared", "with"]
    assert first.split()[:2] == ["shoulder.q_measured", "q"]
