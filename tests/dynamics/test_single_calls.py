"""Single samples, as control loops compute them: equal to batches, whatever the kernel does inside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow

from vsacli import (
    InputError,
    Motion,
    Robot,
    inverse_dynamics,
    link_torques,
    load_robot,
    load_trajectory,
    motor_torques,
)
from vsacli.compute.engine import NUMBERS, NUMPY
from vsacli.compute.engine.number_engine import MOST_SAMPLES, RECORDED_FROM, _recorded_kernel
from vsacli.dynamics.inverse import InverseDynamics

ROBOTS = REPOSITORY / "robots"
QUICK = ("vsa_3r", "lwr_7r_vsa", "mixed_3r", "maccepa_1r", "cam_1r", "rp_2")
FILES = [
    path.stem if path.stem in QUICK else slow(str(path.relative_to(ROBOTS).with_suffix("")))
    for path in sorted(ROBOTS.rglob("*.yaml"))
]


def random_rows(kernel: InverseDynamics, samples: int, seed: int) -> list[np.ndarray]:
    """Inputs of any size, among them infeasible and singular samples."""
    rng = np.random.default_rng(seed)
    rows = []
    for name, shape in kernel.arguments.shapes.items():
        for _ in range(int(np.prod(shape))):
            row = rng.normal(size=samples) * 10 ** rng.uniform(-2, 2)
            rows.append(np.abs(row) * 500 if name == "stiffness" else row)
    return rows


@pytest.mark.cases(5)
@pytest.mark.parametrize("name", FILES)
def test_single_samples_are_those_of_numpy_to_the_last_bit(name: str) -> None:
    kernel = InverseDynamics(load_robot(ROBOTS / f"{name}.yaml"))
    rows = random_rows(kernel, 200, seed=1)
    expected = NUMPY.run(kernel, rows)
    for _ in range(RECORDED_FROM):
        NUMBERS.run(kernel, [row[:1] for row in rows])
    assert _recorded_kernel(kernel).function_of_call() is not None
    found = np.concatenate(
        [NUMBERS.run(kernel, [row[start : start + 4] for row in rows]) for start in range(0, 200, 4)], axis=1
    )
    np.testing.assert_array_equal(found, expected)


def of_run(name: str, trajectory: str) -> tuple[Robot, object, object]:
    robot = load_robot(ROBOTS / f"{name}.yaml")
    motion = load_trajectory(REPOSITORY / "trajectories" / f"{trajectory}.yaml", robot)
    return robot, motion, inverse_dynamics(robot, motion)


@pytest.mark.parametrize(("name", "trajectory"), [("vsa_3r", "rest_to_rest"), ("panda_7r", "panda_7r")])
def test_motor_torques_are_those_of_a_run(name: str, trajectory: str) -> None:
    robot, motion, result = of_run(name, trajectory)
    for sample in (0, 100, 1000, 1700):
        for _ in range(RECORDED_FROM + 1):
            block = motor_torques(robot, motion.at(result.time[sample]))
        for variable in ("tau_motor", "theta", "tau_e", "det_A", "stiffness_min"):
            expected, found = getattr(result, variable), getattr(block, variable)
            atol = 1e-13 * np.nanmax(np.abs(expected))  # `at` rounds the polynomial otherwise than a run does
            np.testing.assert_allclose(found, expected[sample], atol=atol, rtol=1e-13)
        np.testing.assert_array_equal(block.flags, result.flags[sample])
        assert block.tau_motor.shape == (len(robot.joints), 2)


def test_motor_torques_of_several_samples() -> None:
    robot, motion, result = of_run("vsa_3r", "rest_to_rest")
    for samples in (MOST_SAMPLES, MOST_SAMPLES + 1):
        block = motor_torques(robot, motion.at(result.time[:samples]))
        np.testing.assert_allclose(block.tau_motor, result.tau_motor[:samples], rtol=1e-12)


def test_an_infeasible_sample_is_flagged() -> None:
    robot, motion, _ = of_run("vsa_3r", "rest_to_rest")
    at = motion.at(0.0)
    low = Motion(at.time, at.q, at.dq, at.ddq, at.d3q, at.d4q, {**at.commanded, "stiffness": 0 * at.q + 700})
    for _ in range(RECORDED_FROM + 1):
        block = motor_torques(robot, low)
        assert np.isnan(block.tau_motor).all()
        assert (block.flags == 1).all()


def test_a_damped_transmission_is_at_equilibrium() -> None:
    robot, motion, _ = of_run("maccepa_vd_1r", "maccepa_vd_1r")
    assert np.isfinite(motor_torques(robot, motion.at(0.5)).tau_motor).any()


def test_robots_that_differ_in_a_limit_alone_are_told_apart() -> None:
    """Springs compare equal whatever their limits."""
    robot, motion, _ = of_run("vsa_3r", "rest_to_rest")
    tight = robot.replace("joints.*.actuator.spring.max_deflection", 0.01)
    at = motion.at(2.0)
    assert not motor_torques(robot, at).flags.any()
    assert motor_torques(tight, at).flags.all()
    assert not motor_torques(robot, at).flags.any()


def test_calls_of_link_torques_agree_before_and_after_recording() -> None:
    robot = load_robot(ROBOTS / "lwr_7r_vsa.yaml")
    motion = np.random.default_rng(2).normal(size=(5, 7))
    calls = [link_torques(robot, *motion) for _ in range(RECORDED_FROM + 2)]
    many = link_torques(robot, *np.repeat(motion[:, None], 20, axis=1))
    for each in calls:
        for one, row in zip(each, many, strict=True):
            np.testing.assert_array_equal(one, row[0])


def test_a_motion_that_does_not_fit_is_refused() -> None:
    robot, motion, _ = of_run("vsa_3r", "rest_to_rest")
    at = motion.at(0.0)
    with pytest.raises(InputError, match=r"the motion lacks stiffness, dstiffness, ddstiffness, which"):
        motor_torques(robot, Motion(at.time, at.q, at.dq, at.ddq, at.d3q, at.d4q, {}))
    with pytest.raises(InputError, match=r"dq must have the shape \(3,\) of q, not \(2,\)"):
        motor_torques(robot, Motion(at.time, at.q, at.dq[:2], at.ddq, at.d3q, at.d4q, at.commanded))
    with pytest.raises(TypeError, match=r"motion must be a Motion, not a list; trajectory.at"):
        motor_torques(robot, [1, 2])


def test_a_path_of_a_file_is_no_motion() -> None:
    robot, _, _ = of_run("vsa_3r", "rest_to_rest")
    with pytest.raises(TypeError, match="motion must be a Motion"):
        motor_torques(robot, Path("move.yaml"))
