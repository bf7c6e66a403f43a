"""Dry friction of motors and joints in the inverse dynamics: law, derivatives, work, report."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import sympy
from oracles.lagrange import chain_of
from samples.driven_arm import ARM, LINK, MOVE, START, motion_of, robot_of
from samples.full_model import Drive, FullModel, springs_of
from samples.marks import slow
from samples.shipped import shipped_run
from samples.simulated import short_motion
from scipy.interpolate import PPoly, make_interp_spline

from vsacli import (
    Antagonistic,
    Elastic,
    Friction,
    InputError,
    Motor,
    Report,
    Rigid,
    Robot,
    inverse_dynamics,
    laws,
    link_torques,
)
from vsacli.actuators.friction import REST, FrictionLaws
from vsacli.analysis.dry_friction import DryFrictionSummary

ROUNDING = 1e-8
"""Of the energy that flows: Hermite's rule at 1 kHz leaves about 1e-10."""

SHARP = Friction(coulomb=(3.0, 2.0), offset=0.1)
SMOOTH = Friction(coulomb=(3.0, 2.0), offset=0.1, width=0.05)
BETWEEN_LINKS = Friction(coulomb=(0.8, 0.8), offset=-0.05, width=0.2)


def law(friction: Friction, velocity: float) -> float:
    """F s(v) + F_o, written for one number."""
    size = friction.coulomb[0 if velocity < 0 else 1]
    shape = math.tanh(velocity / friction.width) if friction.width else np.sign(velocity)
    return size * float(shape) + friction.offset


def with_friction(robot: Robot, of_motors: Friction | None, of_joints: Friction | None = None) -> Robot:
    joints = []
    for joint in robot.joints:
        actuator = joint.actuator
        motor = actuator.motor
        pair = isinstance(motor, tuple)
        motors = [dataclasses.replace(each, friction=of_motors) for each in (motor if pair else [motor])]
        actuator = dataclasses.replace(actuator, motor=tuple(motors) if pair else motors[0])
        joints.append(dataclasses.replace(joint, actuator=actuator, friction=of_joints))
    return dataclasses.replace(robot, joints=tuple(joints))


@pytest.mark.parametrize("friction", [SHARP, SMOOTH, Friction(coulomb=(1.0, 1.0), width=1e-3)])
def test_several_laws_at_once_are_the_law(friction):
    velocity = np.array([[-2.0, 0.3], [-1e-4, 1e-9], [0.0, 5.0]])
    frictions = FrictionLaws.of([friction, None])
    assert frictions is not None
    expected = [[law(friction, v), 0.0] for v in velocity[:, 0]]
    np.testing.assert_allclose(frictions.torque(velocity), expected, rtol=1e-15)  # rounding


def test_what_rests_has_no_direction():
    frictions = FrictionLaws.of([SHARP])
    assert frictions is not None
    found = frictions.torque(np.array([[-2 * REST], [-REST], [0.0], [REST], [2 * REST]]))[:, 0]
    np.testing.assert_allclose(found, [-2.9, 0.1, 0.1, 0.1, 2.1], rtol=1e-15)  # rounding


@pytest.mark.parametrize("ratio", [80.0, -80.0])
@pytest.mark.parametrize("friction", [SHARP, SMOOTH])
def test_a_gear_turns_friction_with_the_velocity(ratio, friction):
    motor = Motor(inertia=1e-4, gear_ratio=ratio, side="shaft", friction=friction).at_joint.friction
    for velocity in (-0.7, 0.002):
        assert law(motor, velocity) == pytest.approx(ratio * law(friction, ratio * velocity), rel=1e-14)


@pytest.mark.parametrize("engine", ["numpy", slow("c")])
@pytest.mark.parametrize("friction", [SHARP, SMOOTH])
def test_friction_adds_to_the_motor_torque(engine, friction):
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    without = inverse_dynamics(robot, trajectory)
    result = inverse_dynamics(with_friction(robot, friction), trajectory, engine=engine)
    moving = np.abs(without.dtheta) > 1e-9  # of the rest rounding decides
    expected = np.vectorize(lambda velocity: law(friction, velocity))(without.dtheta)
    added = result.tau_motor - without.tau_motor
    # rounding of torques of 100 N m; a slope of 3 N m over 0.05 rad/s on velocities known to 1e-12
    np.testing.assert_allclose(added[moving], expected[moving], rtol=0, atol=1e-10)
    np.testing.assert_allclose(result.motor_power, result.tau_motor * result.dtheta, rtol=1e-15)


def test_friction_between_links_and_its_derivatives_are_those_of_sympy():
    t = sympy.Symbol("t")
    q = sympy.sin(3 * t) + t**3
    friction = sympy.Rational(4, 5) * sympy.tanh(q.diff(t) / sympy.Rational(1, 5)) - sympy.Rational(1, 20)
    times = np.linspace(-1, 1, 41)
    motion = [sympy.lambdify(t, q.diff(t, order))(times)[:, None] for order in range(5)]
    robot = robot_of(LINK, [Rigid(motor=Motor(inertia=1.0))])
    without = link_torques(robot, *motion)
    found = link_torques(with_friction(robot, None, BETWEEN_LINKS), *motion)
    for order, (of_friction, of_link) in enumerate(zip(found, without, strict=True)):
        expected = sympy.lambdify(t, friction.diff(t, order))(times)
        # rounding, of torques up to a thousand times those of friction
        np.testing.assert_allclose((of_friction - of_link)[:, 0], expected, rtol=0, atol=1e-11 * 10.0**order)


MOTOR = Motor(inertia=0.2, damping=0.1, friction=SMOOTH)
DRIVES = {
    "antagonistic": (
        Antagonistic(motor=(MOTOR, MOTOR), spring=(laws.Cubic(k=400, k_c=2000),) * 2),
        Drive(
            np.diag([0.2, 0.2]),
            [0.1, 0.1],
            springs_of(lambda q, *theta: sum(200 * (x - q) ** 2 + 500 * (x - q) ** 4 for x in theta), 2),
            [lambda velocity: law(SMOOTH, velocity)] * 2,
        ),
        (900, 1200),
    ),
    "elastic": (
        Elastic(motor=MOTOR, stiffness=800),
        Drive(
            0.2,
            [0.1],
            springs_of(lambda q, theta: 400 * (theta - q) ** 2, 1),
            [lambda velocity: law(SMOOTH, velocity)],
        ),
        (math.nan, math.nan),
    ),
    "rigid": (
        Rigid(motor=MOTOR),
        Drive(0.2, [0.1], None, [lambda velocity: law(SMOOTH, velocity)]),
        (math.nan, math.nan),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "kinds",
    [("antagonistic", "elastic", "rigid"), ("rigid", "antagonistic", "elastic")],
    ids=lambda kinds: kinds[0],
)
def test_the_full_model_with_friction_follows(kinds):
    actuators, drives, stiffness = zip(*(DRIVES[kind] for kind in kinds), strict=True)
    arm = dataclasses.replace(ARM, friction=[lambda velocity: law(BETWEEN_LINKS, velocity)] * len(kinds))
    robot = robot_of(ARM, list(actuators))
    joints = tuple(dataclasses.replace(joint, friction=BETWEEN_LINKS) for joint in robot.joints)
    result = inverse_dynamics(dataclasses.replace(robot, joints=joints), motion_of(list(stiffness)))
    start = result.q[0], result.theta[0], result.dq[0], result.dtheta[0]
    followed = FullModel(arm, list(drives)).follow(result.time, result.tau_motor, *start)
    # the kink of friction of two sizes, which the spline through the torques smooths over half a millisecond
    np.testing.assert_allclose(followed.q, result.q.T, rtol=0, atol=1e-7)
    assert np.abs(result.q[-1] - (START + MOVE)).max() < 1e-12  # it moved


def turning_points(time: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Where a motor turns back, and both ends, by a spline of degree 7."""
    spline = make_interp_spline(time, theta, k=7)
    turns = PPoly.from_spline(spline.derivative()).roots(extrapolate=False)
    ends = time[[0, -1]]
    return spline(np.sort(np.concatenate((ends, turns[(turns > ends[0]) & (turns < ends[1])]))))


def lost_to(friction: Friction, time: np.ndarray, theta: np.ndarray, dtheta: np.ndarray) -> float:
    """Work against friction: of the sign function by the ways forward and back, else by the power."""
    if friction.width:
        power = np.array([law(friction, velocity) * velocity for velocity in dtheta])
        spline = make_interp_spline(time, power, k=5).antiderivative()
        return float(spline(time[-1]) - spline(time[0]))
    ways = np.diff(turning_points(time, theta))
    size = np.where(ways < 0, friction.coulomb[0], friction.coulomb[1])
    return float((size * np.abs(ways)).sum() + friction.offset * ways.sum())


def damped(time: np.ndarray, damping: float, velocity: np.ndarray) -> float:
    spline = make_interp_spline(time, damping * velocity**2, k=5).antiderivative()
    return float(spline(time[-1]) - spline(time[0]))


SYMMETRIC = Friction(coulomb=(2.5, 2.5), offset=0.1, width=0.2)
"""Smooth enough for the sums at 1 kHz."""


@pytest.mark.parametrize("friction", [SHARP, SYMMETRIC], ids=["sharp", "smooth"])
@pytest.mark.parametrize("name", ["vsa_3r", slow("mixed_3r")])
def test_motors_do_what_moves_lifts_deflects_and_is_lost(friction, name):
    robot, _ = shipped_run(name, "rest_to_rest" if name == "vsa_3r" else "mixed_3r")
    robot = with_friction(robot, friction, BETWEEN_LINKS)
    result = inverse_dynamics(robot, short_motion(3, rate=1000))
    chain = chain_of(robot, (result.q, result.dq, result.ddq, result.d3q, result.d4q))
    energy = chain.kinetic_energy(0) + chain.potential_energy(0) + result.elastic_energy.sum(axis=1)
    lost, time = np.zeros(3), result.time
    for index, joint in enumerate(robot.joints):
        lost[index] += damped(time, joint.damping, result.dq[:, index])
        lost[index] += lost_to(BETWEEN_LINKS, time, result.q[:, index], result.dq[:, index])
        for side, motor in enumerate(joint.actuator.motors):
            theta, dtheta = result.theta[:, index, side], result.dtheta[:, index, side]
            energy = energy + motor.inertia * dtheta**2 / 2
            lost[index] += damped(time, motor.damping, dtheta) + lost_to(friction, time, theta, dtheta)
    work = np.nansum(result.motor_energy[-1])
    scale = np.nanmax(np.abs(result.motor_energy)) + np.abs(energy).max()
    assert work == pytest.approx(energy[-1] - energy[0] + lost.sum(), abs=ROUNDING * scale)
    reported = [joint.energy.dissipated for joint in result.report.joints]
    np.testing.assert_allclose(reported, lost, rtol=0, atol=ROUNDING * scale)


def test_dissipated_power_is_that_of_every_motion_of_the_joint():
    robot, trajectory = shipped_run("mixed_3r", "mixed_3r")
    assert inverse_dynamics(robot, trajectory).dissipated_power is None
    robot = with_friction(robot, SHARP, BETWEEN_LINKS)
    result = inverse_dynamics(robot, trajectory)
    at = 1000
    for index, joint in enumerate(robot.joints):
        dq = result.dq[at, index]
        power = (joint.damping * dq + law(BETWEEN_LINKS, dq)) * dq
        for side, motor in enumerate(joint.actuator.motors):
            velocity = result.dtheta[at, index, side]
            power += (motor.damping * velocity + law(SHARP, velocity)) * velocity
        assert result.dissipated_power[at, index] == pytest.approx(power, rel=1e-12)


def test_the_summary_of_rest_does_not_depend_on_blocks():
    time = np.linspace(0, 1, 101)
    velocity = np.sin(4 * np.pi * time) * (time > 0.105) * (time < 0.905)
    velocity[40:45] = 0.0
    motor = Motor(inertia=1.0, friction=SHARP).at_joint
    for size in (1, 7, 101):
        summary = DryFrictionSummary(1, motor)
        for start in range(0, len(time), size):
            summary.add(time[start : start + size], velocity[start : start + size])
        found = summary.report()
        assert (found.start, found.end) == (11, 10)
        resting = int((np.abs(velocity) <= REST).sum())
        assert found.between == resting - 21
        moving = np.sign(velocity[np.abs(velocity) > REST])
        assert found.reversals == int((np.diff(moving) != 0).sum()) == 3
        assert (found.lowest, found.highest, found.jump) == (-3.0, 2.0, 5.0)


def test_the_report_says_once_where_torques_are_open():
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    report = inverse_dynamics(with_friction(robot, SHARP), trajectory).report
    lines = [line for line in str(report).splitlines() if line.startswith("dry friction")]
    assert lines[0] == (
        "dry friction: motors that rest (at the start, at the end) would do so with up to 2 N m more or "
        "3 less (base)"
    )
    assert len(lines) == 2
    assert "motors turn back 6 times, first base 2 at t = 0.355 s" in lines[1]
    assert Report.from_json(report.as_json()).joints[0].dry_friction == report.joints[0].dry_friction
    smooth = inverse_dynamics(with_friction(robot, SMOOTH), trajectory).report
    assert "dry friction" not in str(smooth)


def test_friction_between_links_must_be_smooth_and_of_one_size():
    robot, _ = shipped_run("vsa_3r", "rest_to_rest")
    with pytest.raises(InputError, match=r"width: must be positive: .* give the friction to"):
        with_friction(robot, None, Friction(coulomb=(1.0, 1.0)))
    with pytest.raises(InputError, match=r"give their mean 2.5, and half their difference .*: -0.5"):
        with_friction(robot, None, SMOOTH)
    with pytest.raises(InputError, match=r"width: must be at least 1e-30 in size, not 1e-160"):
        with_friction(robot, None, Friction(coulomb=(1.0, 1.0), width=1e-160))  # its square is no number
    only_offset = with_friction(robot, None, Friction(coulomb=(0.0, 0.0), offset=1.0))
    found = link_torques(only_offset, np.zeros(3)).tau_e - link_torques(robot, np.zeros(3)).tau_e
    np.testing.assert_allclose(found, 1.0, rtol=1e-13)  # rounding
