"""Equations of links: the torque of springs, or of the motor of a rigid joint, is Y pi + damping + friction.

The torque of springs follows from recorded positions and the spring parameters, which the equations of motors
gave before; their uncertainty adds to that of the links. A rigid joint has motor and link in one equation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.compute.duals import tangent_of, value_of
from vsacli.dynamics.drive import motor_torques
from vsacli.dynamics.dry_friction import joint_friction
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, apart, parameters, seeded
from vsacli.studies.identification.conditioning import Signals
from vsacli.studies.identification.estimation import Equations
from vsacli.studies.identification.fitted_system import Solution, SystemOfEquations
from vsacli.studies.identification.motor_equations import (
    SPRINGS,
    WIDTH,
    admissible,
    group_of,
    joint_motion,
    unknowns,
)
from vsacli.studies.identification.regressor import (
    SYMBOLS,
    UNITS,
    BaseParameters,
    all_parameters,
    base_parameters,
    names,
    regressor,
)

LINKS = "links"
"""Title of the system of all links, and its word in `fit`."""

RESISTANCES = ("damping", "friction")
"""Parts of a joint that resist the motion of its link."""


class LinkSystem(SystemOfEquations):
    """Equations of all links whose torque is known, from springs or from a rigid drive.

    Args:
        robot: robot as in its file.
        base: base parameters of its links, the first unknowns.
        sought: further unknowns, parameters of the robot file.
        springs: spring parameters identified before.
        errors: effect of independent errors, of one standard error each, on `springs`, (springs, errors).
    """

    def __init__(
        self,
        robot: Robot,
        base: BaseParameters,
        sought: Sequence[Parameter],
        springs: Sequence[Parameter] = (),
        errors: FloatArray | None = None,
    ) -> None:
        self.title, self.base, self.sought = LINKS, base, tuple(sought)
        self._robot, self._springs = robot, tuple(springs)
        self._errors = np.zeros((0, 0)) if errors is None else errors
        self.names = (*base.names(names(robot)), *map(str, sought))
        self.before = np.concatenate((base.of(all_parameters(robot)), [each.value for each in sought]))
        of_base = [UNITS[at % len(SYMBOLS)] for at in base.kept]
        self.units = (*of_base, *(each.unit for each in sought))
        words = (base.words(place, names(robot)) for place in range(len(of_base)))
        self.sums = (*words, *[""] * len(self.sought))

    def of_record(self, values: FloatArray, signals: Signals) -> Equations:
        """See `SystemOfEquations.of_record`."""
        count, robot = len(self.base.kept), self._robot
        numbers = [
            each._replace(value=float(value)) for each, value in zip(self.sought, values[count:], strict=True)
        ]
        columns = regressor(robot, signals.q, signals.dq, signals.ddq)[:, self.base.kept]
        found = []
        for index, joint in enumerate(robot.joints):
            torque, of_springs = _carried(robot, index, signals, self._springs)
            resistance, slopes = _resistance(robot, index, signals, numbers)
            if np.isfinite(torque).all():
                taken = values[:count] @ columns[index] + resistance
                of_joint = np.stack((torque, taken, *columns[index], *slopes, *of_springs))
                found.append((f"link of {joint.name}", signals.filter.applied(of_joint.T)))
        together, last = np.concatenate([rows for _, rows in found]), 2 + len(values)
        return Equations(
            measured=together[:, 0],
            predicted=together[:, 1],
            slopes=together[:, 2:last],
            group=np.repeat([name for name, _ in found], [len(rows) for _, rows in found]),
            sample=np.concatenate([np.arange(len(rows)) for _, rows in found]),
            errors=together[:, last:] @ self._errors,
        )

    def admissible(self, number: int, value: float) -> float | None:
        """See `SystemOfEquations.admissible`; base parameters may have any value."""
        if number < len(self.base.kept):
            return value
        return admissible(self._robot, self.names[number], value)

    def without(self, fixed: dict[int, float]) -> LinkSystem:
        """See `SystemOfEquations.without`; only parameters of the file can be fixed."""
        robot = self._robot.replace({self.names[number]: value for number, value in fixed.items()})
        first = len(self.base.kept)
        sought = [each for at, each in enumerate(self.sought, first) if at not in fixed]
        return LinkSystem(robot, self.base, sought, self._springs, self._errors)


def link_system(robot: Robot, fit: Sequence[str], motors: Sequence[Solution] = ()) -> LinkSystem:
    """Return the system of a robot's links, with damping and friction of its joints.

    Args:
        robot: robot as in its file.
        fit: words and patterns; those for motors count for rigid joints.
        motors: solutions of motors and springs, which give the torque of springs and its errors.
    """
    sought = [each for each in parameters(robot) if each.part in RESISTANCES]
    for index, joint in enumerate(robot.joints):
        sought += () if joint.actuator.sprung else unknowns(robot, index, fit)
    sought = [each for each in sought if each.path[-1] != WIDTH]
    return LinkSystem(robot, base_parameters(robot), sought, *_springs(robot, motors))


def _springs(robot: Robot, motors: Sequence[Solution]) -> tuple[list[Parameter], FloatArray | None]:
    """Return spring parameters that predict best, and their errors as sums of independent errors."""
    from scipy.linalg import block_diag

    known, springs, roots = {str(each): each for each in parameters(robot)}, [], []
    for each in motors:
        numbers = [known[name] for name in each.system.names]
        places = [place for place, number in enumerate(numbers) if group_of(number) == SPRINGS]
        covariance = np.zeros((len(numbers),) * 2)
        covariance[np.ix_(each.free, each.free)] = each.fit.covariance
        powers, axes = np.linalg.eigh(covariance[np.ix_(places, places)])
        springs += [numbers[at]._replace(value=float(each.predicting[at])) for at in places]
        roots.append(axes * np.sqrt(np.maximum(powers, 0.0)))
    return springs, block_diag(*roots) if roots else None


def _carried(
    robot: Robot, index: int, signals: Signals, springs: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Return the torque of springs or a rigid drive at a joint, (samples,), and its slopes by springs."""
    actuator = robot.joints[index].actuator
    if not actuator.sprung:
        return signals.tau_motor[:, index, 0], np.zeros((len(springs), len(signals.time)))
    own = [each if each.joint == index else None for each in springs]
    chosen = [each for each in own if each is not None]
    carrying = apart(seeded(robot, chosen).joints[index]).actuator
    torque = carrying.carried(joint_motion(signals, index)).tau_e
    slopes = np.zeros((len(springs), len(signals.time)))
    slopes[[each is not None for each in own]] = tangent_of(torque, len(chosen), signals.time.shape)
    return value_of(torque), slopes


def _resistance(
    robot: Robot, index: int, signals: Signals, numbers: Sequence[Parameter]
) -> tuple[FloatArray, FloatArray]:
    """Return the resisting torque of a joint and its rigid drive, (samples,), and its slopes."""
    joint = apart(seeded(robot, numbers).joints[index])
    motion = joint_motion(signals, index)
    dq = motion["dq"]
    torque: Any = joint.damping * dq + joint_friction(joint.friction, (dq, 0, 0, 0)).tau
    if not joint.actuator.sprung:
        dtheta, ddtheta = (np.stack([motion[name]] * SIDES) for name in ("dq", "ddq"))
        torque = torque + motor_torques(joint.actuator, dtheta, ddtheta, np.zeros_like(dtheta))[0]
    return value_of(torque), tangent_of(torque, len(numbers), signals.time.shape)


def without_links(robot: Robot, joints: Sequence[int], fit: Sequence[str], records: Sequence[Signals]) -> str:
    """Return the reason why links cannot be identified, as a sentence; "" if they can.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        fit: see `link_system`.
        records: conditioned recordings.
    """
    positions = np.concatenate([each.q for each in records])
    unknown = [name for name, q in zip(robot.joint_names, positions.T, strict=True) if np.isnan(q).any()]
    if unknown:
        return f"links are not identified, since the positions of {', '.join(unknown)} were not recorded"
    if any(joint.damper for joint in robot.joints):
        return "links are not identified, since the damping of the dampers was not recorded"
    rows = len(joints) * sum(len(each.time) // each.filter.stride for each in records)
    count = len(link_system(robot, fit).names)
    if rows <= count:
        few = f"{rows} equations are too few for {count} parameters"
        return f"links are not identified: {few}; record for longer"
    return ""
