"""Equations of links: the torque of springs, or of the motor of a rigid joint, is Y pi + damping + friction.

The torque of springs follows from recorded positions and the spring parameters, which the equations of motors
gave before; their uncertainty adds to that of the links. A rigid joint has motor and link in one equation,
where torques determine only the sum of both dampings, say. So parameters of joints and rigid drives are
columns of the regressor like those of links, and are regrouped with them into base parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import FloatArray
from vsacli.compute.duals import tangent_of, value_of
from vsacli.dynamics.drive import shaft_torques
from vsacli.dynamics.dry_friction import joint_friction
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, seeded, with_copied_actuator
from vsacli.studies.identification.conditioning import ConditionedRecording
from vsacli.studies.identification.estimation import Equations
from vsacli.studies.identification.fitted_system import Solution, SystemOfEquations
from vsacli.studies.identification.motor_equations import (
    LINKS,
    SPRINGS,
    WIDTH,
    MotorSystem,
    admissible,
    as_duals,
    group_of,
    joint_motion,
    unknowns,
)
from vsacli.studies.identification.regressor import (
    SYMBOLS,
    UNITS,
    BaseParameters,
    all_parameters,
    link_parameter_names,
    preferred_order,
    random_motion,
    regressor,
)


class LinkSystem(SystemOfEquations):
    """Equations of joints whose torque is known, from springs or from a rigid drive.

    Args:
        robot: robot as in its file.
        base: combinations of the standard parameters of all links and of `parts` that are unknown; without
            any link parameter among the first ones, links are those of the file.
        parts: further parameters of the robot file, of joints and rigid drives.
        springs: spring parameters identified before.
        errors: effect of independent errors, of one standard error each, on `springs`, (springs, errors).

    Attributes:
        base: see above.
        parts: see above.
        bodies: number of combinations named after a link parameter, the first unknowns.
    """

    def __init__(
        self,
        robot: Robot,
        base: BaseParameters,
        parts: Sequence[Parameter],
        springs: Sequence[Parameter] = (),
        errors: FloatArray | None = None,
    ) -> None:
        self.title, self.base, self.parts = LINKS, base, tuple(parts)
        self._robot, self._springs = robot, tuple(springs)
        self._errors = np.zeros((0, 0)) if errors is None else errors
        link_names = link_parameter_names(robot)
        self._first_part = len(link_names)
        self.bodies = int(np.searchsorted(base.kept, self._first_part))
        all_names = [*link_names, *map(str, parts)]
        self.names = tuple(base.names(all_names))
        self.before = base.of(np.concatenate((all_parameters(robot), [each.value for each in parts])))
        units = [*UNITS * len(robot.joints), *(each.unit for each in parts)]
        self.units = tuple(units[at] for at in base.kept)
        is_single = np.count_nonzero(base.shares, axis=1) == 1
        self.sums = tuple(
            "" if index >= self.bodies and single else base.words(index, all_names)
            for index, single in enumerate(is_single)
        )

    def of_record(self, values: FloatArray, recording: ConditionedRecording) -> Equations:
        """See `SystemOfEquations.of_record`."""
        robot, bodies = self._robot, self.bodies
        part_indices = self.base.kept[bodies:] - self._first_part
        part_values = np.zeros(len(self.parts))
        part_values[part_indices] = values[bodies:]
        parts = [
            each._replace(value=float(value)) for each, value in zip(self.parts, part_values, strict=True)
        ]
        columns = regressor(robot, recording.q, recording.dq, recording.ddq)
        link_columns = columns[:, self.base.kept[:bodies]]
        link_torques = np.einsum("jbs,b->js", link_columns, values[:bodies])
        if not bodies:
            link_torques = np.einsum("jps,p->js", columns, all_parameters(robot))
        joint_rows = []
        for index in self.joints:
            torque, spring_slopes = _transmitted_torque(robot, index, recording, self._springs)
            resistance, slopes = _resisting_torque(robot, index, joint_motion(recording, index), parts)
            if np.isfinite(torque).all():
                rows = np.stack(
                    (
                        torque,
                        link_torques[index] + resistance,
                        *link_columns[index],
                        *slopes[part_indices],
                        *spring_slopes,
                    )
                )
                joint_rows.append((f"link of {robot.joint_names[index]}", recording.filter.applied(rows.T)))
        stacked_rows, error_start = np.concatenate([rows for _, rows in joint_rows]), 2 + len(values)
        return Equations(
            measured=stacked_rows[:, 0],
            predicted=stacked_rows[:, 1],
            slopes=stacked_rows[:, 2:error_start],
            group=np.repeat([name for name, _ in joint_rows], [len(rows) for _, rows in joint_rows]),
            sample=np.concatenate([np.arange(len(rows)) for _, rows in joint_rows]),
            errors=stacked_rows[:, error_start:] @ self._errors,
        )

    @property
    def joints(self) -> Sequence[int]:
        """Indices of the joints whose equations contain unknowns."""
        if self.bodies:
            return range(len(self._robot.joints))
        return sorted({each.joint for each in self.parts if each.joint is not None})

    def admissible(self, index: int, value: float) -> float | None:
        """See `SystemOfEquations.admissible`; combinations with link parameters may have any value."""
        if index < self.bodies:
            return value
        return admissible(self._robot, str(self.part(index)), value)

    def part(self, index: int) -> Parameter:
        """Return the parameter of the file after which an unknown beyond the first `bodies` is named."""
        return self.parts[int(self.base.kept[index]) - self._first_part]


def link_system(
    robot: Robot,
    fit: Sequence[str],
    motors: Sequence[Solution] = (),
    *,
    links: bool = True,
    joints: Sequence[int] | None = None,
) -> LinkSystem:
    """Return the system of a robot's links, with damping and friction of its joints.

    Args:
        robot: robot as in its file.
        fit: words and patterns; those for motors count for rigid joints.
        motors: solutions of motors and springs, which give the torque of springs and its errors.
        links: whether the links are identified, rather than those of the file.
        joints: indices of the joints with recorded torque; all if None.
    """
    words = [*fit, LINKS] if links else fit
    parts = [
        each
        for index in (range(len(robot.joints)) if joints is None else joints)
        for each in unknowns(robot, index, words)
        if each.path[-1] != WIDTH and (group_of(each) == LINKS or not robot.joints[index].actuator.sprung)
    ]
    return LinkSystem(robot, _link_combinations(robot, parts, links=links), parts, *_best_springs(motors))


MIN_VELOCITY_FACTOR = 1e-4
"""Smallest factor of random velocities, at which friction of one width differs from that of another."""


def _link_combinations(robot: Robot, parts: Sequence[Parameter], *, links: bool) -> BaseParameters:
    """Return the combinations of link parameters and further ones that torques of any motion determine."""
    joints, link_column_count = len(robot.joints), len(SYMBOLS) * len(robot.joints)
    fast_motion = random_motion(joints)
    slow_motion = fast_motion * np.array([1, 0, 1])[:, None, None]
    slow_motion[1] = fast_motion[1] * np.geomspace(1, MIN_VELOCITY_FACTOR, fast_motion.shape[1])[:, None]
    q, dq, ddq = np.concatenate((fast_motion, slow_motion), axis=1)
    columns = np.zeros((joints, link_column_count + len(parts), len(q)))
    if links:
        columns[:, :link_column_count] = regressor(robot, q, dq, ddq)
    for index in range(joints):
        motion = as_duals({"dq": dq[:, index], "ddq": ddq[:, index]})
        columns[index, link_column_count:] = _resisting_torque(robot, index, motion, parts)[1]
    order = np.concatenate(
        (preferred_order(joints), np.arange(link_column_count, link_column_count + len(parts)))
    )
    return BaseParameters.of_columns(np.moveaxis(columns, 1, -1).reshape(-1, columns.shape[1]), order)


def _best_springs(motors: Sequence[Solution]) -> tuple[list[Parameter], FloatArray | None]:
    """Return spring parameters that predict best, and their errors as sums of independent errors."""
    springs, covariance_roots = [], []
    for solution in motors:
        assert isinstance(solution.system, MotorSystem), "of motors"
        parameters = solution.system.sought
        spring_indices = [place for place, number in enumerate(parameters) if group_of(number) == SPRINGS]
        covariance = np.zeros((len(parameters),) * 2)
        covariance[np.ix_(solution.free, solution.free)] = solution.fit.covariance
        variances, axes = np.linalg.eigh(covariance[np.ix_(spring_indices, spring_indices)])
        values = solution.system.of_file(solution.predicting)
        springs += [parameters[at]._replace(value=float(values[at])) for at in spring_indices]
        covariance_roots.append(axes * np.sqrt(np.maximum(variances, 0.0)))
    return springs, scipy.linalg.block_diag(*covariance_roots) if covariance_roots else None


def _transmitted_torque(
    robot: Robot, index: int, recording: ConditionedRecording, springs: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Return the torque of springs or a rigid drive at a joint, (samples,), and its slopes by springs."""
    actuator = robot.joints[index].actuator
    if not actuator.sprung:
        return recording.tau_motor[:, index, 0], np.zeros((len(springs), len(recording.time)))
    joint_springs = [each if each.joint == index else None for each in springs]
    joint_parameters = [each for each in joint_springs if each is not None]
    seeded_actuator = with_copied_actuator(seeded(robot, joint_parameters).joints[index]).actuator
    torque = seeded_actuator.springs_of(joint_motion(recording, index)).tau_e
    slopes = np.zeros((len(springs), len(recording.time)))
    slopes[[each is not None for each in joint_springs]] = tangent_of(
        torque, len(joint_parameters), recording.time.shape
    )
    return value_of(torque), slopes


def _resisting_torque(
    robot: Robot, index: int, motion: JointVariables, seeded_parameters: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Return the resisting torque of a joint and its rigid drive, (samples,), and its slopes."""
    joint = with_copied_actuator(seeded(robot, seeded_parameters).joints[index])
    dq: Any = motion.dq
    torque: Any = joint.damping * dq + joint_friction(joint.friction, (dq, 0, 0, 0)).tau
    if not joint.actuator.sprung:
        dtheta, ddtheta = (np.stack([rows] * SIDES) for rows in (dq, motion.ddq))
        torque = torque + shaft_torques(joint.actuator, dtheta, ddtheta, np.zeros_like(dtheta))[0]
    return value_of(torque), tangent_of(torque, len(seeded_parameters), np.shape(dq.value))


def without_links(
    robot: Robot, joints: Sequence[int], system: LinkSystem, recordings: Sequence[ConditionedRecording]
) -> str:
    """Return the reason why a system of links cannot be identified, as a sentence; "" if it can.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        system: system of the links.
        recordings: conditioned recordings.
    """
    refusal = f"{'links' if system.bodies else 'rigid joints'} are not identified"
    positions = np.concatenate([each.q for each in recordings])
    unrecorded_joints = [
        name for name, q in zip(robot.joint_names, positions.T, strict=True) if np.isnan(q).any()
    ]
    if unrecorded_joints:
        return f"{refusal}, since the positions of {', '.join(unrecorded_joints)} were not recorded"
    if any(joint.damper for joint in robot.joints):
        return f"{refusal}, since the damping of the dampers was not recorded"
    equation_count = len(joints) * sum(len(each.time) // each.filter.stride for each in recordings)
    parameter_count = len(system.names)
    if equation_count <= parameter_count:
        return (
            f"{refusal}: {equation_count} equations are too few for {parameter_count} parameters; "
            "record for longer"
        )
    return ""
