"""Derivatives of a run by parameters of the robot: of its joints, and of the torques of its links."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.reach import margin
from vsacli.base.arrays import FloatArray, by_joint
from vsacli.base.variables import Block
from vsacli.compute.duals import tangents_of
from vsacli.compute.vector import Scalar
from vsacli.dynamics.chain import Chain
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import command_of, compute_block, fitted
from vsacli.dynamics.recursion import backward, base_frame, forward
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters, seeded
from vsacli.studies.sensitivities.joint_derivatives import MARGIN, OF_MOTORS, drive_derivatives
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory


class TorqueSlopes(NamedTuple):
    """Derivatives of tau_e, tau_e', tau_e'' by some numbers.

    Attributes:
        places: of the numbers, among those that were chosen.
        of_joints: of each joint, (numbers, 3, samples), in N m (N) per s^k and per SI unit of each number;
            None for a joint without effect of them.
    """

    places: Sequence[int]
    of_joints: Sequence[FloatArray | None]


def torque_slopes(robot: Robot, motion: Motion, chosen: Sequence[Parameter]) -> Iterator[TorqueSlopes]:
    """Differentiate (58)-(60) by numbers of a robot.

    Joint by joint, since links before it move alike whatever its numbers are, and since the derivatives of
    a whole chain by all of them would not stay in the caches: at once they took a tenth longer.

    Args:
        robot: the robot.
        motion: samples, and the wrench if there is one.
        chosen: the numbers; no torque of the links depends on those of actuators.
    """
    frame, given = None if motion.wrench is None else motion.wrench.frame, motion.variables()
    arguments = LinkTorques(robot, frame).arguments
    rows = arguments.pack({name: by_joint(given[name]) for name in arguments.shapes})
    plain, carrying = (LinkTorques(each, frame).chain(rows) for each in (robot, seeded(robot, chosen)))
    bodies = forward(plain.links, plain.states, base_frame(plain.gravity))
    for joint, places in _by_joint(chosen).items():
        links, states, gravity, tip = _mixed(plain, carrying, joint)
        known = bodies[:joint] if joint else []
        previous = known[-1].frame if known else base_frame(gravity)
        moved = [*known, *forward(links[len(known) :], states[len(known) :], previous)]
        torques = backward(links, states, moved, tip)
        yield TorqueSlopes(places, [_derivatives(each, places, len(motion.time)) for each in torques])


def _by_joint(chosen: Sequence[Parameter]) -> dict[int | None, list[int]]:
    """Places of the numbers of each joint, and of the robot as a whole."""
    places: dict[int | None, list[int]] = {}
    for place, parameter in enumerate(chosen):
        places.setdefault(parameter.joint, []).append(place)
    return places


def _mixed(plain: Chain, carrying: Chain, joint: int | None) -> Chain:
    """Return the chain with derivatives by the parameters of one joint, or of the robot as a whole."""
    if joint is None:
        return plain._replace(gravity=carrying.gravity, tip=carrying.tip)
    links, states = list(plain.links), list(plain.states)
    links[joint], states[joint] = carrying.links[joint], carrying.states[joint]
    return plain._replace(links=links, states=states)


def _derivatives(torques: Sequence[Scalar], places: Sequence[int], samples: int) -> FloatArray | None:
    tangents = [tangents_of(torque) for torque in torques]
    if not any(tangents):
        return None
    derivatives = np.zeros((len(places), len(torques), samples))
    for order, by_place in enumerate(tangents):
        for row, place in enumerate(places):
            derivatives[row, order] = by_place.get(place, 0.0)
    return derivatives


class Slopes(ABC):
    """Derivatives of the variables of a joint by some numbers."""

    @abstractmethod
    def __getitem__(self, name: str) -> FloatArray:
        """Return slopes of a variable: (parameters, 2, samples) for motors, else (parameters, samples)."""

    @abstractmethod
    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """Weighted sum of those of its motors that exist, (numbers,); weights are (2, samples)."""


class Known(Slopes):
    """Derivatives that were computed.

    Args:
        of_variables: by name.
    """

    def __init__(self, of_variables: Mapping[str, FloatArray]) -> None:
        self._of_variables = of_variables

    def __getitem__(self, name: str) -> FloatArray:
        return self._of_variables[name]

    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """See `Slopes.total`."""
        return np.tensordot(_existing(self[name]), weights, 2)


class Chained(Slopes):
    """Derivatives by numbers that tau_e depends on, by the chain rule when they are asked for.

    Args:
        of_torques: of tau_e, tau_e', tau_e'' by the numbers, (numbers, 3, samples).
        by_torques: of each variable by the three, (3, [2,] samples).
    """

    def __init__(self, of_torques: FloatArray, by_torques: Mapping[str, FloatArray]) -> None:
        self._of_torques, self._by_torques = of_torques, by_torques

    def __getitem__(self, name: str) -> FloatArray:
        by_torques = self._by_torques[name]
        of_torques = self._of_torques if by_torques.ndim == 2 else self._of_torques[:, :, None]
        total: FloatArray = of_torques[:, 0] * by_torques[0]
        for order in range(1, len(by_torques)):
            if by_torques[order].any():  # some depend on tau_e alone
                total += of_torques[:, order] * by_torques[order]
        return total

    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """See `Slopes.total`."""
        by_torques = (_existing(self._by_torques[name]) * weights).sum(axis=1)
        return np.tensordot(self._of_torques, by_torques, 2)


class Group(NamedTuple):
    """Derivatives by some numbers.

    Attributes:
        places: of the numbers, among all.
        of_joints: of each joint; None if nothing of it depends on these numbers.
    """

    places: Sequence[int]
    of_joints: Sequence[Slopes | None]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """The derivatives of a block of samples by the parameters of a robot, per SI unit of each.

    NaN where the variable does not exist, and where the decoupling matrix is singular.

    Attributes:
        block: the steps, with the variables themselves.
        numbers: how many there are.
        groups: the derivatives; those that are zero for a whole joint are left out.
    """

    block: Block
    numbers: int
    groups: Sequence[Group] = field(repr=False)

    @property
    def time(self) -> FloatArray:
        """Times of the steps, (samples,), s."""
        time: FloatArray = self.block.time
        return time

    @property
    def margin(self) -> FloatArray:
        """Derivative of the relative margin of the stiffness, (samples, joints)."""
        return margin(self.block.stiffness, self.block.stiffness_min, self.block.stiffness_max)

    def over_time(self, name: str) -> FloatArray:
        """Derivatives of a variable by all numbers, (samples, numbers, joints[, 2]); NaN wherever it is."""
        variable = self.margin if name == MARGIN else self.block.arrays()[name]
        nothing = np.where(np.isnan(variable), np.nan, 0.0)
        slopes = np.repeat(nothing[:, None], self.numbers, axis=1)
        for places, of_joints in self.groups:
            for joint, of_joint in enumerate(of_joints):
                if of_joint is not None:
                    slopes[:, places, joint] = np.moveaxis(of_joint[name], -1, 0)
        return slopes


def _existing(slopes: FloatArray) -> FloatArray:
    return np.where(np.isfinite(slopes), slopes, 0.0)


BLOCK_SAMPLES = 4096
"""Steps at a time. 7R, 4000 steps: with 1024 it took half as long again; each block costs the interpreter."""

BLOCK_SLOPES = 10_000_000
"""Bound on numbers times joints times steps at a time, each of 24 bytes at most: 20 joints take 0.6 GB."""

ACTUATOR = "actuator"
"""The part of a joint whose numbers leave the torque that its links demand as it is."""


class SensitivityRun:
    """Iterates over a trajectory.

    Args:
        robot: the robot.
        trajectory: for this robot.
        patterns: only the numbers whose paths fit one of these; all that matter if empty.

    Attributes:
        parameters: the numbers, in the order of the derivatives.
        slopes: names of the variables that are differentiated, each with whether it is one of motors.

    Raises:
        InputError: the trajectory does not fit, a pattern fits no number, or a transmission is damped.
    """

    slopes: ClassVar[Mapping[str, bool]] = {**dict.fromkeys(OF_MOTORS, True), MARGIN: False}

    def __init__(self, robot: Robot, trajectory: Trajectory, patterns: Sequence[str] = ()) -> None:
        self.robot, self.trajectory = robot, fitted(robot, trajectory)
        refuse_damped_transmissions(robot, self.trajectory, "sensitivities")
        self.parameters: tuple[Parameter, ...] = parameters(robot, patterns)

    def __iter__(self) -> Iterator[Derivatives]:
        most = BLOCK_SLOPES // (len(self.parameters) * len(self.robot.joints))
        steps = max(1, min(BLOCK_SAMPLES, most))
        for start in range(0, self.trajectory.samples, steps):
            yield self._derivatives(self.trajectory.block(start, start + steps))

    def _derivatives(self, motion: Motion) -> Derivatives:
        block, joints = compute_block(self.robot, motion), range(len(self.robot.joints))
        groups, by_torques = [], []
        for index in joints:
            own = [place for place, each in enumerate(self.parameters) if _drives(each, index)]
            command = command_of(index, block.arrays())
            derived = drive_derivatives(self.robot, index, command, [self.parameters[at] for at in own])
            by_torques.append(derived.by_torques)
            known = Known(derived.by_numbers)
            groups.append(Group(own, [known if joint == index else None for joint in joints]))
        of_links = [place for place, each in enumerate(self.parameters) if each.part != ACTUATOR]
        chosen = [self.parameters[at] for at in of_links]
        for places, of_torques in torque_slopes(self.robot, motion, chosen):
            of_joints = [
                None if each is None else Chained(each, slopes)
                for each, slopes in zip(of_torques, by_torques, strict=True)
            ]
            groups.append(Group([of_links[at] for at in places], of_joints))
        return Derivatives(block, len(self.parameters), groups)


def _drives(parameter: Parameter, joint: int) -> bool:
    return parameter.joint == joint and parameter.part == ACTUATOR
