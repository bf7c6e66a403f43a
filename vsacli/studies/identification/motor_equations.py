"""Equations of motors behind springs: tau_motor = B theta'' + D theta' + friction + U_theta(q, theta).

These are (73)-(74) with recorded values, and do not contain the links. The unknowns are the parameters of
springs, motors and friction that words or patterns of paths select; `MotorSystem` is the system of one joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError, Problem
from vsacli.compute.duals import Dual, tangent_of, value_of
from vsacli.dynamics.drive import motor_torques
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, apart, parameters, seeded
from vsacli.studies.identification.conditioning import Signals
from vsacli.studies.identification.estimation import Equations
from vsacli.studies.identification.fitted_system import SystemOfEquations

SPRINGS, MOTORS, FRICTION = "springs", "motors", "friction"
GROUPS = (SPRINGS, MOTORS, FRICTION)
"""Names of the groups of parameters."""

FIXED = ("gear_ratio", "torque_constant", "resistance")
"""Motor parameters that are known from the design, and that no torque on the joint side determines."""

WIDTH = "width"

OF_MOTORS = ("motor", "coupled_inertia")
"""Keys in the paths of motor parameters."""


def unknowns(robot: Robot, index: int, fit: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters of one joint's motors and springs to be identified.

    Zero terms of a spring, and a zero width of friction, are identified only if a pattern matches them.

    Args:
        robot: robot as in its file.
        index: index of the joint.
        fit: words of `GROUPS`, and patterns of paths such as `joints.elbow.actuator.spring.*`.
    """
    return tuple(
        each
        for each in parameters(robot)
        if each.joint == index and (group := group_of(each)) and _asked_for(each, group, fit)
    )


def with_friction(robot: Robot, joints: Sequence[int]) -> Robot:
    """Return a robot with zero friction added at motors behind springs that have none, to identify it.

    Args:
        robot: robot as in its file.
        joints: indices of the joints to change.
    """
    paths = [str(each) for each in parameters(robot) if each.joint in joints and group_of(each)]
    sprung = [joint.name for joint in robot.joints if joint.actuator.sprung]
    inertias = [path for path in paths if path.endswith(".inertia") and path.split(".")[1] in sprung]
    frictions = [path.replace(".inertia", f".{FRICTION}") for path in inertias]
    lacking = [each for each in frictions if not any(path.startswith(f"{each}.") for path in paths)]
    return robot.replace({each: {"coulomb": 0.0} for each in lacking})


def admissible(robot: Robot, path: str, value: float) -> float | None:
    """Return a value if the robot file admits it at a path, else zero; None if it admits neither."""
    for each in (value, 0.0):
        try:
            robot.replace(path, each)
        except InputError:
            continue
        return each
    return None


def group_of(parameter: Parameter) -> str | None:
    """Return the group of a parameter of a joint, a word of `GROUPS`; None if it is not identified."""
    place = parameter.path[2:]
    if place[0] != "actuator" or place[-1] in FIXED:
        return None
    if FRICTION in place:
        return FRICTION
    return MOTORS if place[1] in OF_MOTORS else SPRINGS


def _asked_for(parameter: Parameter, group: str, fit: Sequence[str]) -> bool:
    if any(fnmatchcase(str(parameter), pattern) for pattern in fit):
        return True
    absent = parameter.value == 0 and (group == SPRINGS or parameter.path[-1] == WIDTH)
    return group in fit and not absent


def check_fit(robot: Robot, fit: Sequence[str], words: Sequence[str]) -> None:
    """Check that each text is a word or matches a parameter that can be identified.

    Raises:
        InputError: a text is neither; the error suggests similar words.
    """
    paths = [str(each) for each in parameters(robot) if each.joint is not None and group_of(each)]
    problems = []
    for word in fit:
        if word not in words and not any(fnmatchcase(path, word) for path in paths):
            near = nearest(word, [*words, *paths])
            known = word in {str(each) for each in parameters(robot)}
            what = "cannot be identified" if known else "is unknown"
            hint = f"; did you mean {near!r}?" if near else ""
            expected = f"{', '.join(words)}, or the path of a parameter of motors or springs"
            problems.append(Problem("", 0, f"{word!r} {what}; expected {expected}{hint}"))
    if problems:
        raise InputError(problems)


def predicted_torques(actuator: Actuator, motion: dict[str, Any]) -> Any:
    """Return the torques of both motors, (2, samples), from the motion of joint and motors by name.

    They are NaN for a motor that does not exist.
    """
    tau_transmission = actuator.carried(motion).tau_transmission
    missing = np.full((SIDES - len(tau_transmission), *tau_transmission.shape[1:]), np.nan)
    against = np.concatenate((tau_transmission, missing))
    return motor_torques(actuator, motion["dtheta"], motion["ddtheta"], against)


def motor_names(robot: Robot, index: int) -> tuple[str, ...]:
    """Return the names of the motors of a joint in reports."""
    joint = robot.joints[index]
    if len(joint.actuator.motors) == 1:
        return (f"motor of {joint.name}",)
    return tuple(f"motor {number} of {joint.name}" for number, _ in enumerate(joint.actuator.motors, 1))


def joint_motion(signals: Signals, index: int) -> dict[str, Any]:
    """Return the motion of a joint and its motors, samples last, as duals without derivatives."""
    # NumPy functions of duals accept robot parameters that are duals, which those of arrays do not
    return {name: Dual(values, {}) for name, values in _arrays(signals, index).items()}


def _arrays(signals: Signals, index: int) -> dict[str, FloatArray]:
    q, theta = signals.q[:, index], signals.theta[:, index].T
    return {
        "q": q,
        "dq": signals.dq[:, index],
        "ddq": signals.ddq[:, index],
        "theta": theta,
        "phi": theta - q,
        "dtheta": signals.dtheta[:, index].T,
        "ddtheta": signals.ddtheta[:, index].T,
    }


class MotorSystem(SystemOfEquations):
    """Equations of the motors of a joint with springs.

    Args:
        robot: robot as in its file.
        index: index of the joint.
        sought: unknown parameters of the actuator; the others keep their values.
    """

    def __init__(self, robot: Robot, index: int, sought: Sequence[Parameter] = ()) -> None:
        self._robot, self._index, self._sought = robot, index, tuple(sought)
        self.title = robot.joints[index].name
        self.names = tuple(map(str, sought))
        self.units = tuple(each.unit for each in sought)
        self.sums = ("",) * len(self.names)
        self.before = np.array([each.value for each in sought])

    def of_record(self, values: FloatArray, signals: Signals) -> Equations:
        """See `SystemOfEquations.of_record`; only motors with a recorded torque have equations."""
        index, count = self._index, len(self._sought)
        present = [
            each._replace(value=float(value)) for each, value in zip(self._sought, values, strict=True)
        ]
        carrying = apart(seeded(self._robot, present).joints[index]).actuator
        with np.errstate(all="ignore"):  # a step of the search may go too far and is then shortened
            torques = predicted_torques(carrying, joint_motion(signals, index))
        slopes = tangent_of(torques, count, np.shape(value_of(torques)))
        measured = signals.tau_motor[:, index].T
        recorded = [motor for motor in range(SIDES) if not np.isnan(measured[motor]).all()]
        columns = [
            signals.filter.applied(np.stack((measured[motor], value_of(torques)[motor], *slopes[:, motor])).T)
            for motor in recorded
        ]
        rows = len(columns[0]) if columns else 0
        together = np.concatenate([np.empty((0, 2 + count)), *columns])
        names = motor_names(self._robot, index)
        return Equations(
            measured=together[:, 0],
            predicted=together[:, 1],
            slopes=together[:, 2:],
            group=np.repeat([names[motor] for motor in recorded], rows),
            sample=np.tile(np.arange(rows), len(recorded)),
        )

    def admissible(self, number: int, value: float) -> float | None:
        """Return the value if the robot file admits it, else zero; None if it admits neither."""
        return admissible(self._robot, self.names[number], value)

    def without(self, fixed: dict[int, float]) -> MotorSystem:
        """See `SystemOfEquations.without`."""
        robot = self._robot.replace({self.names[number]: value for number, value in fixed.items()})
        return MotorSystem(robot, self._index, [e for n, e in enumerate(self._sought) if n not in fixed])


def motor_systems(
    robot: Robot,
    joints: Sequence[int],
    fit: Sequence[str],
    records: Sequence[Signals],
) -> Iterator[MotorSystem]:
    """Yield the systems of joints with springs that have parameters to identify.

    Spring parameters that change no torque, because they only bound the working range, are left out.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        fit: words and patterns, see `unknowns`.
        records: conditioned recordings.
    """
    for index in joints:
        sought = unknowns(robot, index, fit) if robot.joints[index].actuator.sprung else ()
        if not sought:
            continue
        system = MotorSystem(robot, index, sought)
        slopes = [system.of_record(system.before, each).slopes for each in records]
        acts = np.any(np.concatenate(slopes) != 0, axis=0)
        left = [each for each, does in zip(sought, acts, strict=True) if does or group_of(each) != SPRINGS]
        if left:
            yield MotorSystem(robot, index, left)
