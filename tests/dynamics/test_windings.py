"""Currents, voltages and heat of motors: by hand, with their limits, from the robot file to every command."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from samples.marks import needs
from samples.shipped import shipped_run
from scipy.integrate import trapezoid

from vsacli import Flag, InputError, Motor, Robot, inverse_dynamics, load_robot, open_result, simulate
from vsacli.actuators.reach import LIMIT_ROUNDING
from vsacli.base.outputs import Outputs
from vsacli.results.store.writer import ResultWriter

SHAFT = {"gear_ratio": -20.0, "side": "shaft", "torque_constant": 0.2, "resistance": 1.5}


def with_windings(robot: Robot, **limits: float) -> Robot:
    """The base of the 3R arm on the shaft of its motors, which turn against it."""
    motor = robot.joints[0].actuator.motor[0]
    shaft = {"inertia": motor.inertia / 400, "damping": motor.damping / 400, **SHAFT, **limits}
    return robot.replace("joints.base.actuator.motor", shaft)


def test_they_follow_from_torque_and_velocity_on_the_shaft():
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    assert inverse_dynamics(robot, trajectory).current is None
    result = inverse_dynamics(with_windings(robot), trajectory)
    torque, velocity = result.tau_motor[:, 0] / -20, result.dtheta[:, 0] * -20
    np.testing.assert_allclose(result.current[:, 0], torque / 0.2, rtol=1e-13)
    volts = 1.5 * torque / 0.2 + 0.2 * velocity
    np.testing.assert_allclose(result.voltage[:, 0], volts, rtol=0, atol=1e-12 * np.abs(volts).max())
    np.testing.assert_allclose(result.copper_loss[:, 0], 1.5 * (torque / 0.2) ** 2, rtol=1e-13)
    power = result.current[:, 0] * result.voltage[:, 0]  # what flows in is heat and mechanical power
    np.testing.assert_allclose(power, result.copper_loss[:, 0] + result.motor_power[:, 0], rtol=0, atol=1e-9)
    for name in ("current", "voltage", "copper_loss"):
        assert np.isnan(getattr(result, name)[:, 1:]).all()
    base, *others = result.report.joints
    heat = trapezoid(result.copper_loss[:, 0], result.time, axis=0).sum()
    assert base.energy.copper_loss == pytest.approx(heat, rel=1e-12)
    assert [joint.energy.copper_loss for joint in others] == [None, None]
    assert "copper_loss" not in others[0].energy.as_json()
    assert f"losses: motor windings {heat:.0f} J" in str(result.report)


@pytest.mark.parametrize("engine", ["numpy", "c"])
def test_limits_are_flagged_where_they_are_exceeded(engine):
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    result = inverse_dynamics(with_windings(robot, max_current=20, max_voltage=31), trajectory, engine=engine)
    for name, bound, flag in (("current", 20, Flag.CURRENT_LIMIT), ("voltage", 31, Flag.VOLTAGE_LIMIT)):
        beyond = (np.abs(getattr(result, name)[:, 0]) > bound * (1 + LIMIT_ROUNDING)).any(axis=1)
        assert beyond.any()
        np.testing.assert_array_equal((result.flags[:, 0] & flag) != 0, beyond)
    assert not (result.flags[:, 1:] & (Flag.CURRENT_LIMIT | Flag.VOLTAGE_LIMIT)).any()
    report = result.report
    assert (report.verdict, set(report.joints[0].worst)) == ("over_limit", {"current_limit", "voltage_limit"})
    worst = np.abs(result.current[:, 0]).max()
    assert abs(report.joints[0].worst["current_limit"].value) == worst
    assert "base: current of motor " in str(report)
    assert f" {worst:.4g} A at t = " in str(report).replace(" -", " ")


@pytest.mark.slow
def test_limits_are_flagged_in_simulations():
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    past = simulate(with_windings(robot, max_current=20), trajectory).history
    flagged = (past.flags[:, 0] & Flag.CURRENT_LIMIT) != 0
    np.testing.assert_array_equal(flagged, (np.abs(past.current[:, 0]) > 20).any(axis=1))
    assert flagged.any()


REFUSED = {
    "torque_constant": ({"torque_constant": 0.2}, r"needs gear_ratio \(1 for a direct drive\)"),
    "resistance": ({"resistance": 1.0, "gear_ratio": 2.0, "side": "shaft"}, "needs torque_constant"),
    "max_current": (
        {"max_current": 1.0, "gear_ratio": 2.0, "side": "shaft"},
        "needs torque_constant, without which",
    ),
    "max_voltage": (
        {"max_voltage": 1.0, "gear_ratio": 2.0, "side": "shaft"},
        "needs torque_constant and resistance, without which the voltage",
    ),
}


@pytest.mark.parametrize(("fields", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_missing_is_named(fields, reason):
    with pytest.raises(InputError, match=reason):
        Motor(inertia=1.0, **fields)


def test_a_direct_drive_has_the_ratio_one():
    motor = Motor(inertia=1.0, gear_ratio=1.0, torque_constant=2.0).at_joint
    assert (motor.torque_constant, motor.resistance, motor.max_current) == (2.0, None, None)


ROBOT = """format: vsacli-robot/1
name: pendulum
joints:
  - name: axis
    type: revolute
    dh: {a: 0.5, alpha: 0}
    link: {mass: 2, com: [-0.2, 0, 0], inertia: {xx: 0.01, yy: 0.02, zz: 0.02}}
    friction: {coulomb: 0.3, width: 0.05}
    actuator:
      type: elastic
      stiffness: 300
      motor:
        inertia: 2e-4
        gear_ratio: -50
        side: shaft
        friction: {coulomb: [0.02, 0.03]}
        torque_constant: 0.05
        resistance: 0.8
        max_current: 3
        max_voltage: 24
"""
TRAJECTORY = """format: vsacli-trajectory/1
name: swing
duration: 1.0
rate: 500
position: {type: polynomial, degree: 9, start: 0, end: 1.2}
"""


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "vsacli", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    (tmp_path / "swing.yaml").write_text(TRAJECTORY, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_from_the_file_to_result_figures_and_columns(files):
    found = run("invdyn", "robot.yaml", "swing.yaml", "-o", "r.h5", "--plot", ".", cwd=files)
    assert found.returncode in (0, 3), found.stderr
    assert {"r-motor-current.png", "r-motor-voltage.png"} <= {path.name for path in files.iterdir()}
    with open_result(files / "r.h5") as result:
        size = np.abs(result.current[:, 0, 0]).max()
        assert 0 < size < math.inf
        assert result.gear_ratio[0, 0] == -50
        assert result.motor_constant("torque_constant")[0, 0] == -2.5
    exported = run("export", "r.h5", "--variables", "current,dissipated_power", cwd=files)
    assert exported.stdout.splitlines()[0] == "time,axis.dissipated_power,axis.current_1"
    refused = run("invdyn", "robot.yaml", "swing.yaml", "--variables", "damping", cwd=files)
    assert refused.returncode == 2


def test_files_name_line_and_fix(files):
    text = ROBOT.replace("        gear_ratio: -50\n        side: shaft\n", "")
    (files / "robot.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"robot.yaml:15: motor: torque_constant: needs gear_ratio \(1 for"):
        load_robot(files / "robot.yaml")


@pytest.mark.slow
@needs("cc", "gcc")
def test_the_generated_code_tests_itself(files):
    made = run("codegen", "robot.yaml", "-o", "code", cwd=files)
    assert made.returncode == 0, made.stderr
    tested = subprocess.run(["make", "test"], cwd=files / "code", capture_output=True, text=True, check=False)
    assert "all values agree" in tested.stdout, tested.stdout + tested.stderr


def test_without_them_the_variables_are_named_as_missing(tmp_path):
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    with (
        Outputs() as outputs,
        pytest.raises(InputError, match="no current: no joint of vsa-3r has a motor with a torque_c"),
    ):
        ResultWriter(outputs.file(tmp_path / "r.h5"), robot, trajectory, ["current"])
