"""Random records of joints and arms whose equations hold, and the same with what these do not know."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from samples.excited import Excitation, Recorded, excited
from samples.shipped import shipped_robot
from vsacli import Robot

LAWS: tuple[dict[str, Any], ...] = (
    {},
    {"joints.*.actuator.spring": {"type": "sinh", "k": 20, "a": 15}},
    {"joints.*.actuator.spring": {"type": "cubic", "k": 300, "k_c": 3000}},
)
"""Springs of the arm: its own, and others of about the same stiffness."""

FRICTION = {
    "joints.*.actuator.motor.friction": {"coulomb": 1.5, "offset": 0.3},
    "joints.*.actuator.motor.damping": 0.8,
}


class Case(NamedTuple):
    """A robot and what was recorded of it.

    Attributes:
        robot: as its file has it.
        record: without noise.
        speed: of the motors, (samples, joints, 2).
        deflection: of their springs, likewise.
        random: for what else is drawn.
    """

    robot: Robot
    record: Recorded
    speed: np.ndarray
    deflection: np.ndarray
    random: np.random.Generator

    def with_torque(self, further: np.ndarray) -> Recorded:
        """The record with a further torque of its motors, by the random noise of its sensors."""
        return self.noisy(self.record._replace(tau_motor=self.record.tau_motor + further))

    def noisy(self, record: Recorded) -> Recorded:
        """A record with noise of sensors, white or, of every other torque, of some color."""
        position, torque = 10 ** self.random.uniform(-5.5, -4.5), 10 ** self.random.uniform(-1, 0.3)
        q, theta = (
            each + position * self.random.normal(size=each.shape) for each in (record.q, record.theta)
        )
        noise = self.random.normal(size=record.tau_motor.shape)
        if self.random.random() < 1 / 2:  # as of a drive that filters what it reports
            share = self.random.uniform(0.2, 0.8)
            for row in range(1, len(noise)):
                noise[row] = share * noise[row - 1] + np.sqrt(1 - share**2) * noise[row]
        return Recorded(record.time, q, theta, record.tau_motor + torque * noise)


def random_case(seed: int, *, joints: int = 1) -> Case:
    """The first joints of the arm with random springs and friction, moved at random."""
    random = np.random.default_rng(seed)
    robot = shipped_robot("vsa_3r").replace(LAWS[random.integers(len(LAWS))])
    if random.random() < 1 / 2:
        robot = robot.replace(FRICTION)
    robot = dataclasses.replace(robot, joints=robot.joints[:joints])
    motion = Excitation(
        position=random.uniform(-0.5, 0.5, joints).tolist(),
        reach=random.uniform(0.2, 0.6, joints).tolist(),
        stiffness=random.uniform(1300, 1700, joints).tolist(),
        swing=random.uniform(150, 300, joints).tolist(),
        duration=random.uniform(15, 40),
        rate=random.choice([200.0, 250.0, 500.0]),
    )
    record = excited(robot, motion, seed)
    speed = np.gradient(record.theta, record.time, axis=0)
    return Case(robot, record, speed, record.theta - record.q[..., None], random)


def _quadratic(case: Case) -> np.ndarray:
    return np.asarray(case.random.uniform(1, 3) * case.speed * np.abs(case.speed))


def _stribeck(case: Case) -> np.ndarray:
    slow = case.random.uniform(0.1, 0.3)
    size = case.random.uniform(1.5, 4)
    return np.asarray(size * np.sign(case.speed) * np.exp(-((case.speed / slow) ** 2)))


def _stiffer(case: Case) -> np.ndarray:
    """From some deflection on, within the range that the motion uses."""
    size = np.abs(case.deflection)
    beyond = np.maximum(size - case.random.uniform(0.5, 0.8) * size.max(), 0.0)
    return np.asarray(case.random.uniform(300, 1000) * np.sign(case.deflection) * beyond)


def _gain_of_motor(case: Case) -> np.ndarray:
    gain = np.zeros(case.speed.shape)
    gain[..., case.random.integers(2)] = 0.03
    return np.asarray(gain * case.record.tau_motor)


PLANTS: dict[str, Callable[[Case], np.ndarray]] = {
    "quadratic friction": _quadratic,
    "Stribeck's friction": _stribeck,
    "stiffer springs": _stiffer,
    "gain of a motor": _gain_of_motor,
    "gain": lambda case: 0.03 * case.record.tau_motor,
}
"""Torques of motors that no robot file has, by name."""


def write(case: Case, record: Recorded, folder: Path) -> Path:
    """A file of the record."""
    return record.write(folder / "record.csv", case.robot)
