"""A mechanism that only `samples.own_mechanism` knows, through the whole command line."""

from __future__ import annotations

import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
from samples.marks import needs, needs_compiler, slow
from samples.own_mechanism import AdjustableArm
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from vsacli import load_robot, mechanisms

TRAJECTORY = """
format: vsacli-trajectory/1
name: move
duration: 1.0
rate: 500
position: {type: polynomial, degree: 9, start: 0, end: 0.6}
stiffness: {type: polynomial, degree: 7, start: 500, end: 900}
"""


@pytest.fixture
def arm(vsacli, tmp_path, monkeypatch):
    """The command line once it is registered, with a robot of one such joint that it has written."""
    monkeypatch.setitem(mechanisms.MECHANISMS.homes, "adjustable_arm", "samples.own_mechanism:AdjustableArm")
    monkeypatch.delitem(sys.modules, "vsacli.cli.new", raising=False)  # offers what is known at its import
    (tmp_path / "move.yaml").write_text(TRAJECTORY)
    made = vsacli("new", "robot", "--joints", "R", "--actuator", "adjustable_arm", "-o", "arm.yaml")
    assert made.code == 0, made.err
    yield vsacli
    sys.modules.pop("vsacli.cli.new", None)


def ok(outcome):
    assert outcome.code == 0, outcome.out + outcome.err
    return outcome


def test_a_robot_file_has_it_and_describes_it(arm):
    robot = load_robot("arm.yaml")
    assert isinstance(robot.joints[0].actuator.mechanism, AdjustableArm)
    assert "adjustable_arm" in ok(arm("schema", "robot")).out
    described = json.loads(ok(arm("info", "arm.yaml", "--json")).out)["joints"][0]
    assert described["stiffness_range"]["unloaded"] == [80, 8000]


@pytest.mark.parametrize(
    "engine",
    [
        "numpy",
        pytest.param("c", marks=(needs_compiler, pytest.mark.slow)),
    ],
)
def test_its_torques_move_a_model_made_from_the_potential_alone(arm, tmp_path, engine):
    still = ("--set", "gravity=[0, 0, 0]")  # the model has none
    ok(arm("invdyn", "arm.yaml", "move.yaml", *still, "-o", "move.h5", "--engine", engine))
    with h5py.File(tmp_path / "move.h5") as result:
        time, q, theta, dtheta, torque, stiffness, phi, flags = (
            np.asarray(result[name])
            for name in ("time", "q", "theta", "dtheta", "tau_motor", "stiffness", "phi", "flags")
        )
    assert not flags.any()
    assert np.isnan(phi[:, 0, 1]).all()
    followed = full_model(time, torque[:, 0], np.array([q[0, 0], *theta[0, 0], 0, *dtheta[0, 0]]))
    # the spline through 501 torques (h^6 of what changes within 0.1 s) and the tolerance of the integration
    np.testing.assert_allclose(followed[0], q[:, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(80 * followed[2] ** 2, stiffness[:, 0], rtol=1e-8)


def potential(x):
    """Of q, theta_1, theta_2."""
    return 80 * (x[2] * (x[1] - x[0])) ** 2 / 2


def full_model(time, torque, start):
    """q, theta_1, theta_2 over time: a link of the template's about a vertical axis, two rotors, and U."""
    inertia = np.array([0.015 + 2 * 0.15**2, 0.5, 0.5])
    damping = np.array([0.1, 0.01, 0.01])
    drive = make_interp_spline(time, torque, k=5)

    def rates(t, y):
        gradient = [potential(y[:3] + 1e-30j * unit).imag / 1e-30 for unit in np.eye(3)]
        return [*y[3:], *(([0, *drive(t)] - damping * y[3:] - gradient) / inertia)]

    return solve_ivp(rates, time[[0, -1]], start, "DOP853", time, rtol=1e-12, atol=1e-13).y


@pytest.mark.parametrize("controller", ["feedforward", slow("feedback-linearization")])
def test_a_simulation_follows_the_command(arm, controller):
    report = json.loads(
        ok(arm("simulate", "arm.yaml", "move.yaml", "--controller", controller, "-o", "sim.h5", "--json")).out
    )
    joint = report["joints"][0]
    assert report["verdict"] == "ok"
    assert joint["q_error"]["peak"] < 1e-7  # the tolerance of the integration, 1e-9 a step
    assert joint["stiffness_error"]["peak"] < 1e-4
    assert joint["energy"]["co_contraction"] is None


@pytest.mark.slow
def test_an_initial_error_of_position_and_stiffness_dies_out(arm):
    options = (
        "--initial-error",
        0.02,
        "--initial-stiffness-error",
        20,
        "--controller",
        "feedback-linearization",
    )
    report = json.loads(ok(arm("simulate", "arm.yaml", "move.yaml", *options, "-o", "s.h5", "--json")).out)
    joint = report["joints"][0]
    assert joint["q_error"]["peak"] == pytest.approx(0.02, rel=1e-9)
    assert (
        abs(joint["q_error"]["final"]) < 1e-4
    )  # the poles are at -20: 0.02 (1 + 20 + 20^2/2 + 20^3/6) exp(-20) = 6e-8
    assert abs(joint["stiffness_error"]["final"]) < 1e-4


def test_feasibility_names_the_corridor(arm, tmp_path):
    ok(arm("check-feasibility", "arm.yaml", "move.yaml"))
    (tmp_path / "soft.yaml").write_text(TRAJECTORY.replace("start: 500", "start: 60"))
    refused = arm("check-feasibility", "arm.yaml", "soft.yaml")
    assert refused.code == 3
    assert "below the minimum of 80" in refused.out


@pytest.mark.slow
def test_figures_are_drawn(arm):
    ok(arm("invdyn", "arm.yaml", "move.yaml", "-o", "move.h5"))
    ok(arm("plot", "move.h5", "-o", "figures"))


@needs_compiler
@needs("make", "make")
def test_generated_code_agrees_with_numpy(arm, tmp_path):
    ok(arm("codegen", "arm.yaml", "-o", "code"))
    assert "feedback_linearization" in next((tmp_path / "code").glob("*.h")).read_text()
    done = subprocess.run(
        ["make", "test"], cwd=tmp_path / "code", capture_output=True, text=True, check=False
    )
    assert "all values agree" in done.stdout, done.stdout + done.stderr


def test_an_attribute_of_an_earlier_name_is_refused():
    attributes = {"__module__": "mine", "other_preload": lambda self: self}
    with pytest.raises(TypeError, match=r"^Old.other_preload has no effect; it is now 'other_branch'$"):
        type("Old", (AdjustableArm,), attributes)
