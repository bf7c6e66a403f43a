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
        of_links = link_parameter_names(robot)
        self._first = len(of_links)
        self.bodies = int(np.searchsorted(base.kept, self._first))
        every = [*of_links, *map(str, parts)]
        self.names = tuple(base.names(every))
        self.before = base.of(np.concatenate((all_parameters(robot), [each.value for each in parts])))
        units = [*UNITS * len(robot.joints), *(each.unit for each in parts)]
        self.units = tuple(units[at] for at in base.kept)
        alone = np.count_nonzero(base.shares, axis=1) == 1
        self.sums = tuple(
            "" if place >= self.bodies and one else base.words(place, every)
            for place, one in enumerate(alone)
        )

    def of_record(self, values: FloatArray, signals: ConditionedRecording) -> Equations:
        """See `SystemOfEquations.of_record`."""
        robot, bodies = self._robot, self.bodies
        own = self.base.kept[bodies:] - self._first
        of_parts = np.zeros(len(self.parts))
        of_parts[own] = values[bodies:]
        numbers = [
            each._replace(value=float(value)) for each, value in zip(self.parts, of_parts, strict=True)
        ]
        columns = regressor(robot, signals.q, signals.dq, signals.ddq)
        of_links = columns[:, self.base.kept[:bodies]]
        weight = np.einsum("jbs,b->js", of_links, values[:bodies])
        if not bodies:
            weight = np.einsum("jps,p->js", columns, all_parameters(robot))
        found = []
        for index in self.joints:
            torque, of_springs = _carried(robot, index, signals, self._springs)
            resistance, slopes = _resistance(robot, index, joint_motion(signals, index), numbers)
            if np.isfinite(torque).all():
                rows = np.stack(
                    (torque, weight[index] + resistance, *of_links[index], *slopes[own], *of_springs)
                )
                found.append((f"link of {robot.joint_names[index]}", signals.filter.applied(rows.T)))
        together, last = np.concatenate([rows for _, rows in found]), 2 + len(values)
        return Equations(
            measured=together[:, 0],
            predicted=together[:, 1],
            slopes=together[:, 2:last],
            group=np.repeat([name for name, _ in found], [len(rows) for _, rows in found]),
            sample=np.concatenate([np.arange(len(rows)) for _, rows in found]),
            errors=together[:, last:] @ self._errors,
        )

    @property
    def joints(self) -> Sequence[int]:
        """Indices of the joints whose equations contain unknowns."""
        if self.bodies:
            return range(len(self._robot.joints))
        return sorted({each.joint for each in self.parts if each.joint is not None})

    def admissible(self, number: int, value: float) -> float | None:
        """See `SystemOfEquations.admissible`; combinations with link parameters may have any value."""
        if number < self.bodies:
            return value
        return admissible(self._robot, str(self.part(number)), value)

    def part(self, number: int) -> Parameter:
        """Return the parameter of the file after which an unknown beyond the first `bodies` is named."""
        return self.parts[int(self.base.kept[number]) - self._first]


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


SLOWEST = 1e-4
"""Smallest factor of random velocities, at which friction of one width differs from that of another."""


def _link_combinations(robot: Robot, parts: Sequence[Parameter], *, links: bool) -> BaseParameters:
    """Return the combinations of link parameters and further ones that torques of any motion determine."""
    joints, first = len(robot.joints), len(SYMBOLS) * len(robot.joints)
    fast = random_motion(joints)
    slow = fast * np.array([1, 0, 1])[:, None, None]
    slow[1] = fast[1] * np.geomspace(1, SLOWEST, fast.shape[1])[:, None]
    q, dq, ddq = np.concatenate((fast, slow), axis=1)
    columns = np.zeros((joints, first + len(parts), len(q)))
    if links:
        columns[:, :first] = regressor(robot, q, dq, ddq)
    for index in range(joints):
        motion = as_duals({"dq": dq[:, index], "ddq": ddq[:, index]})
        columns[index, first:] = _resistance(robot, index, motion, parts)[1]
    order = np.concatenate((preferred_order(joints), np.arange(first, first + len(parts))))
    return BaseParameters.of_columns(np.moveaxis(columns, 1, -1).reshape(-1, columns.shape[1]), order)


def _best_springs(motors: Sequence[Solution]) -> tuple[list[Parameter], FloatArray | None]:
    """Return spring parameters that predict best, and their errors as sums of independent errors."""
    springs, roots = [], []
    for each in motors:
        assert isinstance(each.system, MotorSystem), "of motors"
        numbers = each.system.sought
        places = [place for place, number in enumerate(numbers) if group_of(number) == SPRINGS]
        covariance = np.zeros((len(numbers),) * 2)
        covariance[np.ix_(each.free, each.free)] = each.fit.covariance
        powers, axes = np.linalg.eigh(covariance[np.ix_(places, places)])
        values = each.system.of_file(each.predicting)
        springs += [numbers[at]._replace(value=float(values[at])) for at in places]
        roots.append(axes * np.sqrt(np.maximum(powers, 0.0)))
    return springs, scipy.linalg.block_diag(*roots) if roots else None


def _carried(
    robot: Robot, index: int, signals: ConditionedRecording, springs: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Return the torque of springs or a rigid drive at a joint, (samples,), and its slopes by springs."""
    actuator = robot.joints[index].actuator
    if not actuator.sprung:
        return signals.tau_motor[:, index, 0], np.zeros((len(springs), len(signals.time)))
    own = [each if each.joint == index else None for each in springs]
    chosen = [each for each in own if each is not None]
    carrying = with_copied_actuator(seeded(robot, chosen).joints[index]).actuator
    torque = carrying.springs_of(joint_motion(signals, index)).tau_e
    slopes = np.zeros((len(springs), len(signals.time)))
    slopes[[each is not None for each in own]] = tangent_of(torque, len(chosen), signals.time.shape)
    return value_of(torque), slopes


def _resistance(
    robot: Robot, index: int, motion: JointVariables, numbers: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Return the resisting torque of a joint and its rigid drive, (samples,), and its slopes."""
    joint = with_copied_actuator(seeded(robot, numbers).joints[index])
    dq: Any = motion.dq
    torque: Any = joint.damping * dq + joint_friction(joint.friction, (dq, 0, 0, 0)).tau
    if not joint.actuator.sprung:
        dtheta, ddtheta = (np.stack([rows] * SIDES) for rows in (dq, motion.ddq))
        torque = torque + shaft_torques(joint.actuator, dtheta, ddtheta, np.zeros_like(dtheta))[0]
    return value_of(torque), tangent_of(torque, len(numbers), np.shape(dq.value))


def without_links(
    robot: Robot, joints: Sequence[int], system: LinkSystem, records: Sequence[ConditionedRecording]
) -> str:
    """Return the reason why a system of links cannot be identified, as a sentence; "" if it can.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        system: system of the links.
        records: conditioned recordings.
    """
    denied = f"{'links' if system.bodies else 'rigid joints'} are not identified"
    positions = np.concatenate([each.q for each in records])
    unknown = [name for name, q in zip(robot.joint_names, positions.T, strict=True) if np.isnan(q).any()]
    if unknown:
        return f"{denied}, since the positions of {', '.join(unknown)} were not recorded"
    if any(joint.damper for joint in robot.joints):
        return f"{denied}, since the damping of the dampers was not recorded"
    rows = len(joints) * sum(len(each.time) // each.filter.stride for each in records)
    count = len(system.names)
    if rows <= count:
        return f"{denied}: {rows} equations are too few for {count} parameters; record for longer"
    return ""
