"""Dimensions of a study and the values of each run: entries of `vary:`, checked against the files.

An entry becomes one `Dimension`, or several if a distribution matches several numbers. A `Design` combines
the values of all dimensions: a grid, or random points.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.units import ANY_SI_UNIT
from vsacli.documents import tree
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import evaluate
from vsacli.documents.reading import ChangeError, apply_changes
from vsacli.documents.record_values import NumberAtPath, PathIndex, numbers_in_record
from vsacli.documents.source import Problems, is_table
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.robot.file import RobotFileWithSource
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.studies.sensitivities.tolerances import Tolerance, distribution
from vsacli.studies.sweeps.study_file import GRID, Drawn, Linked, Listed, Ranged, Spaced, StudyFile, Varied
from vsacli.trajectory.changes import divide_changes_by_file
from vsacli.trajectory.file import read_trajectory

MAX_VALUES = 1_000_000
"""Largest number of values of one path: more than any study has runs."""


def _joint_type(number: NumberAtPath, joint_types: Mapping[str, str]) -> str:
    names = (step.name for step in number.path if isinstance(step, PathIndex))
    return next((joint_types[name] for name in names if name in joint_types), "revolute")


class Dimension(NamedTuple):
    """The values of one path over a study.

    Attributes:
        path: path of a number, of several that have the same value, or of anything else.
        unit: SI unit of the number; empty if it is not a number, or the unit is unknown.
        values: values as in files; empty if they are drawn.
        center: center of the distribution.
        tolerance: distribution about the center; None if values are listed.
        linked: path of the dimension of which it is a multiple; "" if independent.
        factor: factor on the linked dimension.
        numeric: whether all values are numbers.
    """

    path: str
    unit: str
    values: tuple[Any, ...] = ()
    center: float = 0.0
    tolerance: Tolerance | None = None
    linked: str = ""
    factor: float = 1.0
    numeric: bool = True

    def drawn(self, share: float) -> Any:
        """Return the quantile for a share; listed values have equal shares."""
        if self.tolerance is not None:
            return self.center + self.tolerance.below(share)
        return self.values[int(share * len(self.values))]

    def number(self, value: Any) -> float | None:
        """Return a value as a number in SI units; None if it is not one."""
        try:
            return (
                float(evaluate(str(value), self.unit or str(ANY_SI_UNIT)))
                if isinstance(value, str | int | float)
                else None
            )
        except ExpressionError:
            return None


def dimensions_of(
    varied: Varied, numbers: Sequence[Parameter], previous_dimensions: Sequence[Dimension]
) -> Iterator[Dimension]:
    """Yield the dimensions of a path: one, or one for each parameter of a distribution.

    Args:
        varied: entry of the file.
        numbers: numbers of robot and trajectories.
        previous_dimensions: dimensions of previous entries.

    Raises:
        InputError: the variation does not fit the value.
    """
    matching_parameters = [each for each in numbers if each.matches(varied.path, f"{varied.path}.*")]
    unit = matching_parameters[0].unit if matching_parameters else ""
    match varied.way:
        case Listed(values=values):
            listed = Dimension(varied.path, unit, values)
            yield listed._replace(numeric=None not in map(listed.number, values))
        case Spaced() as spaced:
            yield Dimension(varied.path, unit, _spaced_values(spaced, unit))
        case Ranged(least=least, largest=largest):
            min_value, max_value = (_dimension_number(text, unit) for text in (least, largest))
            if not min_value < max_value:
                raise InputError.one(f"expected uniform: [least, largest], found {least} and {largest}")
            half_width = (max_value - min_value) / 2
            yield Dimension(varied.path, unit, (), min_value + half_width, Tolerance("uniform", half_width))
        case Drawn(node=node):
            yield from _distributed_dimensions(varied.path, node, matching_parameters, numbers)
        case Linked(path=path, factor=factor):
            linked_dimension = next(
                (each for each in previous_dimensions if each.path == path and not each.linked), None
            )
            if linked_dimension is None:
                hint = did_you_mean(path, [each.path for each in previous_dimensions if not each.linked])
                raise InputError.one(f"linked: no path above it that varies independently is {path!r}{hint}")
            yield Dimension(
                varied.path,
                unit,
                linked=path,
                factor=_dimension_number(factor, "1"),
                numeric=linked_dimension.numeric,
            )


def _distributed_dimensions(
    path: str, node: tree.Node, matching_parameters: Sequence[Parameter], numbers: Sequence[Parameter]
) -> Iterator[Dimension]:
    if not matching_parameters:
        raise InputError.one(
            f"no number of robot or trajectory fits{did_you_mean(path, [*map(str, numbers)])}"
        )
    for each in dict.fromkeys(matching_parameters):
        if any(other.path == each.path and other.value != each.value for other in matching_parameters):
            raise InputError.one(f"{each} differs between trajectories; list its values, or a range")
        tolerance = distribution(node, each.value, each.unit)
        if tolerance.size == 0:
            raise InputError.one(f"{each} is zero, of which a share is nothing; give {each.unit} instead")
        yield Dimension(str(each), each.unit, (), each.value, tolerance)


def _spaced_values(spaced: Spaced, unit: str) -> tuple[float, ...]:
    start, stop, count = (
        _dimension_number(spaced.first, unit),
        _dimension_number(spaced.last, unit),
        _dimension_number(spaced.steps, "1"),
    )
    if not (count.is_integer() and 1 <= count <= MAX_VALUES):
        raise InputError.one(
            f"{spaced.shape}: expected a count from 1 to {MAX_VALUES:,}, found {spaced.steps}"
        )
    if spaced.shape == "linspace":
        return tuple(np.linspace(start, stop, int(count)).tolist())
    if not start * stop > 0:
        raise InputError.one(
            f"logspace: expected two numbers of one sign, found {spaced.first} and {spaced.last}"
        )
    return tuple(np.geomspace(start, stop, int(count)).tolist())


def _dimension_number(text: str, unit: str) -> float:
    try:
        number = float(evaluate(text, unit or str(ANY_SI_UNIT)))
    except ExpressionError as error:
        raise InputError.one(str(error)) from None
    return number


class Entries:
    """The entries of `vary:`, checked against the files of the study.

    Args:
        file: content of the study file.
        path: path of the study file.
        read: robot file as read.
        robot: robot of the file.
        trajectories: paths of the trajectory files.
    """

    def __init__(
        self, file: StudyFile, path: str, read: RobotFileWithSource, robot: Robot, trajectories: Sequence[str]
    ) -> None:
        self._file, self._path, self._robot_file = file, path, read
        self._joints = CommandedJoints.of(robot)
        self._documents = [read_trajectory(each, self._joints) for each in trajectories if not is_table(each)]
        self._has_tables = len(self._documents) < len(trajectories)
        self._entry_dimensions: list[tuple[Varied, Dimension]] = []

    @property
    def _dimensions(self) -> tuple[Dimension, ...]:
        return tuple(dimension for _, dimension in self._entry_dimensions)

    def dimensions(self) -> tuple[Dimension, ...]:
        """Return the dimensions of all entries.

        Raises:
            InputError: some entries do not fit the files; with the line of each.
        """
        problems, file_numbers = Problems(self._path), self._numbers()
        for varied in self._file.vary:
            with _collecting_problems(problems, varied):
                if self._file.method == GRID and isinstance(varied.way, Drawn | Ranged):
                    raise InputError.one(
                        "has a distribution, which the method grid cannot draw; set method: random or "
                        "latin_hypercube, or list values"
                    )
                entry_dimensions = dimensions_of(varied, file_numbers, self._dimensions)
                self._entry_dimensions += [(varied, dimension) for dimension in entry_dimensions]
        counts = Counter(dimension.path for dimension in self._dimensions)
        for varied, dimension in self._entry_dimensions:
            if counts[dimension.path] > 1:
                problems.add(varied.line, f"{dimension.path} varies twice")
        problems.check()
        return self._dimensions

    def try_values(self) -> None:
        """Try each listed value alone as a change of its file.

        Raises:
            InputError: some changes are not possible.
        """
        problems = Problems(self._path)
        for varied, dimension in self._entry_dimensions:
            with _collecting_problems(problems, varied):
                for value in () if dimension.linked else dimension.values or (dimension.center,):
                    self._try_change(dimension.path, value)
        problems.check()

    def _numbers(self) -> list[Parameter]:
        trajectories = (numbers_in_record(document, self._joints.types) for document, _ in self._documents)
        all_numbers = [
            *numbers_in_record(self._robot_file.document),
            *(each for numbers in trajectories for each in numbers),
        ]
        return [Parameter(*each, None, _joint_type(each, self._joints.types)) for each in all_numbers]

    def _try_change(self, path: str, value: object) -> None:
        changes = divide_changes_by_file({path: value})
        if changes.trajectory and self._has_tables:
            raise ChangeError.one("a trajectory of the study is a table, in which nothing can be set")
        if changes.robot:
            apply_changes(self._robot_file.document, self._robot_file.source, changes.robot)
        for document, source in self._documents if changes.trajectory else ():
            apply_changes(document, source, changes.trajectory, self._joints.types, self._joints.exempt)


@contextmanager
def _collecting_problems(problems: Problems, varied: Varied) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        for problem in error.problems:
            fault_path, colon, fault_text = problem.message.partition(": ")
            repeated = colon and fnmatchcase(
                fault_path, varied.path
            )  # also with the number of a joint for a *
            problems.add(varied.line, f"{varied.path}: {fault_text if repeated else problem.message}")


MAX_RUNS = 1_000_000
"""Largest number of runs: at 3 to 10 ms each they take one to three hours, and the table has 300 MB."""


class Design:
    """The points of a study, which are the same for each trajectory.

    Attributes:
        points: number of points.
    """

    def __init__(self, file: StudyFile, dimensions: Sequence[Dimension], trajectories: int) -> None:
        """Determine the points.

        Raises:
            InputError: there would be more than `MAX_RUNS` runs.
        """
        self._dimensions = dimensions
        self._independent = [each for each in dimensions if not each.linked]
        self._sizes = [len(each.values) for each in self._independent]
        self.points = math.prod(self._sizes) if file.method == GRID else file.samples or 0
        if self.points * trajectories > MAX_RUNS:
            advice = "take fewer values, or draw some points by `method: latin_hypercube` and `samples:`"
            run_count_text = f"{self.points * trajectories:,} runs"
            if file.method == GRID:
                run_count_text += f" ({' x '.join(f'{size:,}' for size in (trajectories, *self._sizes))})"
            raise InputError.one(f"{run_count_text} are more than {MAX_RUNS:,}; {advice}")
        self._shares = (
            None if file.method == GRID else _quantile_shares(file, self.points, len(self._independent))
        )

    def different(self, dimensions: Sequence[Dimension]) -> int:
        """Return the number of different combinations of values of some dimensions."""
        independent = [each for each in dimensions if not each.linked]
        if self._shares is not None and independent:
            return self.points
        return math.prod(len(each.values) for each in independent)

    def values(self, point: int) -> dict[str, Any]:
        """Return the value of each dimension at a point, by path."""
        if self._shares is None:
            value_indices = np.unravel_index(point, self._sizes) if self._sizes else ()
            values_by_path = {
                each.path: each.values[value_index]
                for each, value_index in zip(self._independent, value_indices, strict=True)
            }
        else:
            values_by_path = {
                each.path: each.drawn(share)
                for each, share in zip(self._independent, self._shares[point], strict=True)
            }
        return {each.path: self._value(each, values_by_path) for each in self._dimensions}

    def _value(self, dimension: Dimension, values_by_path: dict[str, Any]) -> Any:
        if not dimension.linked:
            return values_by_path[dimension.path]
        linked_dimension = next(each for each in self._independent if each.path == dimension.linked)
        value, number = (
            values_by_path[linked_dimension.path],
            linked_dimension.number(values_by_path[linked_dimension.path]),
        )
        return value if number is None else number * dimension.factor


def _quantile_shares(file: StudyFile, points: int, dimensions: int) -> FloatArray:
    """Return shares from 0 to 1, (points, dimensions), whose quantiles are the values of the points.

    A Latin hypercube divides each dimension into as many layers as there are points, with one point in each
    layer (McKay, Beckman and Conover 1979).
    """
    random = np.random.default_rng(file.seed)
    shares: FloatArray = random.random((points, dimensions))
    if file.method == "latin_hypercube":
        shares += np.column_stack([random.permutation(points) for _ in range(dimensions)])
        shares /= points
    return np.clip(shares, 2.0**-54, 1 - 2.0**-53)  # at 0 and 1 a normal distribution is infinite
