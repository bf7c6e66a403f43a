"""Derivatives of a run by parameters of the robot: of its joints, and of the torques of its links.

`torque_slopes` differentiates the recursion by link parameters, `drive_derivatives` each joint by actuator
parameters and by the link torques; `Chained` combines both by the chain rule.
"""

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
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import adapt_trajectory, command_of, compute_block
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import RecursionInputs
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters, seeded
from vsacli.studies.sensitivities.joint_derivatives import MARGIN, OF_MOTORS, drive_derivatives
from vsacli.trajectory.trajectory import Motion, Trajectory


class TorqueSlopes(NamedTuple):
    """Derivatives of tau_e, tau_e', tau_e'' by some parameters.

    Attributes:
        places: indices of the parameters among the chosen ones.
        of_joints: derivatives for each joint, (parameters, 3, samples), in N m (N) per s^k and per SI unit of
            each parameter; None for a joint that they do not affect.
    """

    places: Sequence[int]
    of_joints: Sequence[FloatArray | None]


def torque_slopes(
    robot: Robot, motion: Motion, parameters_of_run: Sequence[Parameter]
) -> Iterator[TorqueSlopes]:
    """Differentiate (58)-(60) by parameters of a robot; yield the derivatives joint by joint.

    Args:
        robot: robot that executes the motion.
        motion: samples of the motion, and the wrench if there is one.
        parameters_of_run: parameters; link torques do not depend on those of actuators.
    """
    # by joint, since derivatives of the whole tree by all parameters would not fit into the caches: at once,
    # the sensitivity of a 7R takes 1.2 times as long
    frame, motion_variables = None if motion.wrench is None else motion.wrench.frame, motion.variables()
    arguments = LinkTorques(robot, frame).arguments
    samples = len(motion.time)
    argument_rows = arguments.pack({name: by_joint(motion_variables[name]) for name in arguments.shapes})
    inputs, seeded_inputs = (
        LinkTorques(each, frame).recursion_inputs(argument_rows)
        for each in (robot, seeded(robot, parameters_of_run))
    )
    for joint, parameter_indices in _parameter_indices_by_joint(parameters_of_run).items():
        torques = recursion(_inputs_seeded_at(inputs, seeded_inputs, joint))
        yield TorqueSlopes(
            parameter_indices, [_torque_derivatives(each, parameter_indices, samples) for each in torques]
        )


def _parameter_indices_by_joint(parameters_of_run: Sequence[Parameter]) -> dict[int | None, list[int]]:
    """Return indices of the parameters of each joint, and (key None) of the robot as a whole."""
    indices: dict[int | None, list[int]] = {}
    for index, parameter in enumerate(parameters_of_run):
        indices.setdefault(parameter.joint, []).append(index)
    return indices


def _inputs_seeded_at(
    inputs: RecursionInputs, seeded_inputs: RecursionInputs, joint: int | None
) -> RecursionInputs:
    """Return the tree with derivatives by the parameters of one joint, or of the robot as a whole."""
    if joint is None:
        return inputs._replace(gravity=seeded_inputs.gravity, loads=seeded_inputs.loads)
    links, states, carriers = list(inputs.links), list(inputs.states), list(inputs.carriers)
    links[joint], states[joint] = seeded_inputs.links[joint], seeded_inputs.states[joint]
    carriers[joint] = seeded_inputs.carriers[joint]
    return inputs._replace(links=links, states=states, carriers=carriers)


def _torque_derivatives(
    torques: Sequence[Scalar], parameter_indices: Sequence[int], samples: int
) -> FloatArray | None:
    tangents = [tangents_of(torque) for torque in torques]
    if not any(tangents):
        return None
    derivatives = np.zeros((len(parameter_indices), len(torques), samples))
    for order, torque_tangents in enumerate(tangents):
        for row, index in enumerate(parameter_indices):
            derivatives[row, order] = torque_tangents.get(index, 0.0)
    return derivatives


class Slopes(ABC):
    """Derivatives of the variables of a joint by some parameters."""

    @abstractmethod
    def __getitem__(self, name: str) -> FloatArray:
        """Return slopes of a variable: (parameters, 2, samples) for motors, else (parameters, samples)."""

    @abstractmethod
    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """Return the weighted sum of finite slopes of motors, (parameters,); weights are (2, samples)."""


class Known(Slopes):
    """Derivatives given as arrays.

    Args:
        of_variables: derivatives by name of the variable.
    """

    def __init__(self, of_variables: Mapping[str, FloatArray]) -> None:
        self._of_variables = of_variables

    def __getitem__(self, name: str) -> FloatArray:
        return self._of_variables[name]

    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """See `Slopes.total`."""
        return np.tensordot(_finite_or_zero(self[name]), weights, 2)


class Chained(Slopes):
    """Derivatives by parameters that act through tau_e, evaluated by the chain rule on access.

    Args:
        of_torques: derivatives of tau_e, tau_e', tau_e'' by the parameters, (parameters, 3, samples).
        by_torques: derivatives of each variable by tau_e, tau_e', tau_e'', (3, [2,] samples).
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
        by_torques = (_finite_or_zero(self._by_torques[name]) * weights).sum(axis=1)
        return np.tensordot(self._of_torques, by_torques, 2)


class ParameterGroup(NamedTuple):
    """Derivatives by some parameters.

    Attributes:
        places: indices of the parameters among all.
        of_joints: derivatives for each joint; None for a joint that they do not affect.
    """

    places: Sequence[int]
    of_joints: Sequence[Slopes | None]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """The derivatives of a block of samples by the parameters of a robot, per SI unit of each.

    They are NaN where the variable does not exist, and where the decoupling matrix is singular.

    Attributes:
        block: samples with the variables themselves.
        numbers: number of parameters.
        groups: derivatives by groups of parameters; those that are zero for a whole joint are left out.
    """

    block: Block
    numbers: int
    groups: Sequence[ParameterGroup] = field(repr=False)

    @property
    def time(self) -> FloatArray:
        """Times of the samples, (samples,) in s."""
        return np.asarray(self.block.time)

    @property
    def margin(self) -> FloatArray:
        """Relative margin of the stiffness, (samples, joints)."""
        return margin(self.block.stiffness, self.block.stiffness_min, self.block.stiffness_max)

    def over_time(self, name: str) -> FloatArray:
        """Return derivatives of a variable by all parameters, (samples, parameters, joints[, 2])."""
        variable = self.margin if name == MARGIN else self.block.arrays()[name]
        zero_or_nan = np.where(np.isnan(variable), np.nan, 0.0)
        slopes = np.repeat(zero_or_nan[:, None], self.numbers, axis=1)
        for parameter_indices, of_joints in self.groups:
            for joint, of_joint in enumerate(of_joints):
                if of_joint is not None:
                    slopes[:, parameter_indices, joint] = np.moveaxis(of_joint[name], -1, 0)
        return slopes


def _finite_or_zero(slopes: FloatArray) -> FloatArray:
    return np.where(np.isfinite(slopes), slopes, 0.0)


BLOCK_SAMPLES = 4096
"""Samples per block. With 1024, a 7R with 4000 samples took 1.5 times as long: each block has an overhead."""

BLOCK_SLOPES = 10_000_000
"""Bound on parameters times joints times samples in a block, at most 24 bytes each: 0.6 GB for 20 joints."""

ACTUATOR = "actuator"
"""Part of a joint whose parameters do not change the link torques."""


class SensitivityRun:
    """An iterable of the derivatives of a run, block by block.

    Args:
        robot: robot that executes the trajectory.
        trajectory: trajectory for this robot.
        patterns: patterns of parameter paths; all parameters if empty.

    Attributes:
        parameters: parameters in the order of the derivatives.
        slopes: names of the differentiated variables; the value says whether it is a variable of motors.

    Raises:
        InputError: the trajectory does not fit, a pattern matches no parameter, or a transmission is damped.
    """

    slopes: ClassVar[Mapping[str, bool]] = {**dict.fromkeys(OF_MOTORS, True), MARGIN: False}

    def __init__(self, robot: Robot, trajectory: Trajectory, patterns: Sequence[str] = ()) -> None:
        self.robot, self.trajectory = robot, adapt_trajectory(robot, trajectory)
        refuse_damped_transmissions(robot, self.trajectory, "sensitivities")
        self.parameters: tuple[Parameter, ...] = parameters(robot, patterns)

    def __iter__(self) -> Iterator[Derivatives]:
        max_block_samples = BLOCK_SLOPES // (len(self.parameters) * len(self.robot.joints))
        block_samples = max(1, min(BLOCK_SAMPLES, max_block_samples))
        for start in range(0, self.trajectory.samples, block_samples):
            motion = self.trajectory.block(start, start + block_samples)
            yield derivatives_of(self.robot, motion, self.parameters)


def derivatives_of(robot: Robot, motion: Motion, parameters_of_run: Sequence[Parameter]) -> Derivatives:
    """Differentiate a block of samples by parameters of the robot.

    Args:
        robot: robot that executes the motion.
        motion: samples of the motion, which fits the robot.
        parameters_of_run: parameters in the order of the derivatives.
    """
    block, joints = compute_block(robot, motion), range(len(robot.joints))
    groups, by_torques = [], []
    for index in joints:
        actuator_indices = [
            place
            for place, each in enumerate(parameters_of_run)
            if each.joint == index and each.part == ACTUATOR
        ]
        command = command_of(index, block.arrays())
        drive_slopes = drive_derivatives(
            robot, index, command, [parameters_of_run[at] for at in actuator_indices]
        )
        by_torques.append(drive_slopes.by_torques)
        actuator_slopes = Known(drive_slopes.by_numbers)
        groups.append(
            ParameterGroup(
                actuator_indices, [actuator_slopes if joint == index else None for joint in joints]
            )
        )
    link_indices = [place for place, each in enumerate(parameters_of_run) if each.part != ACTUATOR]
    for index_group, link_torque_slopes in torque_slopes(
        robot, motion, [parameters_of_run[at] for at in link_indices]
    ):
        joint_slopes = [
            None if each is None else Chained(each, slopes)
            for each, slopes in zip(link_torque_slopes, by_torques, strict=True)
        ]
        groups.append(ParameterGroup([link_indices[at] for at in index_group], joint_slopes))
    return Derivatives(block, len(parameters_of_run), groups)
