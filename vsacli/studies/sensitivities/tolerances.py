"""Tolerances of the parameters of a robot, and Monte Carlo runs of robots drawn from them."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.analysis.run_dynamics import RunDynamics
from vsacli.analysis.variant_groups import BATCH_SAMPLES, PreparedRun, batches, numbers_as_rows
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag, has_flag
from vsacli.base.json_records import Published
from vsacli.base.variables import Block
from vsacli.compute.engine import choose_engine
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import LARGEST
from vsacli.documents.number import PER_CENT, evaluate
from vsacli.documents.source import Problems, read_source
from vsacli.documents.tree import MapNode, Node, TextNode, parse_yaml
from vsacli.dynamics.inverse import adapt_trajectory, compute_block, usual_block
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, no_match
from vsacli.trajectory.trajectory import Trajectory

RELATIVE = 0.01
"""Relative change of most parameters."""

SMALL_CHANGES: Mapping[units.Quantity, tuple[float, str]] = {
    units.LENGTH: (1e-3, "1 mm"),
    units.ANGLE: (math.radians(1), "1 deg"),
}
"""Absolute change, and its text, of quantities that are often zero: a relative change is meaningless."""


def step_of(parameter: Parameter) -> float:
    """Return the change of a parameter, in SI units; zero for a zero with a relative change."""
    change, _ = SMALL_CHANGES.get(parameter.quantity, (RELATIVE * abs(parameter.value), ""))
    return change


def words_of(parameter: Parameter) -> str:
    """Return the change of a parameter as text."""
    _, words = SMALL_CHANGES.get(parameter.quantity, (0.0, f"{100 * RELATIVE:g} %"))
    return words


FORM = "e.g. {normal: 5 %} or {uniform: 0.001}"
CONTENT = (
    "a tolerances file, which maps parameter paths to distributions, e.g. joints.*.link.mass: {normal: 2 %}"
)
_PLAIN = re.compile(r"[-+.\d]+(e[-+]?\d+)?|nan|inf", re.IGNORECASE)


class Tolerance(NamedTuple):
    """The distribution of a parameter about its value.

    Attributes:
        shape: `normal` or `uniform`.
        size: standard deviation of a normal, half width of a uniform distribution, SI units.
    """

    shape: str
    size: float

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return self.size if self.shape == "normal" else self.size / math.sqrt(3)

    def drawn(self, random: np.random.Generator) -> float:
        """Return a random deviation from the value."""
        if self.shape == "normal":
            return float(random.normal(0.0, self.size))
        return float(random.uniform(-self.size, self.size))

    def below(self, share: float) -> float:
        """Return the quantile: the deviation below which a share of all deviations lies."""
        if self.shape == "normal":
            return self.size * float(scipy.special.ndtri(share))
        return self.size * (2 * share - 1)


SHAPES = ("normal", "uniform")


def tolerances_of(text: str, parameters: Sequence[Parameter]) -> tuple[Tolerance | None, ...]:
    """Return the tolerance of each parameter; None for exact ones.

    Args:
        text: share such as `5 %` or `0.05`, or path of a YAML file that maps parameter paths to
            distributions; `*` in a path matches anything, and the last matching entry counts.
        parameters: parameters. A share does not apply to angles and lengths of links, which are often zero;
            these remain exact.

    Raises:
        InputError: an entry is not a distribution, or matches no parameter; with file and line.
    """
    share_text = text.strip()
    if share := PER_CENT.fullmatch(share_text):
        relative_size = _share_of_percent(share["number"], share_text)
    elif _PLAIN.fullmatch(share_text):
        relative_size = _tolerance_number(share_text, share_text)
        if relative_size > 1:  # more likely percent than a multiple
            raise InputError.one(
                f"{share_text!r} has no unit; write {share_text}% for all parameters, or name a YAML file"
            )
    else:
        return _read_tolerances(text, parameters)
    is_exact = [each.quantity in SMALL_CHANGES or each.value == 0 for each in parameters]
    return tuple(
        None if known else Tolerance("normal", relative_size * abs(each.value))
        for each, known in zip(parameters, is_exact, strict=True)
    )


def tolerance_deviations(tolerances: Sequence[Tolerance | None]) -> FloatArray:
    """Return the standard deviation of each parameter, zero for exact ones."""
    return np.array([0.0 if each is None else each.deviation for each in tolerances])


def _read_tolerances(
    path: str | os.PathLike[str], parameters: Sequence[Parameter]
) -> tuple[Tolerance | None, ...]:
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    if not isinstance(root, MapNode):
        problems.fail(root.line, f"expected {CONTENT}, found {root}")
    format_node = root.entries.get("format")
    if isinstance(format_node, TextNode):
        kind = format_node.text.removeprefix("vsacli-").partition("/")[0]
        raise InputError.one(f"is a {kind}; expected {CONTENT}", source.path)
    tolerances: list[Tolerance | None] = [None] * len(parameters)
    for pattern, node in root.entries.items():
        line = root.key_lines[pattern]
        matching_indices = [index for index, each in enumerate(parameters) if fnmatchcase(str(each), pattern)]
        if not matching_indices:
            problems.add(line, no_match(pattern, parameters))
        for index in matching_indices:
            try:
                tolerances[index] = distribution(node, parameters[index].value, parameters[index].unit)
            except InputError as error:
                problems.add(node.line, f"{pattern}: {error}")
                break
    problems.check()
    return tuple(tolerances)


def distribution(node: Node, value: float, unit: str) -> Tolerance:
    """Return the tolerance that an entry of a file gives to a value.

    Args:
        node: content of the entry, such as `{normal: 5 %}`.
        value: value of the parameter.
        unit: unit of the value.

    Raises:
        InputError: the entry is invalid.
    """
    if not isinstance(node, MapNode) or len(node.entries) != 1:
        raise InputError.one(f"expected a distribution, {FORM}, found {node}")
    ((shape, size),) = node.entries.items()
    if shape not in SHAPES or not isinstance(size, TextNode):
        raise InputError.one(f"expected a distribution, {FORM}, found {shape}: {size}")
    share = PER_CENT.fullmatch(size.text)
    if share is None:
        return Tolerance(shape, _tolerance_number(size.text, size.text, unit))
    return Tolerance(shape, _share_of_percent(share["number"], size.text) * abs(value))


def _share_of_percent(percent: str, text: str) -> float:
    """Return a share given in percent."""
    share = _tolerance_number(percent, text) / 100
    if share > 1:
        raise InputError.one(f"must be at most 100 %, not {text}")
    return share


def _tolerance_number(text: str, whole: str, unit: str = "") -> float:
    try:
        number: float = evaluate(text, unit)
    except ExpressionError as error:
        raise InputError.one(f"{whole!r} is not a tolerance: {error}") from None
    if not number > 0:
        raise InputError.one(f"must be positive, not {whole}")
    if number > LARGEST:
        raise InputError.one(f"must be at most {LARGEST:g}, not {whole}")
    return number


@dataclass(frozen=True)
class MonteCarlo(Published):
    """The results of Monte Carlo runs.

    Attributes:
        drawn: number of drawn robots.
        refused: number of invalid ones, for example with a negative mass.
        lost: share of the valid robots with an infeasible or singular sample, by joint.
        torque: largest standard deviation of a motor torque over the robots without such a sample, by joint,
            N m (N); NaN if fewer than two are left.
    """

    drawn: int
    refused: int
    lost: dict[str, float]
    torque: dict[str, float]


def monte_carlo(
    robot: Robot,
    trajectory: Trajectory,
    chosen: Sequence[Parameter],
    tolerances: Sequence[Tolerance | None],
    runs: int,
    *,
    seed: int = 0,
    progress: Callable[[int], None] = lambda _: None,
) -> MonteCarlo:
    """Run perturbed robots over a trajectory.

    Args:
        robot: nominal robot.
        trajectory: trajectory for this robot.
        chosen: parameters of the robot.
        tolerances: tolerance of each parameter, None for exact ones.
        runs: number of robots to draw.
        seed: seed of the draws.
        progress: function to call with the number of further robots that are done.

    Raises:
        InputError: the tolerances are so large that every drawn robot is invalid.
    """
    trajectory, random = adapt_trajectory(robot, trajectory), np.random.default_rng(seed)
    uncertain_parameters = [
        (each, of_it) for each, of_it in zip(chosen, tolerances, strict=True) if of_it is not None
    ]
    varied_parameters = numbers_as_rows(
        robot, trajectory, [parameter for parameter, _ in uncertain_parameters]
    )
    kernel_samples = runs * trajectory.samples
    batch_size = max(1, BATCH_SAMPLES // trajectory.samples)
    statistics, refused = _TorqueStatistics(trajectory.samples, len(robot.joints)), 0
    for first in range(0, runs, batch_size):
        robots = list[Robot]()
        for _ in range(first, min(first + batch_size, runs)):
            values = {
                str(each): each.value + tolerance.drawn(random) for each, tolerance in uncertain_parameters
            }
            try:
                robots.append(robot.replace(values))
            except InputError as error:
                refused += 1
                if refused == runs:
                    advice = f"none of {runs} drawn robots is valid; choose smaller tolerances"
                    raise InputError.one(f"{advice}: {error}") from None
        for torque, failed_joints in _torques_of_robots(
            robots, trajectory, varied_parameters, kernel_samples
        ):
            statistics.add(torque, failed_joints)
        progress(min(batch_size, runs - first))
    return MonteCarlo(
        drawn=runs,
        refused=refused,
        lost=dict(zip(robot.joint_names, statistics.lost.tolist(), strict=True)),
        torque=dict(zip(robot.joint_names, statistics.deviation.tolist(), strict=True)),
    )


def _torques_of_robots(
    robots: Sequence[Robot], trajectory: Trajectory, varied: Sequence[Parameter], kernel_samples: int
) -> Iterator[tuple[FloatArray, BoolArray]]:
    """Yield the values of `_run_torques` of each robot; those that differ in varied numbers run together."""
    torques = dict[int, tuple[FloatArray, BoolArray]]()
    for variants, members in batches([PreparedRun(each, trajectory) for each in robots], varied):
        if len(members) == 1:
            torques[members[0]] = _run_torques(variants.robots[0], trajectory)
            continue
        dynamics = RunDynamics(variants, [trajectory] * len(members))
        dynamics.engine = choose_engine("numpy", dynamics.kernel, kernel_samples).engine
        block = dynamics.compute(dynamics.motion(0, trajectory.samples))
        for index, part in zip(members, block.divided(len(members)), strict=True):
            torques[index] = part.tau_motor, _failed_joints(part)
    yield from (torques[index] for index in range(len(robots)))


def _failed_joints(block: Block) -> BoolArray:
    """Return a mask of joints with an infeasible or singular sample, (joints,)."""
    return np.asarray(np.any(has_flag(block.flags, Flag.INFEASIBLE | Flag.SINGULAR), axis=0))


def _run_torques(robot: Robot, trajectory: Trajectory) -> tuple[FloatArray, BoolArray]:
    """Return tau_motor, (samples, joints, 2), and a mask of joints with a failed sample, (joints,)."""
    block_samples = usual_block(len(robot.joints))
    blocks = [
        compute_block(robot, trajectory.block(start, start + block_samples))
        for start in range(0, trajectory.samples, block_samples)
    ]
    failed_joints = np.any([_failed_joints(block) for block in blocks], axis=0)
    return np.concatenate([block.tau_motor for block in blocks]), failed_joints


class _TorqueStatistics:
    """Means and variances of motor torques over robots, by Welford's recurrence."""

    def __init__(self, samples: int, joints: int) -> None:
        self._failed_runs = np.zeros(joints)
        self._runs, self._count = 0, np.zeros(joints)
        self._mean, self._squared_deviation_sums = np.zeros((2, samples, joints, 2))

    def add(self, torque: FloatArray, failed_joints: BoolArray) -> None:
        """Include a robot; its joints with a failed sample do not count."""
        self._runs += 1
        self._failed_runs += failed_joints
        self._count += ~failed_joints
        counted = ~failed_joints[None, :, None] & np.isfinite(torque)
        deviation = np.where(counted, torque - self._mean, 0.0)
        self._mean += deviation / np.maximum(self._count, 1)[:, None]
        self._squared_deviation_sums += deviation * np.where(counted, torque - self._mean, 0.0)

    @property
    def lost(self) -> FloatArray:
        """Share of the robots with a failed sample, (joints,)."""
        return self._failed_runs / max(self._runs, 1)

    @property
    def deviation(self) -> FloatArray:
        """Largest standard deviation over samples and motors, (joints,); NaN for fewer than two robots."""
        variance = self._squared_deviation_sums / np.maximum(self._count - 1, 1)[:, None]
        max_deviation = np.sqrt(variance.max(axis=(0, 2), initial=0.0))
        return np.asarray(np.where(self._count > 1, max_deviation, np.nan))
