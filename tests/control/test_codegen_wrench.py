"""Generated functions that take a wrench, against what the tool computes under it."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.codegen import CLOSE, commands, motion_of
from samples.command_line import Outcome
from samples.generated_code import compiled_robot, write_files
from samples.marks import needs_compiler
from samples.plants import random_state
from samples.robots import random_robot
from samples.shipped import shipped_robot
from samples.two_hands import two_hands

from vsacli import (
    FeedbackLinearization,
    Gains,
    InputError,
    Integral,
    Motion,
    Wrench,
    link_torques,
    load_robot,
    motor_torques,
)
from vsacli.base.signals import POSITION
from vsacli.base.wrench import WRENCH_FRAMES, WRENCH_NAMES, WrenchFrame, wrench_components
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.project import generate
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.dynamics.elastic_torques import TORQUES

pytestmark = needs_compiler

SAMPLES = 40


def drawn_wrench(frame: WrenchFrame) -> Wrench:
    rng = np.random.default_rng(3)
    drawn = (rng.uniform(-5, 5, (SAMPLES, wrench_components(frame))) for _ in WRENCH_NAMES)
    return Wrench(*drawn, frame=frame)


def arrays_of(wrench: Wrench) -> dict[str, np.ndarray]:
    return {name: getattr(wrench, name) for name in WRENCH_NAMES}


def assert_close(found: np.ndarray, expected: np.ndarray, share: float = CLOSE) -> None:
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
    block = motor_torques(robot, Motion.of(motion.time, motion.of_joints, wrench))
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


@pytest.mark.slow
def test_functions_under_wrenches_by_tool(tmp_path: Path) -> None:
    frame = ("base", "end_effector")
    robot, wrench = load_robot(two_hands(tmp_path)), drawn_wrench(frame)
    by_tool = {
        f"{name}_{tool}": getattr(wrench, name).reshape(SAMPLES, 2, 6)[:, index]
        for index, tool in enumerate(robot.tool_names)
        for name in WRENCH_NAMES
    }
    command = {**commands(robot, SAMPLES, seed=2), "stiffness": np.full((SAMPLES, 3), 1200.0)}
    motion = motion_of(command)
    block = motor_torques(robot, Motion.of(motion.time, motion.of_joints, wrench))
    functions = [make(robot, frame) for make in (link_torques_function, inverse_dynamics_function)]
    call = compiled_robot(tmp_path / "c", robot, functions, "double")
    of_links, _ = call(functions[0], {name: command[name] for name in POSITION.names}, by_tool)
    found, _ = call(functions[1], command, by_tool)
    np.testing.assert_array_equal(found["flags"], block.flags)
    assert_close(of_links["tau_e"], block.tau_e)
    for name in ("tau_e", "theta", "tau_motor"):
        assert_close(found[name], getattr(block, name))


@pytest.mark.slow
def test_feedback_linearization_under_wrenches_by_tool(tmp_path: Path) -> None:
    robot, wrench = load_robot(two_hands(tmp_path)), drawn_wrench((None, "base"))
    wrench.wrench[:, :6] = wrench.dwrench[:, :6] = wrench.ddwrench[:, :6] = 0
    state, command = random_state(robot, SAMPLES, seed=5), commands(robot, SAMPLES, seed=7)
    gains = Gains.from_poles((-20.0, -21.0, -22.0, -23.0), (-25.0, -26.0))
    function = feedback_linearization_function(robot, wrench.frame)
    of_gains = {
        name: np.broadcast_to(values, (SAMPLES, 3, *values.shape[1:]))
        for name, values in vars(gains).items()
        if name != "sources"
    }
    by_tool = {f"{name}_right_hand": getattr(wrench, name)[:, 6:] for name in WRENCH_NAMES}
    still = {"q": np.zeros((SAMPLES, 3)), "stiffness": np.zeros((SAMPLES, 3))}
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "double")(
        function, vars(state), command, of_gains, still, by_tool
    )
    law, motion = FeedbackLinearization(robot, gains, wrench.frame), motion_of(command)
    expected = law(state, Motion.of(motion.time, motion.of_joints, wrench))
    assert_close(found["tau_motor"], expected, share=1e-11)  # another factorization of M


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "float"])
def test_a_project_under_wrenches_by_tool_passes_its_own_test(tmp_path: Path, precision: str) -> None:
    robot = load_robot(two_hands(tmp_path))
    project = generate(robot, precision, ("base", None), ["joints.left.link.mass"])
    (tmp_path / "c").mkdir()
    write_files(project, tmp_path / "c")
    subprocess.run(["make", "test"], cwd=tmp_path / "c", check=True, capture_output=True)
    header = " ".join(project.files["two_hands.h"].split())
    assert f"{precision} wrench_left_hand[6]; /* fx, fy, fz, mx, my, mz along the axes of the base" in header
    assert "right_hand" not in header
    assert "the argument wrench acts on the tools that it names" in header
    readme = " ".join(project.files["README.md"].split())
    assert "has the members `wrench_left_hand`, `dwrench_left_hand`, `ddwrench_left_hand`;" in readme


def test_tools_of_equal_names_in_c_and_other_numbers_of_tools_are_refused(tmp_path: Path) -> None:
    path = two_hands(tmp_path)
    path.write_text(path.read_text().replace("right_hand", "left-hand"))
    with pytest.raises(InputError, match="two of the tools left_hand, left-hand have the same name in C"):
        generate(load_robot(path), wrench=("base", "base"))
    with pytest.raises(InputError, match="the wrench is for 1 tool, the robot has 2"):
        generate(load_robot(path), wrench="base")


@pytest.mark.slow
def test_the_command_names_tools(vsacli: Callable[..., Outcome], tmp_path: Path) -> None:
    both, one = two_hands(tmp_path), two_hands(tmp_path, "left_hand")
    named = vsacli("codegen", both, "-o", "c", "--wrench", "right_hand:base")
    assert named.code == 0, named.err
    assert "ddwrench_right_hand[6]" in Path("c/two_hands.h").read_text()
    assert vsacli("codegen", one, "-o", "d", "--wrench", "base").code == 0
    assert vsacli("codegen", one, "-o", "e", "--wrench", "left_hand:base").code == 0
    assert Path("d/two_hands.c").read_text() == Path("e/two_hands.c").read_text()


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ("base", "--wrench: two-hands has the tools left_hand, right_hand; say which one"),
        ("lft_hand:base", "--wrench: two-hands has no tool 'lft_hand'; did you mean 'left_hand'?"),
        ("left_hand:bas", "'bas' is not one of 'end_effector', 'base'; did you mean 'base'?"),
    ],
)
def test_the_command_refuses_other_tools(
    vsacli: Callable[..., Outcome], tmp_path: Path, words: str, problem: str
) -> None:
    refused = vsacli("codegen", two_hands(tmp_path), "-o", "f", "--wrench", words)
    assert (refused.code, problem in refused.err) == (2, True), refused.err


def test_a_tool_has_one_frame(vsacli: Callable[..., Outcome], tmp_path: Path) -> None:
    twice = ("--wrench", "left_hand:base", "--wrench", "left_hand:end_effector")
    refused = vsacli("codegen", two_hands(tmp_path), "-o", "f", *twice)
    assert (refused.code, "the tool left_hand has two frames" in refused.err) == (2, True), refused.err
