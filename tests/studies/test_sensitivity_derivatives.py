"""Derivatives by the numbers of a robot, against differences of runs and against complex steps."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow_but
from samples.mechanisms import DEVICES
from samples.serial_links import serial_links
from samples.springs import SPRINGS

from vsacli import (
    Antagonistic,
    Elastic,
    Friction,
    Motor,
    Serial,
    link_torques,
    load_robot,
    load_trajectory,
    sensitivity,
)
from vsacli.actuators.reach import margin
from vsacli.actuators.transmission import Command
from vsacli.base.signals import commanded_names
from vsacli.compute.vector import SymmetricTensor, Vector
from vsacli.dynamics.drive import drive_without_limits
from vsacli.dynamics.elastic_torques import joint_state, link_constants
from vsacli.dynamics.recursion import recursion
from vsacli.robot.kinematics import base_gravity
from vsacli.robot.parameters import parameters
from vsacli.studies.sensitivities.joint_derivatives import drive_derivatives
from vsacli.studies.sensitivities.slopes import SensitivityRun, torque_slopes

WEIGHTS = {-3: -1 / 60, -2: 3 / 20, -1: -3 / 4, 1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
"""Central differences of sixth order."""


def differences(function, value, step):
    return sum(weight * function(value + count * step) for count, weight in WEIGHTS.items()) / step


def loaded(name, trajectory=None):
    robot = load_robot(REPOSITORY / "robots" / f"{name}.yaml")
    return robot, load_trajectory(REPOSITORY / "trajectories" / f"{trajectory or name}.yaml", robot)


def samples_of(trajectory, count):
    return trajectory.at(np.linspace(trajectory.start, trajectory.start + trajectory.duration, count)[1:-1])


def torques(robot, motion):
    found = link_torques(robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench)
    return np.stack([found.tau_e, found.dtau_e, found.ddtau_e]).transpose(2, 0, 1)  # joints, orders, samples


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", slow_but(["rp_2"], ["rp_2", "mixed_3r", "scara_4"]))
def test_torques_of_links_by_every_number(name):
    robot, trajectory = loaded(name)
    robot = robot.replace("joints.*.damping", 0.2)
    motion = samples_of(trajectory, 12)
    chosen = [each for each in parameters(robot) if each.part != "actuator"]
    scale = np.abs(torques(robot, motion)).max(axis=(0, 2))[:, None]
    seen = []
    for places, found in torque_slopes(robot, motion, chosen):
        seen += places
        for at, place in enumerate(places):
            each = chosen[place]
            size = max(abs(each.value), 0.1)
            # Sixth-order differences over 1e-3 leave 1e-18, their rounding 1e-13 of the torques.
            expected = differences(
                lambda value, each=each: torques(robot.replace(str(each), value), motion),
                each.value,
                1e-3 * size,
            )
            for joint, of_joint in enumerate(found):
                exact = np.zeros_like(expected[joint]) if of_joint is None else of_joint[at]
                assert np.abs(exact - expected[joint]).max(initial=0) * size < 1e-10 * scale.max(), str(each)
                assert (np.abs(exact - expected[joint]) * size < 1e-10 * scale).all(), str(each)
    assert sorted(seen) == list(range(len(chosen)))


def test_inertial_numbers_by_complex_steps():
    robot, trajectory = loaded("lwr_7r_vsa", "lwr_7r")
    motion = samples_of(trajectory, 12)
    states = [
        joint_state(joint, motion.q[:, at], tuple(motion.variables()[name][:, at] for name in RATES))
        for at, joint in enumerate(robot.joints)
    ]
    links = [link_constants(joint) for joint in robot.joints]
    chosen = [each for each in parameters(robot, ["joints.*.link.*"]) if each.joint == 3]
    ((places, found),) = torque_slopes(robot, motion, chosen)
    assert places == list(range(len(chosen)))
    for at in range(10):
        values = [links[3].mass, *links[3].com, *links[3].inertia]
        values = [complex(value, 1e-30 * (number == at)) for number, value in enumerate(values)]
        link = links[3]._replace(
            mass=values[0], com=Vector(*values[1:4]), inertia=SymmetricTensor(*values[4:])
        )
        moved = recursion(serial_links([*links[:3], link, *links[4:]], states, base_gravity(robot)))
        for joint, of_joint in enumerate(moved[:4]):
            expected = np.array([np.imag(torque) for torque in of_joint]) / 1e-30
            # Both are exact to rounding, which grows over some hundred operations.
            np.testing.assert_allclose(
                found[joint][at], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max()
            )
    assert found[4] is None


RATES = ("dq", "ddq", "d3q", "d4q")


def command(actuator, samples=40, seed=0):
    """Random demands inside of the corridor, away from its ends."""
    random = np.random.default_rng(seed)
    given = {name: np.zeros(samples) for name in commanded_names()}
    given |= {name: random.normal(size=samples) for name in ("dstiffness", "ddstiffness")}
    tau_e, q = random.uniform(-0.2, 0.2, samples), np.zeros(samples)
    if actuator.commanded:
        found = actuator.solve(tau_e, np.full(samples, 50.0), q)
        low = np.nan_to_num(found.lower)
        high = np.minimum(found.upper, 3 * low + 30)
        given["stiffness"] = low + (high - low) * random.uniform(0.2, 0.8, samples)
    rest = (random.normal(size=samples) for _ in range(4))
    return Command(q, next(rest), next(rest), tau_e, next(rest), next(rest), given)


def variables(joint, demand):
    with np.errstate(all="ignore"):
        driven = drive_without_limits(joint, demand, 0.01)
    gap = margin(driven.stiffness, driven.stiffness_min, driven.stiffness_max)
    return {"tau_motor": driven.tau_motor, "theta": driven.theta, "margin": gap}


MOTORS = (
    Motor(inertia=1.0, damping=0.1, friction=Friction(coulomb=(0.2,) * 2, offset=0.05, width=0.4)),
    Motor(
        inertia=0.02, damping=0.002, gear_ratio=-7.0, side="shaft", friction=Friction(coulomb=(0.01, 0.02))
    ),
)


def serial_command(device, samples=40):
    """Demands at random states on the branch, away from the ends of the corridor."""
    random = np.random.default_rng(1)
    phi, s = (random.uniform(*ends, 30 * samples) for ends in (device.deflections, device.settings))
    q = random.uniform(-2, 2, len(phi))
    state = device.mechanism.state(phi, s, q)
    found = device.mechanism.solve(state.tau_e, state.stiffness, q)
    gap = margin(state.stiffness, found.lower, found.upper)
    taken = np.flatnonzero(device.on_branch(phi, s) & (state.stiffness > 0) & (gap > 0.05))[:samples]
    given = {name: np.zeros(len(taken)) for name in commanded_names()}
    given |= {
        name: state.stiffness[taken] * random.normal(size=len(taken))
        for name in ("dstiffness", "ddstiffness")
    }
    given["stiffness"] = state.stiffness[taken]
    size = np.abs(state.tau_e).max()
    dq, ddq, dtau, ddtau = random.normal(size=(4, len(taken)))
    return Command(q[taken], dq, ddq, state.tau_e[taken], size * dtau, size * ddtau, given)


def check_actuator(actuator, demand):
    robot, _ = loaded("vsa_3r", "rest_to_rest")
    joint = dataclasses.replace(robot.joints[0], actuator=actuator)
    robot = dataclasses.replace(robot, joints=(joint, *robot.joints[1:]))
    chosen = [each for each in parameters(robot, ["joints.base.actuator*"]) if each.value]
    found = drive_derivatives(robot, 0, demand, chosen)
    there = variables(joint, demand)
    assert np.isfinite(there["theta"][0]).all()
    for at, each in enumerate(chosen):
        step = 2e-5 * abs(each.value)
        runs = {
            count: variables(robot.replace(str(each), each.value + count * step).joints[0], demand)
            for count in WEIGHTS
        }
        for name, value in there.items():
            if np.isnan(value).all():
                assert np.isnan(found.by_numbers[name][at]).all()
                continue
            expected = sum(weight * runs[count][name] for count, weight in WEIGHTS.items()) / step
            error = np.abs(found.by_numbers[name][at] - expected) * abs(each.value)
            # Differences over 2e-5 have 5e-11 of rounding. Where the stiffness is extreme along a curve is
            # known to the root of rounding, 1.5e-8, and so is the slope of a margin there.
            bound = 1e-7 if name == "margin" else 1e-8
            assert np.nanmax(error, initial=0) < bound * np.nanmax(np.abs(value)), (str(each), name)
            np.testing.assert_array_equal(np.isnan(found.by_numbers[name][at]), np.isnan(expected))


@pytest.mark.cases(3)
@pytest.mark.slow
@pytest.mark.parametrize("law", SPRINGS)
def test_pairs_by_every_number(law):
    (first, _), (second, _) = SPRINGS[law]
    pair = Antagonistic(motor=MOTORS, spring=(first, second))
    check_actuator(pair, command(pair))


@pytest.mark.parametrize(
    "law", [law for law in SPRINGS if "pulling" not in law and law not in ("exponential", "quadratic")]
)
def test_elastic_springs_by_every_number(law):
    actuator = Elastic(motor=MOTORS[1], spring=SPRINGS[law][0][0])
    check_actuator(actuator, command(actuator))


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", slow_but(["awas"], DEVICES))
def test_mechanisms_by_every_number(name):
    device = DEVICES[name]
    check_actuator(
        Serial(motor=MOTORS, coupled_inertia=0.003, mechanism=device.mechanism), serial_command(device)
    )


@pytest.mark.slow
def test_torques_of_motors_by_numbers_of_links_and_springs_at_once():
    robot, trajectory = loaded("vsa_3r", "vsa_3r_via")
    run = SensitivityRun(robot, trajectory, ["joints.elbow.*", "gravity.*"])
    part = next(iter(run))
    names = ["joints.elbow.link.mass", "joints.elbow.dh.alpha", "gravity.1", "joints.elbow.actuator.spring.k"]
    for name in names:
        place = [str(each) for each in run.parameters].index(name)
        each = run.parameters[place]
        size = max(abs(each.value), 0.1)

        def torque(value, name=name):
            return next(iter(SensitivityRun(robot.replace(name, value), trajectory, [name]))).block.tau_motor

        expected = differences(torque, each.value, 1e-4 * size)
        scale = np.abs(part.block.tau_motor).max()
        assert np.abs(part.over_time("tau_motor")[:, place] - expected).max() * size < 1e-8 * scale, name


def test_what_does_not_exist_has_no_slope_by_any_number():
    robot, trajectory = loaded("mixed_3r")
    part = next(iter(SensitivityRun(robot, trajectory)))
    absent = 0
    for name in ("tau_motor", "theta", "motor_power", "margin"):
        variable = part.margin if name == "margin" else getattr(part.block, name)
        slopes = part.over_time(name)
        missing = np.broadcast_to(np.isnan(variable)[:, None], slopes.shape)
        np.testing.assert_array_equal(np.isnan(slopes), missing)
        absent += np.isnan(variable).any(axis=0).sum()
    assert absent


def test_blocks_of_steps_are_joined(monkeypatch):
    robot, trajectory = loaded("mixed_3r")
    masses = ["joints.*.link.mass"]
    whole = sensitivity(robot, trajectory, masses, "1%")
    monkeypatch.setattr("vsacli.studies.sensitivities.slopes.BLOCK_SLOPES", 20_000)
    assert len(list(SensitivityRun(robot, trajectory, masses))) > 1
    parts = sensitivity(robot, trajectory, masses, "1%")
    for one, other in zip(whole.parameters, parts.parameters, strict=True):
        assert one.path == other.path
        for joint, effect in one.joints.items():
            assert other.joints[joint].torque == effect.torque
            assert other.joints[joint].time == effect.time
            # sums of thousands of terms in another order
            assert other.joints[joint].spent == pytest.approx(effect.spent, rel=1e-12, abs=1e-14)
