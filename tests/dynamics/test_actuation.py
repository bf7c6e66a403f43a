"""Motor motion and motor torques of whole robots, against a scalar re-computation joint by joint."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from oracles.scalar_vsa import Actuation, Curve, Side, actuation
from samples.marks import needs_compiler, slow_but
from samples.shipped import shipped_run

from vsacli import (
    Antagonistic,
    Inertia,
    Joint,
    Link,
    Motor,
    Pose,
    Result,
    Robot,
    Trajectory,
    inverse_dynamics,
    laws,
)

ROOT = Path(__file__).parents[2]
SAMPLES = 300
COMPARED = {
    "phi": "phi",
    "dphi": "dphi",
    "theta": "theta",
    "dtheta": "dtheta",
    "ddtheta": "ddtheta",
    "tau_transmission": "tau_transmission",
    "tau_motor": "tau_motor",
    "det_A": "det_a",
}
"""Names of the variables in the result and in the re-computation."""

GIVEN = ("q", "dq", "ddq", "stiffness", "dstiffness", "ddstiffness", "tau_e", "dtau_e", "ddtau_e")
"""What of the result the re-computation starts from."""

AGREEMENT = 1e-9
"""Of a variable's peak: what is asked for. The margins stay above 1 %, where eps/margin is 2e-14."""


def unlike(branches: tuple[str, ...]) -> tuple[Robot, Trajectory]:
    """The 3R arm with springs and motors that differ between the sides, more from joint to joint."""
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    actuators = [
        Antagonistic(
            motor=(Motor(inertia=3.2, damping=0.1), Motor(inertia=2.5 - 0.5 * index, damping=0.3)),
            spring=(laws.Cubic(k=400, k_c=2000), laws.Cubic(k=420 - 60 * index, k_c=2500 + 4000 * index)),
            branch=branch,
        )
        for index, branch in enumerate(branches)
    ]
    joints = tuple(
        dataclasses.replace(joint, actuator=actuator)
        for joint, actuator in zip(robot.joints, actuators, strict=True)
    )
    return dataclasses.replace(robot, joints=joints), trajectory


CASES = {
    "3R": lambda: shipped_run("vsa_3r", "rest_to_rest"),
    "3R soft": lambda: shipped_run("vsa_3r", "rest_to_rest_soft"),
    "7R": lambda: shipped_run("lwr_7r_vsa", "lwr_7r"),
    "R-P": lambda: shipped_run("rp_2", "rp_2"),
    "sides differ": lambda: unlike(("positive", "positive", "positive")),
    "branch negative": lambda: unlike(("negative", "positive", "negative")),
}


def sides_of(joint: Joint) -> tuple[Side, Side]:
    """The constants of both sides as the robot file gives them."""
    first, second = (
        Side(spring.k, spring.k_c, motor.inertia, motor.damping)
        for spring, motor in zip(joint.actuator.spring, joint.actuator.motor, strict=True)
        if isinstance(spring, laws.Cubic)
    )
    return first, second


def recomputed(joint: Joint, result: Result, index: int, steps: np.ndarray) -> Iterator[Actuation]:
    """One sample after the other, from the motion, the stiffness and the link torque."""
    branch = 1 if joint.actuator.branch == "positive" else -1
    for step in steps:
        of_step = {name: float(getattr(result, name)[step, index]) for name in GIVEN}
        yield actuation(
            Curve(sides_of(joint), of_step["tau_e"], branch),
            (of_step["q"], of_step["dq"], of_step["ddq"]),
            (of_step["stiffness"], of_step["dstiffness"], of_step["ddstiffness"]),
            (of_step["dtau_e"], of_step["ddtau_e"]),
        )


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", slow_but({"3R", "R-P"}, CASES))
def test_motors_do_what_a_scalar_recomputation_says(case: str):
    robot, trajectory = CASES[case]()
    result = inverse_dynamics(robot, trajectory)
    assert result.report.verdict == "ok"
    steps = np.unique(np.linspace(0, len(result.time) - 1, SAMPLES).astype(int))
    for index, joint in enumerate(robot.joints):
        expected = list(recomputed(joint, result, index, steps))
        for name, oracle_name in COMPARED.items():
            values = np.array([getattr(sample, oracle_name) for sample in expected])
            peak = np.abs(getattr(result, name)[:, index]).max()
            np.testing.assert_allclose(
                getattr(result, name)[steps, index], values, rtol=0, atol=AGREEMENT * peak, err_msg=name
            )
        lower = [sample.lower for sample in expected]
        np.testing.assert_allclose(result.stiffness_min[steps, index], lower, rtol=AGREEMENT)


def test_branch_selects_the_side_that_is_stretched():
    result = inverse_dynamics(*CASES["branch negative"]())
    wider = result.phi[:, :, 0] - result.phi[:, :, 1]
    assert np.all(wider[:, 1] > 0)
    assert np.all(wider[:, [0, 2]] < 0)


def test_opposite_branch_of_alike_sides_swaps_the_motors():
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    joints = tuple(
        dataclasses.replace(joint, actuator=dataclasses.replace(joint.actuator, branch="negative"))
        for joint in robot.joints
    )
    result = inverse_dynamics(robot, trajectory)
    turned = inverse_dynamics(dataclasses.replace(robot, joints=joints), trajectory)
    for name in ("phi", "theta", "tau_transmission", "tau_motor"):
        # The determinant changes its sign, nothing else.
        np.testing.assert_array_equal(getattr(turned, name), getattr(result, name)[:, :, ::-1])
    np.testing.assert_array_equal(turned.det_A, -result.det_A)


def test_torques_of_springs_and_motors_add_up():
    """The motors' dynamics (6) summed over both sides, from the result's own variables."""
    robot, trajectory = CASES["sides differ"]()
    result = inverse_dynamics(robot, trajectory)
    inertia = np.array([[motor.inertia for motor in joint.actuator.motor] for joint in robot.joints])
    damping = np.array([[motor.damping for motor in joint.actuator.motor] for joint in robot.joints])
    motors = result.tau_motor - inertia * result.ddtheta - damping * result.dtheta
    peak = np.abs(result.tau_motor).max()
    # A few roundings of the largest term.
    np.testing.assert_allclose(motors.sum(axis=2), result.tau_e, rtol=0, atol=1e-13 * peak)


@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["numpy", pytest.param("c", marks=needs_compiler)])
@pytest.mark.parametrize("shipped", [("measured_1r", "measured_1r"), ("qbmove_arm_manual", "qbmove_arm")])
def test_a_link_without_mass_asks_for_no_torque(shipped: tuple[str, str], engine: str) -> None:
    """Its elastic torque is zero at all steps, whatever the motion: the springs then only hold each other."""
    robot, trajectory = shipped_run(*shipped)
    last = robot.joints[-1]
    bare = dataclasses.replace(
        last, link=Link(mass=0, com=(0, 0, 0), inertia=Inertia(xx=0, yy=0, zz=0)), damping=0
    )
    light = dataclasses.replace(robot, joints=(*robot.joints[:-1], bare), tool=Pose())
    result = inverse_dynamics(light, trajectory, engine=engine)
    tau_1, tau_2 = result.tau_transmission[:, -1].T
    assert not result.tau_e[:, -1].any()
    assert np.all(tau_1 > 0)
    np.testing.assert_allclose(tau_1, -tau_2, rtol=1e-9)  # eps over the margin, as for all deflections
