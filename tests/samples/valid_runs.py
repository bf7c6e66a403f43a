"""Runs drawn at random, all of them right: any kind of actuator, chain, load, unit and duration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from samples.long_chains import random_chain
from samples.mechanisms import DEVICES
from samples.robots import random_robot
from samples.springs import SPRINGS
from samples.term_mutations import mutated_run
from vsacli import (
    Antagonistic,
    Inertia,
    Joint,
    Motor,
    Robot,
    Serial,
    Trajectory,
    inverse_dynamics,
    laws,
    mechanisms,
)

Run = tuple[Robot, Trajectory]

SAMPLES = 41


def valid_run(seed: int) -> Run:
    """Robot and trajectory of a seed; the kinds come in turn."""
    kinds = (_units, _mechanism, _laws, _losses, _heavy_chain, _stiff_potential, _hardly_stiff)
    return kinds[seed % len(kinds)](np.random.default_rng(seed))


def _trajectory(
    rng: np.random.Generator, robot: Robot, q: float, stiffness: np.ndarray | float
) -> Trajectory:
    """Sines of a size, in a hundredth of a second to minutes; the stiffness varies by a tenth."""
    joints = len(robot.joints)
    duration = 10 ** rng.uniform(-1.5, 2)
    time = np.linspace(0, duration, SAMPLES)
    phase = 5 * time[:, None] / duration * rng.uniform(0.5, 1, joints)
    varied = stiffness * (1 + 0.1 * np.sin(phase + rng.uniform(0, 6, joints)))
    return Trajectory.from_samples(
        time, q * np.sin(phase + rng.uniform(0, 6, joints)), varied, fit="interpolate"
    )


def _reachable(rng: np.random.Generator, robot: Robot, q: float) -> Run:
    """A motion whose stiffness lies above the smallest that each joint has under its load."""
    trial = _trajectory(rng, robot, q, 1e9)
    least = inverse_dynamics(robot, trial).stiffness_min.max(axis=0)
    stiffness = least * rng.uniform(1.2, 8, len(least))
    time = np.linspace(0, trial.duration, SAMPLES)
    return robot, Trajectory.from_samples(
        time, trial.at(time).q, np.broadcast_to(stiffness, (SAMPLES, len(stiffness))), fit="interpolate"
    )


def _units(rng: np.random.Generator) -> Run:
    """Arms from a millimeter and a milligram to a hundred meters and a thousand tons."""
    length, mass = 10 ** rng.uniform(-3, 2), 10 ** rng.uniform(-6, 6)
    robot = random_robot("".join(rng.choice(["R", "P"], rng.integers(1, 7))), int(rng.integers(10**6)))
    joints = tuple(_scaled(joint, length, mass) for joint in robot.joints)
    x, y, z = (10 * rng.standard_normal(3)).tolist()
    return _reachable(rng, replace(robot, joints=joints, gravity=(x, y, z)), 0.3)


def _scaled(joint: Joint, length: float, mass: float) -> Joint:
    dh, link = joint.dh, joint.link
    x, y, z = (length * each for each in link.com)
    inertia = {
        name: getattr(link.inertia, name) * mass * length**2 for name in ("xx", "yy", "zz", "xy", "xz", "yz")
    }
    torque = mass * length**2 if joint.is_revolute else mass
    motor = Motor(inertia=torque, damping=0.1 * torque)
    spring = laws.Cubic(k=100 * torque, k_c=500 * torque)
    return replace(
        joint,
        dh=replace(dh, a=dh.a * length, d=dh.d * length),
        link=replace(link, mass=mass * link.mass, com=(x, y, z), inertia=Inertia(**inertia)),
        damping=joint.damping * torque,
        actuator=Antagonistic(motor=(motor, motor), spring=(spring, spring)),
    )


def _single(rng: np.random.Generator, actuator: Any, torque: float) -> Robot:
    """One revolute joint that bears about a torque."""
    robot = random_robot("R", int(rng.integers(10**6)))
    joint = robot.joints[0]
    link = replace(joint.link, mass=1.0, com=(0.1, 0.0, 0.0))
    joint = replace(joint, link=link, dh=replace(joint.dh, a=0.0, alpha=0.0, d=0.0), actuator=actuator)
    return replace(robot, joints=(joint,), gravity=(torque / 0.1, 0.0, 0.0))


def _mechanism(rng: np.random.Generator) -> Run:
    device = DEVICES[rng.choice(list(DEVICES))]
    robot = _single(rng, device.actuator, rng.uniform(0.001, 10))
    return robot, _trajectory(
        rng, robot, 0.3, float(rng.uniform(min(device.stiffness), max(device.stiffness)))
    )


def _laws(rng: np.random.Generator) -> Run:
    (one, _), (two, _) = SPRINGS[rng.choice(list(SPRINGS))]
    motor = Motor(inertia=0.1, damping=0.02)
    robot = _single(rng, Antagonistic(motor=(motor, motor), spring=(one, two)), rng.uniform(0.01, 3))
    return _reachable(rng, robot, 0.3)


def _losses(rng: np.random.Generator) -> Run:
    """Friction, dampers, windings, coupled rotors; elastic and rigid joints."""
    robot, trajectory = mutated_run(str(rng.choice(["pair", "serial", "spring"])))
    x, y, z = (rng.uniform(0, 4) * rng.standard_normal(3)).tolist()
    return replace(robot, gravity=(x, y, z)), trajectory


def _heavy_chain(rng: np.random.Generator) -> Run:
    robot = random_chain(int(rng.integers(8, 20)), int(rng.integers(10**6)))
    mass = 10 ** rng.uniform(0, 4)
    joints = tuple(
        replace(joint, link=replace(joint.link, mass=mass * joint.link.mass)) for joint in robot.joints
    )
    return _reachable(rng, replace(robot, joints=joints), 0.05)


def _stiff_potential(rng: np.random.Generator) -> Run:
    """Springs of 1e3 to 1e9 N m/rad whose formula computes their deflection as a difference."""
    stiffness = 10 ** rng.uniform(3, 9)
    energy = rng.choice(["sin(phi)^2", "(1 - cos(2*phi))/2", "sin(theta_1 - q)^2", "phi^2"])
    mechanism = mechanisms.Potential(
        energy=f"k*(r*theta_2)^2*{energy}",
        constants=(("k", stiffness / (2 * 0.07**2)), ("r", 0.01)),
        start=mechanisms.BranchStart(theta_1=0, theta_2=7),
        range=mechanisms.PotentialRange(phi=(-0.7, 0.7), theta_2=(2, 14)),
    )
    motor = Motor(inertia=0.3, damping=0.1)
    robot = _single(rng, Serial(motor=(motor, motor), mechanism=mechanism), rng.uniform(1, 100))
    return robot, _trajectory(rng, robot, 0.4, stiffness)


def _hardly_stiff(rng: np.random.Generator) -> Run:
    """AwAS turned so far that its stiffness 2 K cos(2 phi) is next to zero under load."""
    torque = rng.uniform(1, 30)
    mechanism = mechanisms.Awas(k=1e5, arm=(1e-4, 1.0), lead=0.01)
    motor = Motor(inertia=0.3, damping=0.1)
    robot = _single(rng, Serial(motor=(motor, motor), mechanism=mechanism), torque)
    return robot, _trajectory(rng, robot, 0.2, torque * 10 ** rng.uniform(-7, -1))
