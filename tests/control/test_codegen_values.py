"""Generated functions, called one sample at a time, against what the tool computes over blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.codegen import CLOSE, clear, commands, expected_of, motion_of, with_springs
from samples.generated_code import compiled_robot
from samples.marks import needs_compiler, slow, slow_but
from samples.plants import all_rigid, elastic, random_state, with_actuators
from samples.robots import random_robot
from samples.shipped import shipped_robot
from samples.springs import SPRINGS

from vsacli import FeedbackLinearization, Flag, Gains, Integral, Robot, State, link_torques, motor_torques
from vsacli.base.signals import POSITION
from vsacli.base.variables import Block
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.dynamics.inverse import TORQUES

pytestmark = needs_compiler

SAMPLES = 150

OF_STRETCHED_LINKAGES = 1e-10
"""Relative rounding of the stiffness where a four-bar's domain ends, from that of the deflection."""


def lossy() -> Robot:
    """The PUMA 560 with its friction, friction between its links, and windings."""
    shaft = {"torque_constant": 0.25, "resistance": 1.6, "max_current": 6.0, "max_voltage": 20.0}
    changes: dict[str, object] = {"joints.*.friction": {"coulomb": 0.8, "offset": 0.1, "width": 0.2}}
    changes |= {f"joints.waist.actuator.motor.{name}": value for name, value in shaft.items()}
    changes["joints.elbow.actuator.motor.friction"] = {"coulomb": [0.1, 0.2], "width": 3.0}
    return shipped_robot("puma_560").replace(changes)


def margins(block: Block) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        room = np.minimum(block.stiffness - block.stiffness_min, block.stiffness_max - block.stiffness)
    return np.abs(room) / block.stiffness


def check_inverse_dynamics(robot: Robot, folder: Path, rtol_of_upper: float = 0.0) -> Block:
    """Values and flags of every variable; returns what the tool computes.

    Relative rounding of the largest stiffness may be given, if it is more than a share of the peak.
    """
    function, command = inverse_dynamics_function(robot), commands(robot, SAMPLES, seed=2)
    found, returned = compiled_robot(folder / "c", robot, [function], "double")(function, command)
    block = motor_torques(robot, motion_of(command))
    np.testing.assert_array_equal(found.pop("flags"), block.flags)
    np.testing.assert_array_equal(returned, np.bitwise_or.reduce(block.flags, axis=1))
    for name, values in found.items():
        expected = expected_of(block, name)
        np.testing.assert_array_equal(np.isnan(values), np.isnan(expected), err_msg=name)
        chosen = clear(margins(block), expected.shape) & np.isfinite(expected)
        peak = np.abs(expected[chosen]).max(initial=0.0)
        rtol = rtol_of_upper if name == "stiffness_max" else 0.0
        np.testing.assert_allclose(
            values[chosen], expected[chosen], rtol=rtol, atol=CLOSE * peak, err_msg=name
        )
        infinite = np.isinf(expected)
        np.testing.assert_array_equal(values[infinite], expected[infinite])
    return block


@pytest.mark.cases(2)
@pytest.mark.parametrize("law", slow_but({"cubic", "sinh", "exponential", "quadratic"}, SPRINGS))
def test_inverse_dynamics_with_springs_of_each_law(law: str, tmp_path: Path) -> None:
    rtol = OF_STRETCHED_LINKAGES if law == "four_bar" else 0.0
    block = check_inverse_dynamics(with_springs(law), tmp_path, rtol_of_upper=rtol)
    seen = Flag(int(np.bitwise_or.reduce(block.flags, axis=None)))
    assert Flag.INFEASIBLE | Flag.POSITION_LIMIT | Flag.VELOCITY_LIMIT in seen
    assert np.count_nonzero(block.flags == 0) > 0
    assert np.isfinite(block.tau_motor).any(axis=(0, 2)).all()


@pytest.mark.parametrize(
    "name",
    ["vsa_3r", "rp_2", "mixed_3r", "tendon_1r", slow("lwr_7r_vsa"), slow("maccepa_1r"), slow("cam_1r")],
)
def test_inverse_dynamics_of_arms(name: str, tmp_path: Path) -> None:
    check_inverse_dynamics(shipped_robot(name), tmp_path)


@pytest.mark.slow
def test_inverse_dynamics_with_losses(tmp_path: Path) -> None:
    block = check_inverse_dynamics(lossy(), tmp_path)
    for flag in (Flag.CURRENT_LIMIT, Flag.VOLTAGE_LIMIT):
        assert 0 < np.count_nonzero(block.flags & flag) < SAMPLES


def test_border_steps_are_singular_or_nearly_so(tmp_path: Path) -> None:
    block = check_inverse_dynamics(shipped_robot("vsa_3r"), tmp_path)
    assert np.all(block.flags[:2] & Flag.SINGULAR)
    assert np.all(block.flags[4:6] & Flag.NEAR_SINGULAR)
    assert np.isnan(block.tau_motor[0]).all()
    assert np.isfinite(block.phi[0]).all()


def test_inverse_dynamics_of_what_is_no_number(tmp_path: Path) -> None:
    """A sensor that fails must not look like a torque."""
    robot = shipped_robot("vsa_3r")
    function, command = inverse_dynamics_function(robot), commands(robot, 8, seed=4)
    command["q"][:, 2] = [np.nan, np.inf, -np.inf, 1e300, -1e300, np.nan, 0, 0]
    command["stiffness"][6:, 2] = np.nan, np.inf
    found, returned = compiled_robot(tmp_path / "c", robot, [function], "double")(function, command)
    with np.errstate(all="ignore"):
        block = motor_torques(robot, motion_of(command))
    np.testing.assert_array_equal(found["flags"], block.flags)
    np.testing.assert_array_equal(np.isnan(found["tau_motor"]), np.isnan(block.tau_motor))
    bad = [0, 1, 2, 5, 6]
    assert np.isnan(found["tau_motor"][bad, 2]).all()
    assert np.all(found["flags"][bad, 2] & Flag.INFEASIBLE)
    assert np.all(np.array(returned)[bad] & Flag.INFEASIBLE)


@pytest.mark.parametrize("types", ["R", "PRP", "RRPR"])
def test_link_torques(types: str, tmp_path: Path) -> None:
    robot = random_robot(types, seed=3)
    function = link_torques_function(robot)
    command = commands(robot, 40, seed=1)
    motion = {name: command[name] for name in POSITION.names}
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "double")(function, motion)
    for name, expected in zip(TORQUES, link_torques(robot, **motion), strict=True):
        np.testing.assert_allclose(found[name], expected, rtol=0, atol=CLOSE * np.abs(expected).max())


def loop_inputs(robot: Robot, order: int) -> tuple[State, dict[str, np.ndarray], Gains, Integral]:
    """Random states, references and integrals, and gains with integral action."""
    rng = np.random.default_rng(6)
    state, joints = random_state(robot, 40, seed=5), len(robot.joints)
    integral = Integral(rng.uniform(-1e-3, 1e-3, (40, joints)), rng.uniform(-1, 1, (40, joints)))
    poles = -np.arange(20.0, 20.0 + order + 1)
    return state, commands(robot, 40, seed=7), Gains.from_poles(poles, (-25.0, -26.0, -27.0)), integral


def run_feedback(
    robot: Robot, folder: Path, order: int
) -> tuple[dict[str, np.ndarray], list[int], np.ndarray]:
    """What C and the tool make of the same inputs."""
    state, command, gains, integral = loop_inputs(robot, order)
    found, returned = call(robot, folder, state, command, gains, integral)
    with np.errstate(all="ignore"):
        expected = FeedbackLinearization(robot, gains)(state, motion_of(command), integral)
    return found, returned, expected


def call(
    robot: Robot,
    folder: Path,
    state: State,
    command: dict[str, np.ndarray],
    gains: Gains,
    integral: Integral,
) -> tuple[dict[str, np.ndarray], list[int]]:
    function, shape = feedback_linearization_function(robot), state.q.shape
    of_gains = {
        name: np.broadcast_to(values, (*shape, *values.shape[1:]))
        for name, values in vars(gains).items()
        if name != "sources"
    }
    c = compiled_robot(folder / "c", robot, [function], "double")
    return c(function, vars(state), command, of_gains, integral._asdict())


CONTROLLED = {
    "antagonistic": (shipped_robot("vsa_3r"), 4),
    "prismatic": (shipped_robot("rp_2"), 4),
    "sinh": (with_springs("sinh"), 4),
    "elastic among antagonistic": (with_actuators(random_robot("RPR", 4), {1: elastic()}), 4),
    "rigid": (all_rigid("RPR", 5), 2),
    "friction": (
        shipped_robot("vsa_3r").replace(
            {
                "joints.*.actuator.motor.friction": {"coulomb": [3, 2], "offset": 0.1},
                "joints.elbow.friction": {"coulomb": 0.5, "width": 0.1},
            }
        ),
        4,
    ),
}
"""Robots, and the order of the dynamics of their position error."""


@pytest.mark.parametrize("name", CONTROLLED)
def test_feedback_linearization(name: str, tmp_path: Path) -> None:
    robot, order = CONTROLLED[name]
    found, returned, expected = run_feedback(robot, tmp_path, order)
    np.testing.assert_array_equal(np.isnan(found["tau_motor"]), np.isnan(expected))
    there = np.isfinite(expected)
    assert there.any(axis=(0, 2)).all()
    peak = np.abs(expected[there]).max()
    error = np.abs(found["tau_motor"] - expected)[there].max() / peak
    assert error < 1e-11  # another factorization of M, whose condition number is some 1e2
    np.testing.assert_array_equal(returned, np.bitwise_or.reduce(found["flags"], axis=1))
    of_torque = np.bitwise_or.reduce(found["flags"], axis=None) & Flag.MOTOR_TORQUE_LIMIT
    assert bool(of_torque) == (name == "sinh")


def test_a_singular_joint_is_flagged_and_the_others_are_not(tmp_path: Path) -> None:
    """Springs alike and deflected alike: det A is zero."""
    robot = shipped_robot("vsa_3r")
    state, *others = loop_inputs(robot, 4)
    state.theta[:, 1] = state.q[:, 1, None] + 0.1
    found, returned = call(robot, tmp_path, state, *others)
    assert np.isnan(found["tau_motor"][:, 1]).all()
    assert np.isfinite(found["tau_motor"][:, [0, 2]]).all()
    np.testing.assert_array_equal(found["flags"], np.broadcast_to([0, Flag.SINGULAR, 0], (40, 3)))
    assert set(returned) == {int(Flag.SINGULAR)}


def test_currents_of_a_controlled_robot_are_flagged(tmp_path: Path) -> None:
    shaft = {"inertia": 3e-3, "gear_ratio": -30, "side": "shaft", "torque_constant": 0.3, "resistance": 2.0}
    motor = {**shaft, "max_current": 300.0, "max_voltage": 700.0}
    robot = shipped_robot("vsa_3r").replace("joints.base.actuator.motor", motor)
    state, *others = loop_inputs(robot, 4)
    found, _ = call(robot, tmp_path, state, *others)
    current = found["tau_motor"][:, 0] / (-30 * 0.3)
    voltage = 2.0 * current + 0.3 * -30 * state.dtheta[:, 0]
    for values, bound, flag in ((current, 300, Flag.CURRENT_LIMIT), (voltage, 700, Flag.VOLTAGE_LIMIT)):
        beyond = (np.abs(values) > bound).any(axis=-1)
        assert 0 < np.count_nonzero(beyond) < beyond.size
        np.testing.assert_array_equal((found["flags"][:, 0] & flag) != 0, beyond)


def test_limits_of_a_controlled_robot(tmp_path: Path) -> None:
    """Of what is measured, and of the torque that comes out; beside a singular matrix, too."""
    robot = with_springs("sinh")
    state, *others = loop_inputs(robot, 4)
    state.theta[:5, 0] = state.q[:5, 0, None] + 0.1
    found, _ = call(robot, tmp_path, state, *others)
    low, high = robot.joints[0].limits.position
    expected = np.where((state.q < low) | (state.q > high), int(Flag.POSITION_LIMIT), 0)
    expected |= np.where(np.abs(state.dq) > 0.9, int(Flag.VELOCITY_LIMIT), 0)
    expected |= np.where(np.any(np.abs(state.dtheta) > 2.5, axis=-1), int(Flag.MOTOR_VELOCITY_LIMIT), 0)
    excess = np.any(np.abs(found["tau_motor"]) > 20.0, axis=-1)
    expected |= np.where(excess, int(Flag.MOTOR_TORQUE_LIMIT), 0)
    expected[:5, 0] |= int(Flag.SINGULAR)
    np.testing.assert_array_equal(found["flags"], expected)
    for flag in (
        Flag.POSITION_LIMIT,
        Flag.VELOCITY_LIMIT,
        Flag.MOTOR_VELOCITY_LIMIT,
        Flag.MOTOR_TORQUE_LIMIT,
    ):
        assert 0 < np.count_nonzero(expected & flag) < expected.size
