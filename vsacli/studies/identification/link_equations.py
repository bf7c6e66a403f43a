"""Equations of links: the torque of springs, or of the motor of a rigid joint, is Y pi + damping + friction.

The torque of springs follows from recorded positions by their parameters, which the motors gave before: their
uncertainty is part of that of the links. A rigid joint has motor and link in one equation.
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
"""Title of the system of all of them, and the word by which users ask for it."""

RESISTANCES = ("damping", "friction")
"""Parts of a joint against which its link moves."""


class LinkSystem(SystemOfEquations):
    """Equations of all links whose torque is known: by springs and motors, or by a rigid drive.

    Args:
        robot: the robot, as its file has it.
        base: combinations of the inertial parameters of its links, the first unknowns.
        sought: the others, numbers of the robot.
        springs: numbers of springs that were found before.
        errors: effect of independent errors on these, (springs, errors), each by one standard error.
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
        """Return the value itself unless it is of the robot file, and that may hold no more than zero."""
        if number < len(self.base.kept):
            return value
        return admissible(self._robot, self.names[number], value)

    def without(self, fixed: dict[int, float]) -> LinkSystem:
        """See `SystemOfEquations.without`; only numbers of the file are fixed."""
        robot = self._robot.replace({self.names[number]: value for number, value in fixed.items()})
        first = len(self.base.kept)
        sought = [each for at, each in enumerate(self.sought, first) if at not in fixed]
        return LinkSystem(robot, self.base, sought, self._springs, self._errors)


def link_system(robot: Robot, fit: Sequence[str], motors: Sequence[Solution] = ()) -> LinkSystem:
    """Return the system of a robot's links, with damping and friction of its joints.

    Args:
        robot: as its file has it.
        fit: words and patterns, of which those of motors count where joints are rigid.
        motors: results for motors and springs, which give the torque of springs and its errors.
    """
    sought = [each for each in parameters(robot) if each.part in RESISTANCES]
    for index, joint in enumerate(robot.joints):
        sought += () if joint.actuator.sprung else unknowns(robot, index, fit)
    sought = [each for each in sought if each.path[-1] != WIDTH]
    return LinkSystem(robot, base_parameters(robot), sought, *_springs(robot, motors))


def _springs(robot: Robot, motors: Sequence[Solution]) -> tuple[list[Parameter], FloatArray | None]:
    """Numbers of springs as they predict best, and their errors as sums of independent ones."""
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
    """Torque that springs or a rigid drive bring to a joint, (samples,), and its slopes by springs."""
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
    """Return damping and friction of a joint and its rigid drive, (samples,), and slopes by parameters."""
    joint = apart(seeded(robot, numbers).joints[index])
    motion = joint_motion(signals, index)
    dq = motion["dq"]
    torque: Any = joint.damping * dq + joint_friction(joint.friction, (dq, 0, 0, 0)).tau
    if not joint.actuator.sprung:
        dtheta, ddtheta = (np.stack([motion[name]] * SIDES) for name in ("dq", "ddq"))
        torque = torque + motor_torques(joint.actuator, dtheta, ddtheta, np.zeros_like(dtheta))[0]
    return value_of(torque), tangent_of(torque, len(numbers), signals.time.shape)


def without_links(robot: Robot, joints: Sequence[int], fit: Sequence[str], records: Sequence[Signals]) -> str:
    """Why nothing is found of the links, a sentence; empty if there is no reason.

    Args:
        robot: the robot.
        joints: indices of those that were recorded.
        fit: as of `link_system`.
        records: of its motion.
    """
    positions = np.concatenate([each.q for each in records])
    unknown = [name for name, q in zip(robot.joint_names, positions.T, strict=True) if np.isnan(q).any()]
    if unknown:
        return f"links move each other, and the positions of {', '.join(unknown)} were not recorded"
    if any(joint.damper for joint in robot.joints):
        return "nothing is found of links while there are dampers, whose damping was not recorded"
    rows = len(joints) * sum(len(each.time) // each.filter.stride for each in records)
    count = len(link_system(robot, fit).names)
    if rows <= count:
        return f"{rows} equations are too few for the {count} numbers of the links; record for longer"
    return ""
