"""Generated functions that take a wrench, against what the tool computes under it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.codegen import CLOSE, commands, motion_of
from samples.generated_code import compiled_robot
from samples.marks import needs_compiler
from samples.plants import random_state
from samples.robots import random_robot
from samples.shipped import shipped_robot

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import POSITION
from vsacli.base.wrench import WRENCH_FRAMES, WRENCH_NAMES, Wrench
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.project import generate
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.gains import Gains, Integral
from vsacli.control.linearization import FeedbackLinearization
from vsacli.dynamics.elastic_torques import TORQUES, link_torques
from vsacli.dynamics.inverse import compute_block
from vsacli.trajectory.motion import Motion

pytestmark = needs_compiler

SAMPLES = 40


def drawn_wrench(frame: str) -> Wrench:
    rng = np.random.default_rng(3)
    return Wrench(*(rng.uniform(-5, 5, (SAMPLES, 6)) for _ in WRENCH_NAMES), frame=frame)


def arrays_of(wrench: Wrench) -> dict[str, FloatArray]:
    return {name: getattr(wrench, name) for name in WRENCH_NAMES}


def assert_close(found: FloatArray, expected: FloatArray, share: float = CLOSE) -> None:
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    there = np.isfinite(expected)
    np.testing.assert_allclose(
        found[there], expected[there], rtol=0, atol=share * np.abs(expected[there]).max(initial=0)
    )


@pytest.mark.parametrize("frame", WRENCH_FRAMES)
def test_link_torques_under_a_wrench(frame: str, tmp_path: Path) -> None:
    robot, wrench = random_robot("RPR", seed=3), drawn_wrench(frame)
    motion = {name: commands(robot, SAMPLES, seed=1)[name] for name in POSITION.names}
    function = link_torques_function(robot, frame)
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "double")(
        function, motion, arrays_of(wrench)
    )
    for name, expected in zip(TORQUES, link_torques(robot, **motion, wrench=wrench), strict=True):
        assert_close(found[name], expected)


def test_inverse_dynamics_under_a_wrench(tmp_path: Path) -> None:
    robot, wrench = shipped_robot("vsa_3r"), drawn_wrench("base")
    command = {**commands(robot, SAMPLES, seed=2), "stiffness": np.full((SAMPLES, 3), 1200.0)}
    motion = motion_of(command)
    block = compute_block(robot, Motion.of(motion.time, motion.of_joints, wrench))
    function = inverse_dynamics_function(robot, "base")
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "double")(
        function, command, arrays_of(wrench)
    )
    np.testing.assert_array_equal(found["flags"], block.flags)
    assert np.isfinite(block.tau_motor).all(axis=(1, 2)).any()
    for name in ("tau_e", "theta", "tau_motor"):
        assert_close(found[name], getattr(block, name))


def test_feedback_linearization_under_a_wrench(tmp_path: Path) -> None:
    robot, wrench = shipped_robot("rp_2"), drawn_wrench("end_effector")
    state, command = random_state(robot, SAMPLES, seed=5), commands(robot, SAMPLES, seed=7)
    gains = Gains.from_poles((-20.0, -21.0, -22.0, -23.0, -24.0), (-25.0, -26.0, -27.0))
    integral = Integral(*np.zeros((2, SAMPLES, 2)))
    function = feedback_linearization_function(robot, "end_effector")
    of_gains = {
        name: np.broadcast_to(values, (SAMPLES, 2, *values.shape[1:]))
        for name, values in vars(gains).items()
        if name != "sources"
    }
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "double")(
        function, vars(state), command, of_gains, integral._asdict(), arrays_of(wrench)
    )
    law = FeedbackLinearization(robot, gains, "end_effector")
    motion = motion_of(command)
    expected = law(state, Motion.of(motion.time, motion.of_joints, wrench), integral)
    assert_close(found["tau_motor"], expected, share=1e-11)  # another factorization of M


def test_a_project_under_a_wrench_says_so() -> None:
    files = generate(shipped_robot("rp_2"), wrench="base").files
    header = " ".join(files["rp_2.h"].split())
    assert "the argument wrench acts on the end effector" in header
    assert "along the axes of the base frame" in header
    assert "rp_2_inverse_dynamics(command, wrench, &drive)" in files["README.md"]
