"""A joint of each mechanism through the whole command line: files in, files out."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import jsonschema
import numpy as np
import pytest
import yaml
from samples.command_line import Outcome
from samples.driven_arm import LINK, robot_of
from samples.marks import needs, needs_compiler, slow, slow_but
from samples.mechanisms import DEVICES, Device
from samples.robot_files import write_robot

from vsacli import mechanisms

TRAJECTORY = """
format: vsacli-trajectory/1
name: move
duration: 0.5
rate: 400
position: {{type: polynomial, degree: 11, start: -1.2, end: -0.4}}
stiffness: {{type: polynomial, degree: 7, start: {}, end: {}}}
"""

QUICK = ("awas",)
"""Mechanisms whose commands are run by the quick tests; all others take the same way."""

FEEDBACK = ("--controller", "feedback-linearization")

Run = Callable[..., Outcome]


@pytest.fixture(params=slow_but(QUICK, mechanisms.MECHANISMS))
def device(request: pytest.FixtureRequest, tmp_path: Path) -> Device:
    """A device, with `arm.yaml` and `move.yaml` in the folder."""
    device = DEVICES[request.param]
    write_robot(robot_of(LINK, [device.actuator]), tmp_path / "arm.yaml")
    (tmp_path / "move.yaml").write_text(TRAJECTORY.format(*device.stiffness))
    return device


def ok(outcome: Outcome) -> Any:
    assert outcome.code == 0, outcome.out + outcome.err
    return json.loads(outcome.out) if outcome.out.startswith("{") else outcome.out


def variables(path: Path) -> dict[str, Any]:
    with h5py.File(path) as result:
        return {name: np.asarray(each) for name, each in result.items() if isinstance(each, h5py.Dataset)}


@pytest.mark.cases(3)
def test_the_file_is_what_the_schema_says_and_is_described(
    device: Device, vsacli: Run, tmp_path: Path
) -> None:
    assert "vsacli validate" not in ok(vsacli("validate", "arm.yaml", "move.yaml"))
    schema = ok(vsacli("schema", "robot"))
    jsonschema.Draft202012Validator(schema).validate(yaml.safe_load((tmp_path / "arm.yaml").read_text()))
    described = ok(vsacli("info", "arm.yaml", "--json"))["joints"][0]
    assert described["actuator"]["mechanism"]["type"] == mechanisms.MECHANISMS.name_of(type(device.mechanism))
    lower, upper = described["stiffness_range"]["unloaded"]
    assert lower < min(device.stiffness) < max(device.stiffness) < (upper or np.inf)


@pytest.mark.cases(2)
@needs_compiler
@pytest.mark.usefixtures("device")
def test_results_of_both_engines_and_of_integrated_deflections(vsacli: Run, tmp_path: Path) -> None:
    for name, options in {
        "numpy": ("--engine", "numpy"),
        "c": ("--engine", "c"),
        "integrated": ("--deflection-solver", "ode"),
    }.items():
        report = ok(vsacli("invdyn", "arm.yaml", "move.yaml", "-o", f"{name}.h5", "--json", *options))
        assert report["self_check"]["passed"]
        energy = report["joints"][0]["energy"]
        assert energy["co_contraction"] is energy["load"] is energy["co_contraction_share"] is None
    plain, compiled, integrated = (
        variables(tmp_path / f"{name}.h5") for name in ("numpy", "c", "integrated")
    )
    assert np.isnan(plain["phi"][:, 0, 1]).all()
    for name, values in plain.items():
        if np.issubdtype(values.dtype, np.floating):
            largest = np.abs(values[np.isfinite(values)]).max(initial=0)
            np.testing.assert_allclose(compiled[name], values, rtol=0, atol=1e-12 * largest, err_msg=name)
            # the drift of the integration, 1e-11 of the deflection, and what that does to torques
            np.testing.assert_allclose(integrated[name], values, rtol=0, atol=1e-7 * largest, err_msg=name)
    np.testing.assert_array_equal(compiled["flags"], plain["flags"])


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("options", "final"),
    [
        ((), 1e-7),  # the integration errs by 1e-9 a step
        slow((*FEEDBACK, "--initial-error", "0.01", "--poles", "-40"), 1e-5),  # 3e-6 after 20/40 s
        slow((*FEEDBACK, "--perturb", "0.02", "--goal-tolerance", "10%"), 0.08),
    ],
)
@pytest.mark.usefixtures("device")
def test_a_simulation_follows_the_command(vsacli: Run, options: tuple[str, ...], final: float) -> None:
    report = ok(vsacli("simulate", "arm.yaml", "move.yaml", *options, "-o", "sim.h5", "--json"))
    joint = report["joints"][0]
    assert report["verdict"] == "ok"
    assert abs(joint["q_error"]["final"]) < final


@pytest.mark.cases(1)
def test_a_soft_demand_is_told_and_fixed(device: Device, vsacli: Run, tmp_path: Path) -> None:
    unloaded = ok(vsacli("info", "arm.yaml", "--json"))["joints"][0]["stiffness_range"]["unloaded"]
    (tmp_path / "soft.yaml").write_text(TRAJECTORY.format(device.stiffness[0], 0.8 * unloaded[0]))
    refused = vsacli("check-feasibility", "arm.yaml", "soft.yaml", "--fixes", "--json")
    assert refused.code == 3
    report = json.loads(refused.out)
    assert report["joints"][0]["worst"]["infeasible"]
    assert report["fixes"]


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.usefixtures("device")
def test_figures_and_tables(vsacli: Run, tmp_path: Path) -> None:
    ok(vsacli("invdyn", "arm.yaml", "move.yaml", "-o", "move.h5"))
    ok(vsacli("plot", "move.h5", "-o", "figures"))
    assert list((tmp_path / "figures").glob("*.png"))
    head = ok(vsacli("export", "move.h5", "--variables", "phi,theta,tau_motor")).partition("\n")[0]
    assert (
        head == "time,joint_1.phi_1,joint_1.theta_1,joint_1.theta_2,joint_1.tau_motor_1,joint_1.tau_motor_2"
    )


@pytest.mark.cases(2)
@needs_compiler
@needs("make", "make")
@pytest.mark.usefixtures("device")
def test_generated_code_agrees(vsacli: Run, tmp_path: Path) -> None:
    ok(vsacli("codegen", "arm.yaml", "-o", "code"))
    done = subprocess.run(
        ["make", "test"], cwd=tmp_path / "code", capture_output=True, text=True, check=False
    )
    assert "all values agree" in done.stdout, done.stdout + done.stderr
