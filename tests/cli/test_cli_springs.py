"""Springs of elastic joints and springs between motors, through the whole command line."""

from __future__ import annotations

import json
import subprocess

import h5py
import numpy as np
import pytest
from samples.marks import needs, needs_compiler, slow

ROBOT = """
format: vsacli-robot/1
name: elbow
gravity: [0, -9.81, 0]
joints:
  - name: elbow
    type: revolute
    dh: {a: 0.25, alpha: 0, d: 0, theta: 0}
    link: {mass: 0.8, com: [-0.12, 0, 0], inertia: {xx: 5e-4, yy: 4.5e-3, zz: 4.5e-3}}
    damping: 0.01
    actuator:
      motor: {inertia: 0.05, damping: 0.02}
"""
MOVE = """
format: vsacli-trajectory/1
name: move
duration: 1.5
rate: 200
position: {type: polynomial, degree: 9, start: -45 deg, end: 60 deg}
"""
ACTUATORS = {
    "tendon": "type: elastic\n      spring: {type: exponential, c: 1.5, a: 6}",
    "coupled": "type: antagonistic\n      spring: {type: cubic, k: 20, k_c: 300}\n"
    "      coupling: {type: sinh, k: 1, a: 4}",
}
STIFFNESS = {"tendon": "", "coupled": "stiffness: {type: sinusoids, frequency: 2, offset: 60, sine: [8]}\n"}


@pytest.fixture(params=ACTUATORS)
def joint(request, vsacli, tmp_path):
    """The command line beside a robot with one such joint and a trajectory for it; and what is special."""
    (tmp_path / "elbow.yaml").write_text(ROBOT + "      " + ACTUATORS[request.param] + "\n")
    (tmp_path / "move.yaml").write_text(MOVE + STIFFNESS[request.param])
    return vsacli, request.param


def ok(outcome):
    assert outcome.code == 0, outcome.out + outcome.err
    return outcome.out


def test_files_are_checked_and_described(joint):
    vsacli, kind = joint
    ok(vsacli("validate", "elbow.yaml"))
    [described] = json.loads(ok(vsacli("info", "elbow.yaml", "--json")))["joints"]
    shown = {"tendon": "exponential", "coupled": "cubic (coupling sinh)"}
    assert shown[kind] in ok(vsacli("info", "elbow.yaml"))
    if kind == "tendon":
        assert described["stiffness_range"]["unloaded"] == [9, 9]
        assert described["stiffness_range"]["loaded"] == [None, None]  # in one direction it would push


def test_results_hold_what_the_springs_are(joint, tmp_path):
    vsacli, kind = joint
    report = json.loads(ok(vsacli("invdyn", "elbow.yaml", "move.yaml", "-o", "r.h5", "--json")))
    assert report["self_check"]["passed"]
    assert report["joints"][0]["energy"]["co_contraction"] is None
    with h5py.File(tmp_path / "r.h5") as result:
        joints = result["inputs/robot/joints"]
        path = "spring_type" if kind == "tendon" else "coupling_type"
        name = joints[f"actuator_{path}"][0].decode()
        assert name == {"tendon": "exponential", "coupled": "sinh"}[kind]
        assert np.isfinite(result["stiffness"]).all()
    integrated = vsacli("invdyn", "elbow.yaml", "move.yaml", "--deflection-solver", "ode", "-o", "i.h5")
    assert "self-check passed" in ok(integrated)


@pytest.mark.cases(1)
@pytest.mark.slow
def test_results_are_drawn_and_computed_again(joint):
    vsacli, _ = joint
    ok(vsacli("invdyn", "elbow.yaml", "move.yaml", "-o", "r.h5"))
    ok(vsacli("plot", "r.h5", "-o", "figures"))
    ok(vsacli("validate", "--recompute", "r.h5"))


@pytest.mark.parametrize(
    ("options", "final"),
    [
        (("feedforward",), 1e-8),  # the tolerance of the integration, 1e-9 a step
        slow(("feedback-linearization", "--initial-error", 0.02), 1e-8),  # 0.02 (30^3/6) exp(-30)
        slow(("feedback-linearization", "--perturb", 0.01, "--goal-tolerance", 1), 0.1),
    ],
)
def test_simulations_follow(joint, options, final):
    vsacli, _ = joint
    out = ok(vsacli("simulate", "elbow.yaml", "move.yaml", "--controller", *options, "-o", "s.h5", "--json"))
    assert abs(json.loads(out)["joints"][0]["q_error"]["final"]) < final


@needs_compiler
@needs("make", "make")
def test_generated_code_agrees(joint, tmp_path):
    vsacli, _ = joint
    ok(vsacli("codegen", "elbow.yaml", "-o", "code"))
    done = subprocess.run(
        ["make", "test"], cwd=tmp_path / "code", capture_output=True, text=True, check=False
    )
    assert "all values agree" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize("joint", ["tendon"], indirect=True)
def test_a_tendon_that_would_push_says_so(joint, tmp_path):
    vsacli, _ = joint
    (tmp_path / "over.yaml").write_text(MOVE.replace("60 deg", "100 deg"))
    refused = vsacli("check-feasibility", "elbow.yaml", "over.yaml", "--fixes")
    assert refused.code == 3
    assert "is below the minimum of 0 N m that its spring carries" in refused.out
    assert "a tendon goes slack at" in refused.out
    assert "branch" not in refused.out
    assert "no stiffness to choose" in refused.out
