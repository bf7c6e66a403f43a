"""What the actuation of a joint takes with each kind of springs and mechanism, beside the recursion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from samples.mechanisms import DEVICES
from samples.signals import by_name
from samples.springs import SPRINGS
from subjects import motion, seven_joints
from timing import medians

from vsacli import Antagonistic, Joint, Motor, link_torques, mechanisms
from vsacli.actuators.actuator import Actuator
from vsacli.actuators.transmission import Command
from vsacli.compute.engine.engines import SAMPLES_PER_PASS
from vsacli.dynamics.drive import drive

JOINTS = 7
SHARES = {"light": 0.1, "heavy": 0.99}
"""Largest elastic torque as a share of what the stiffness allows."""

STIFFNESS_LEVELS = np.linspace(1.2, 2.5, 50)
"""Stiffness demanded, as a multiple of the least without load."""

LOAD_SWINGS, STIFFNESS_SWINGS = 37, 11
"""In the batch: every stiffness meets every load."""


class Actuation(NamedTuple):
    """Microseconds a joint and sample, and how many times the recursion's share of a joint that is."""

    springs: str
    load: str
    seconds: float
    ratio: float


def actuators() -> dict[str, Actuator]:
    """Pairs of springs of every law, two alike and two whose constants differ; a device of each mechanism."""
    found: dict[str, Actuator] = {}
    motors = (Motor(inertia=0.01), Motor(inertia=0.01))
    for name, ((one, _), (other, _)) in SPRINGS.items():
        found[f"{name}, equal"] = Antagonistic(motor=motors, spring=(one, one))
        found[f"{name}, unequal"] = Antagonistic(motor=motors, spring=(one, other))
    return found | {name: DEVICES[name].actuator for name in mechanisms.MECHANISMS}


def compare(samples: int, repeats: int) -> Iterator[Actuation]:
    """Time the recursion and the actuation with an actuator in turn, one actuator after the other.

    The recursion is timed anew for each: next to each other, both meet the same state of the machine.
    """
    robot, moving = seven_joints(), motion(JOINTS, samples)
    for name, actuator in actuators().items():
        joint = replace(robot.joints[0], actuator=actuator)
        ways: dict[str, Callable[[], object]] = {"recursion": lambda: link_torques(robot, *moving)}
        for load, share in SHARES.items():
            command = _command(actuator, samples, share)
            ways[load] = lambda joint=joint, command=command: _drive(joint, command)
        seconds = medians(ways, repeats)
        of_joint = seconds["recursion"] / JOINTS
        for load in SHARES:
            yield Actuation(name, load, seconds[load] / samples, seconds[load] / of_joint)


def _drive(joint: Joint, command: Command) -> None:
    """In passes, as the engine takes them."""
    for start in range(0, len(command.tau_e), SAMPLES_PER_PASS):
        part = slice(start, start + SAMPLES_PER_PASS)
        drive(joint, Command.of({name: values[part] for name, values in command.arrays().items()}))


def _command(actuator: Actuator, samples: int, share: float) -> Command:
    """Demands that can be met: stiffness and load swing, the load to a share of the largest it can carry."""
    time, still = np.linspace(0, 1, samples), np.zeros(samples)
    least = actuator.solve(np.zeros(1), np.ones(1), np.zeros(1)).lower[0]
    levels = max(least, 10.0) * STIFFNESS_LEVELS
    level = np.rint((len(levels) - 1) * _swinging(time, STIFFNESS_SWINGS)).astype(int)
    load = 2 * _swinging(time, LOAD_SWINGS) - 1
    tau_e = share * _largest_load(actuator, levels)[level] * load
    return Command(still, still, still, tau_e, still, still, by_name(levels[level], still, still))


def _swinging(time: np.ndarray, swings: int) -> np.ndarray:
    """Between 0 and 1."""
    swung: np.ndarray = (1 - np.cos(2 * np.pi * swings * time)) / 2
    return swung


def _largest_load(actuator: Actuator, stiffness: np.ndarray) -> np.ndarray:
    """About the largest |tau_e| up to which the stiffness allows any, in either direction."""
    low, high = np.zeros_like(stiffness), 10 * stiffness
    for _ in range(30):  # bisection
        middle = (low + high) / 2
        fits = _fits(actuator, stiffness, middle)
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    # where the torque has a peak, the stiffness may be reached again beyond loads that do not allow it
    shares = np.linspace(0, 1, 200)
    allowed = np.array([_fits(actuator, stiffness, share * low) for share in shares])
    return shares[np.logical_and.accumulate(allowed).sum(axis=0) - 1] * low


def _fits(actuator: Actuator, stiffness: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Whether a load in either direction allows the stiffness."""
    fits = np.ones(stiffness.shape, dtype=bool)
    for sign in (-1, 1):
        solution = actuator.solve(sign * load, stiffness, np.zeros_like(load))
        fits &= (solution.lower <= stiffness) & (stiffness <= solution.upper)
    return fits
