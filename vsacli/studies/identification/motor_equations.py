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
from vsacli.studies.identification.fitted_system import CONTRADICTING_ERRORS, Solution, SystemOfEquations
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
        if each.joint == index and (group := group_of(each)) and _is_requested(each, group, fit, rigid=rigid)
    )


def with_friction(robot: Robot, joints: Sequence[int]) -> Robot:
    """Return a robot with zero friction added at motors behind springs that have none, to identify it.

    Args:
        robot: robot as in its file.
        joints: indices of the joints to change.
    """
    joint_parameters = [each for each in parameters(robot) if each.joint in joints]
    paths = [str(each) for each in joint_parameters if group_of(each) in GROUPS]
    sprung = [joint.name for joint in robot.joints if joint.actuator.sprung]
    inertias = [path for path in paths if path.endswith(".inertia") and path.split(".")[1] in sprung]
    frictions = [path.replace(".inertia", f".{FRICTION}") for path in inertias]
    missing_frictions = [each for each in frictions if not any(path.startswith(f"{each}.") for path in paths)]
    return robot.replace({each: {"coulomb": 0.0} for each in missing_frictions})


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
    joint_path = parameter.path[2:]
    if joint_path[0] in RESISTANCES:
        return LINKS if joint_path[-1] != WIDTH else None
    if joint_path[0] != "actuator" or joint_path[-1] in FIXED:
        return None
    if FRICTION in joint_path:
        return FRICTION
    return MOTORS if joint_path[1] in OF_MOTORS else SPRINGS


def _is_requested(parameter: Parameter, group: str, fit: Sequence[str], *, rigid: bool) -> bool:
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
            suggestion = nearest(word, [*words, *paths])
            exists = word in {str(each) for each in parameters(robot)}
            problem = "cannot be identified" if exists else "is unknown"
            hint = f"; did you mean {suggestion!r}?" if suggestion else ""
            expected = f"{', '.join(words)}, or the path of a parameter of motors, springs or friction"
            problems.append(Problem("", 0, f"{word!r} {problem}; expected {expected}{hint}"))
    if problems:
        raise InputError(problems)


def describe_lack(robot: Robot, joints: Sequence[int], fit: Sequence[str]) -> str:
    """Return a sentence on recorded joints without any of the requested parameters, and those they have."""
    names_by_group: dict[str, dict[str, None]] = {}
    for each in parameters(robot):
        if each.joint in joints and (group := group_of(each)) and each.value:
            names_by_group.setdefault(group, {})[".".join(each.of_every_joint.split(".")[2:])] = None
    listed = "; ".join(f"{group}: {', '.join(names)}" for group, names in names_by_group.items())
    sentence = f"the recorded joints have none of the parameters to identify ({', '.join(fit)})"
    return f"{sentence}; they have {listed}; zero terms are identified if their paths are given"


def predicted_torques(actuator: Actuator, motion: JointVariables) -> Any:
    """Return the torques of both motors, (2, samples), from the motion of joint and motors.

    They are NaN for a motor that does not exist.
    """
    tau_transmission = np.stack(actuator.springs_of(motion).tau_transmission)
    missing_motors = np.full((SIDES - len(tau_transmission), *tau_transmission.shape[1:]), np.nan)
    load_torques = np.concatenate((tau_transmission, missing_motors))
    return shaft_torques(actuator, motion.dtheta, motion.ddtheta, load_torques)


def motor_names(robot: Robot, index: int) -> tuple[str, ...]:
    """Return the names of the motors of a joint in reports."""
    joint = robot.joints[index]
    if len(joint.actuator.motors) == 1:
        return (f"motor of {joint.name}",)
    return tuple(f"motor {number} of {joint.name}" for number, _ in enumerate(joint.actuator.motors, 1))


def joint_motion(recording: ConditionedRecording, index: int) -> JointVariables:
    """Return the motion of a joint and its motors, samples last, as duals without derivatives."""
    # NumPy functions of duals accept robot parameters that are duals, which those of arrays do not
    return as_duals(_motor_arrays(recording, index))


def as_duals(arrays: Mapping[str, FloatArray]) -> JointVariables:
    """Return the motion of a joint from arrays by name, as duals without derivatives."""
    motion: dict[str, Any] = {name: Dual(values, {}) for name, values in arrays.items()}
    return JointVariables(**motion)


def _motor_arrays(recording: ConditionedRecording, index: int) -> dict[str, FloatArray]:
    q, theta = recording.q[:, index], recording.theta[:, index].T
    return {
        "q": q,
        "dq": recording.dq[:, index],
        "ddq": recording.ddq[:, index],
        "theta": theta,
        "phi": theta - q,
        "dtheta": recording.dtheta[:, index].T,
        "ddtheta": recording.ddtheta[:, index].T,
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
        self.title, part_names = robot.joints[index].name, list(map(str, parts))
        self.sought = tuple(parts[at] for at in base.kept)
        self.names = tuple(base.names(part_names))
        self.units = tuple(each.unit for each in self.sought)
        self.sums = tuple(
            base.words(place, part_names) if self.names[place] != part_names[at] else ""
            for place, at in enumerate(base.kept)
        )
        self.before = base.of(np.array([each.value for each in parts]))
        self._other_parts = self.before - np.array([each.value for each in self.sought])

    def of_file(self, values: FloatArray) -> FloatArray:
        """Return the values of `sought` in a file that keeps the other parts, (unknowns,)."""
        return np.asarray(values - self._other_parts)

    def of_record(self, values: FloatArray, recording: ConditionedRecording) -> Equations:
        """See `SystemOfEquations.of_record`; only motors with a recorded torque have equations."""
        index, unknown_count = self._index, len(self.sought)
        parameters_at_values = [
            each._replace(value=float(value))
            for each, value in zip(self.sought, self.of_file(values), strict=True)
        ]
        seeded_actuator = with_copied_actuator(
            seeded(self._robot, parameters_at_values).joints[index]
        ).actuator
        with np.errstate(all="ignore"):  # a step of the search may go too far and is then shortened
            torques = predicted_torques(seeded_actuator, joint_motion(recording, index))
        slopes = tangent_of(torques, unknown_count, np.shape(value_of(torques)))
        measured = recording.tau_motor[:, index].T
        recorded_motors = [motor for motor in range(SIDES) if not np.isnan(measured[motor]).all()]
        columns = [
            recording.filter.applied(
                np.stack((measured[motor], value_of(torques)[motor], *slopes[:, motor])).T
            )
            for motor in recorded_motors
        ]
        row_count = len(columns[0]) if columns else 0
        stacked_rows = np.concatenate([np.empty((0, 2 + unknown_count)), *columns])
        names = motor_names(self._robot, index)
        return Equations(
            measured=stacked_rows[:, 0],
            predicted=stacked_rows[:, 1],
            slopes=stacked_rows[:, 2:],
            group=np.repeat([names[motor] for motor in recorded_motors], row_count),
            sample=np.tile(np.arange(row_count), len(recorded_motors)),
        )

    def admissible(self, index: int, value: float) -> float | None:
        """Return the value if the robot file admits it, else that of zero; None if it admits neither."""
        other_parts = float(self._other_parts[index])
        nearest = admissible(self._robot, str(self.sought[index]), value - other_parts)
        return value if nearest == value - other_parts else None if nearest is None else other_parts


def values_of_sums(solution: Solution) -> dict[str, float]:
    """Return values of parameters of the file, by path, with the sums found for a joint's motors.

    The first parameter of a sum changes, the others keep their values. Of parameters that the recordings do
    not distinguish, all keep them if their sum agrees with the file, or if no admissible values have it.
    """
    system, best_values = solution.system, solution.predicting
    assert isinstance(system, MotorSystem), "of motors"
    errors = dict(zip(solution.free, solution.fit.standard_errors, strict=True))
    sums = [
        [number] for number, words in enumerate(system.sums) if words and np.isfinite(errors.get(number, 0.0))
    ]
    for each in solution.fit.inseparable:
        indices = [solution.free[at] for at, _ in each.terms]
        file_sum = sum(factor * system.before[solution.free[at]] for at, factor in each.terms)
        if abs(each.value - file_sum) > CONTRADICTING_ERRORS * each.standard_error:
            sums.append(indices)
    values = system.of_file(best_values)
    return {
        str(system.sought[number]): float(values[number])
        for indices in sums
        if all(system.admissible(each, float(best_values[each])) == best_values[each] for each in indices)
        for number in indices
    }


def motor_systems(
    robot: Robot,
    joints: Sequence[int],
    fit: Sequence[str],
    recordings: Sequence[ConditionedRecording],
) -> Iterator[MotorSystem]:
    """Yield the systems of joints with springs that have parameters to identify.

    Spring parameters that change no torque, because they only bound the working range, are left out.

    Args:
        robot: robot as in its file.
        joints: indices of the recorded joints.
        fit: words and patterns, see `unknowns`.
        recordings: conditioned recordings.
    """
    for index in joints:
        parts = [each for each in unknowns(robot, index, fit) if group_of(each) != LINKS]
        if not (parts and robot.joints[index].actuator.sprung):
            continue
        system = MotorSystem(robot, index, parts)
        slopes = [system.of_record(system.before, each).slopes for each in recordings]
        has_effect = np.any(np.concatenate(slopes) != 0, axis=0)
        effective_parts = [
            each for each, does in zip(parts, has_effect, strict=True) if does or group_of(each) != SPRINGS
        ]
        if effective_parts:
            yield MotorSystem(
                robot, index, effective_parts, _motor_combinations(robot, index, effective_parts, recordings)
            )


DEFLECTION_CHANGE = 0.1
"""Random change of recorded deflections, relative to each, at which parameters that no motion distinguishes
are found: deflections at constant stiffness would hide that others distinguish them."""

SAMPLES = 100
"""Number of random motions of a joint at which they are found, more than an actuator has parameters."""


def _motor_combinations(
    robot: Robot, index: int, parts: Sequence[Parameter], recordings: Sequence[ConditionedRecording]
) -> BaseParameters | None:
    """Return the combinations of parameters that motor torques of any motion determine; None if unknown."""
    random = np.random.default_rng(0)
    motor_arrays = [_motor_arrays(each, index) for each in recordings]
    q, phi = (np.concatenate([each[name] for each in motor_arrays], axis=-1) for name in ("q", "phi"))
    sample_indices = random.integers(len(q), size=SAMPLES)
    phi = phi[:, sample_indices] * (1 + DEFLECTION_CHANGE * random.uniform(-1, 1, (SIDES, SAMPLES)))
    dtheta, ddtheta = random.uniform(-1, 1, (2, SIDES, SAMPLES))
    dtheta *= np.geomspace(1, 1e-4, SAMPLES)  # of all sizes, as widths of friction are
    arrays = {
        "q": q[sample_indices],
        "phi": phi,
        "theta": q[sample_indices] + phi,
        "dtheta": dtheta,
        "ddtheta": ddtheta,
    }
    seeded_actuator = with_copied_actuator(seeded(robot, parts).joints[index]).actuator
    with np.errstate(all="ignore"):  # a deflection nearby may be out of reach
        torques = predicted_torques(seeded_actuator, as_duals(arrays))
    columns = tangent_of(torques, len(parts), np.shape(value_of(torques))).reshape(len(parts), -1).T
    columns = columns[np.isfinite(columns).all(axis=1)]
    return BaseParameters.of_columns(columns, np.arange(len(parts))) if columns.any(axis=0).all() else None
