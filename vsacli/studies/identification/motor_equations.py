"""Equations of motors behind springs: tau_motor = B theta'' + D theta' + friction + U_theta(q, theta).

These are (73)-(74) with recorded values, and do not contain the links. The unknowns are the parameters of
springs, motors and friction that words or patterns of paths select; `MotorSystem` is the system of one joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError, Problem
from vsacli.compute.duals import Dual, tangent_of, value_of
from vsacli.dynamics.drive import shaft_torques
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters, seeded, with_copied_actuator
from vsacli.studies.identification.conditioning import ConditionedRecording
from vsacli.studies.identification.estimation import Equations
from vsacli.studies.identification.fitted_system import CERTAIN, Solution, SystemOfEquations
from vsacli.studies.identification.regressor import BaseParameters

SPRINGS, MOTORS, FRICTION, LINKS = "springs", "motors", "friction", "links"
GROUPS = (SPRINGS, MOTORS, FRICTION)
"""Names of the groups of parameters of actuators."""

FIXED = ("gear_ratio", "torque_constant", "resistance")
"""Motor parameters that are known from the design, and that no torque on the joint side determines."""

WIDTH = "width"

OF_MOTORS = ("motor", "coupled_inertia")
"""Keys in the paths of motor parameters."""

RESISTANCES = ("damping", FRICTION)
"""Parts of a joint that resist the motion of its link."""


def unknowns(robot: Robot, index: int, fit: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters of one joint's springs, motors, damping and friction to be identified.

    Terms that are zero in the file are identified only if a pattern matches them, except the Coulomb friction
    and the offset of a motor.

    Args:
        robot: robot as in its file.
        index: index of the joint.
        fit: words of `GROUPS`, `LINKS` for damping and friction of the joint, and patterns of paths such as
            `joints.elbow.actuator.spring.*`.
    """
    rigid = not robot.joints[index].actuator.sprung
    return tuple(
        each
        for each in parameters(robot)
        if each.joint == index and (group := group_of(each)) and _asked_for(each, group, fit, rigid=rigid)
    )


def with_friction(robot: Robot, joints: Sequence[int]) -> Robot:
    """Return a robot with zero friction added at motors behind springs that have none, to identify it.

    Args:
        robot: robot as in its file.
        joints: indices of the joints to change.
    """
    of_joints = [each for each in parameters(robot) if each.joint in joints]
    paths = [str(each) for each in of_joints if group_of(each) in GROUPS]
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
    """Return the group of a parameter of a joint: a word of `GROUPS`, `LINKS`, or None if not identified."""
    place = parameter.path[2:]
    if place[0] in RESISTANCES:
        return LINKS if place[-1] != WIDTH else None
    if place[0] != "actuator" or place[-1] in FIXED:
        return None
    if FRICTION in place:
        return FRICTION
    return MOTORS if place[1] in OF_MOTORS else SPRINGS


def _asked_for(parameter: Parameter, group: str, fit: Sequence[str], *, rigid: bool) -> bool:
    if any(fnmatchcase(str(parameter), pattern) for pattern in fit):
        return True
    absent = parameter.value == 0 and (group != FRICTION or parameter.path[-1] == WIDTH)
    # friction of a rigid joint is that of its motor as well
    return not absent and (group in fit or (rigid and parameter.part == FRICTION and FRICTION in fit))


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
            expected = f"{', '.join(words)}, or the path of a parameter of motors, springs or friction"
            problems.append(Problem("", 0, f"{word!r} {what}; expected {expected}{hint}"))
    if problems:
        raise InputError(problems)


def describe_lack(robot: Robot, joints: Sequence[int], fit: Sequence[str]) -> str:
    """Return a sentence on recorded joints without any of the requested parameters, and those they have."""
    kinds: dict[str, dict[str, None]] = {}
    for each in parameters(robot):
        if each.joint in joints and (group := group_of(each)) and each.value:
            kinds.setdefault(group, {})[".".join(each.of_every_joint.split(".")[2:])] = None
    listed = "; ".join(f"{group}: {', '.join(names)}" for group, names in kinds.items())
    lacking = f"the recorded joints have none of the parameters to identify ({', '.join(fit)})"
    return f"{lacking}; they have {listed}; zero terms are identified if their paths are given"


def predicted_torques(actuator: Actuator, motion: JointVariables) -> Any:
    """Return the torques of both motors, (2, samples), from the motion of joint and motors.

    They are NaN for a motor that does not exist.
    """
    tau_transmission = np.stack(actuator.springs_of(motion).tau_transmission)
    missing = np.full((SIDES - len(tau_transmission), *tau_transmission.shape[1:]), np.nan)
    against = np.concatenate((tau_transmission, missing))
    return shaft_torques(actuator, motion.dtheta, motion.ddtheta, against)


def motor_names(robot: Robot, index: int) -> tuple[str, ...]:
    """Return the names of the motors of a joint in reports."""
    joint = robot.joints[index]
    if len(joint.actuator.motors) == 1:
        return (f"motor of {joint.name}",)
    return tuple(f"motor {number} of {joint.name}" for number, _ in enumerate(joint.actuator.motors, 1))


def joint_motion(signals: ConditionedRecording, index: int) -> JointVariables:
    """Return the motion of a joint and its motors, samples last, as duals without derivatives."""
    # NumPy functions of duals accept robot parameters that are duals, which those of arrays do not
    return as_duals(_motor_arrays(signals, index))


def as_duals(arrays: Mapping[str, FloatArray]) -> JointVariables:
    """Return the motion of a joint from arrays by name, as duals without derivatives."""
    motion: dict[str, Any] = {name: Dual(values, {}) for name, values in arrays.items()}
    return JointVariables(**motion)


def _motor_arrays(signals: ConditionedRecording, index: int) -> dict[str, FloatArray]:
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
        parts: unknown parameters of the actuator; the others keep their values.
        base: combinations of the parts that any motion determines; by default each part is one.

    Attributes:
        sought: first part of each combination, in the order of the unknowns; other parts keep their values.
    """

    def __init__(
        self,
        robot: Robot,
        index: int,
        parts: Sequence[Parameter] = (),
        base: BaseParameters | None = None,
    ) -> None:
        base = base or BaseParameters(np.arange(len(parts)), np.eye(len(parts)))
        self._robot, self._index = robot, index
        self.title, words = robot.joints[index].name, list(map(str, parts))
        self.sought = tuple(parts[at] for at in base.kept)
        self.names = tuple(base.names(words))
        self.units = tuple(each.unit for each in self.sought)
        self.sums = tuple(
            base.words(place, words) if self.names[place] != words[at] else ""
            for place, at in enumerate(base.kept)
        )
        self.before = base.of(np.array([each.value for each in parts]))
        self._of_others = self.before - np.array([each.value for each in self.sought])

    def of_file(self, values: FloatArray) -> FloatArray:
        """Return the values of `sought` in a file that keeps the other parts, (unknowns,)."""
        return np.asarray(values - self._of_others)

    def of_record(self, values: FloatArray, signals: ConditionedRecording) -> Equations:
        """See `SystemOfEquations.of_record`; only motors with a recorded torque have equations."""
        index, count = self._index, len(self.sought)
        present = [
            each._replace(value=float(value))
            for each, value in zip(self.sought, self.of_file(values), strict=True)
        ]
        carrying = with_copied_actuator(seeded(self._robot, present).joints[index]).actuator
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
        """Return the value if the robot file admits it, else that of zero; None if it admits neither."""
        of_others = float(self._of_others[number])
        nearest = admissible(self._robot, str(self.sought[number]), value - of_others)
        return value if nearest == value - of_others else None if nearest is None else of_others


def values_of_sums(found: Solution) -> dict[str, float]:
    """Return values of parameters of the file, by path, with the sums found for a joint's motors.

    The first parameter of a sum changes, the others keep their values. Of parameters that the recordings do
    not distinguish, all keep them if their sum agrees with the file, or if no admissible values have it.
    """
    system, best = found.system, found.predicting
    assert isinstance(system, MotorSystem), "of motors"
    errors = dict(zip(found.free, found.fit.standard_errors, strict=True))
    sums = [
        [number] for number, words in enumerate(system.sums) if words and np.isfinite(errors.get(number, 0.0))
    ]
    for each in found.fit.inseparable:
        numbers = [found.free[at] for at, _ in each.terms]
        of_file = sum(factor * system.before[found.free[at]] for at, factor in each.terms)
        if abs(each.value - of_file) > CERTAIN * each.standard_error:
            sums.append(numbers)
    values = system.of_file(best)
    return {
        str(system.sought[number]): float(values[number])
        for numbers in sums
        if all(system.admissible(each, float(best[each])) == best[each] for each in numbers)
        for number in numbers
    }


def motor_systems(
    robot: Robot,
    joints: Sequence[int],
    fit: Sequence[str],
    records: Sequence[ConditionedRecording],
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
        sought = [each for each in unknowns(robot, index, fit) if group_of(each) != LINKS]
        if not (sought and robot.joints[index].actuator.sprung):
            continue
        system = MotorSystem(robot, index, sought)
        slopes = [system.of_record(system.before, each).slopes for each in records]
        acts = np.any(np.concatenate(slopes) != 0, axis=0)
        left = [each for each, does in zip(sought, acts, strict=True) if does or group_of(each) != SPRINGS]
        if left:
            yield MotorSystem(robot, index, left, _motor_combinations(robot, index, left, records))


NEARBY = 0.1
"""Random change of recorded deflections, relative to each, at which parameters that no motion distinguishes
are found: deflections at constant stiffness would hide that others distinguish them."""

SAMPLES = 100
"""Number of random motions of a joint at which they are found, more than an actuator has parameters."""


def _motor_combinations(
    robot: Robot, index: int, parts: Sequence[Parameter], records: Sequence[ConditionedRecording]
) -> BaseParameters | None:
    """Return the combinations of parameters that motor torques of any motion determine; None if unknown."""
    random = np.random.default_rng(0)
    recorded = [_motor_arrays(each, index) for each in records]
    q, phi = (np.concatenate([each[name] for each in recorded], axis=-1) for name in ("q", "phi"))
    chosen = random.integers(len(q), size=SAMPLES)
    phi = phi[:, chosen] * (1 + NEARBY * random.uniform(-1, 1, (SIDES, SAMPLES)))
    dtheta, ddtheta = random.uniform(-1, 1, (2, SIDES, SAMPLES))
    dtheta *= np.geomspace(1, 1e-4, SAMPLES)  # of all sizes, as widths of friction are
    arrays = {"q": q[chosen], "phi": phi, "theta": q[chosen] + phi, "dtheta": dtheta, "ddtheta": ddtheta}
    carrying = with_copied_actuator(seeded(robot, parts).joints[index]).actuator
    with np.errstate(all="ignore"):  # a deflection nearby may be out of reach
        torques = predicted_torques(carrying, as_duals(arrays))
    columns = tangent_of(torques, len(parts), np.shape(value_of(torques))).reshape(len(parts), -1).T
    columns = columns[np.isfinite(columns).all(axis=1)]
    return BaseParameters.of_columns(columns, np.arange(len(parts))) if columns.any(axis=0).all() else None
