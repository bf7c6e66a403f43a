"""Robots of one structure that differ in numbers, which kernels take as rows: one call computes all of them.

`Variants` are the robots, `VariantKernel` is the kernel of all. `shared_structure` decides which robots can
be variants of each other, `numbers_as_rows` of `analysis.variant_groups` which numbers may differ.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, Self, TypeVar

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.vector import Scalar, trigonometric
from vsacli.documents.record_values import number_at, with_numbers
from vsacli.robot.model import Robot

if TYPE_CHECKING:
    from vsacli.robot.parameters import Parameter

PARAMETERS = "parameters"
"""Name of the rows with the varied numbers, behind those of the kernel itself."""

ANGLE_KEYS = frozenset(("alpha", "rpy"))
"""Words of paths to angles of the geometry."""


class RobotKernel(RowKernel):
    """A kernel that can be that of another robot."""

    @abstractmethod
    def of_robot(self, robot: Robot) -> Self:
        """Return the kernel of another robot of the same structure."""


_Kernel = TypeVar("_Kernel", bound=RobotKernel)


@dataclass(frozen=True)
class VariantKernel(RowKernel, Generic[_Kernel]):
    """A kernel with some numbers of its robot as further input rows.

    Attributes:
        kernel: Kernel of `robot`.
        robot: Robot; its own values of the varied numbers do not count.
        varied: Numbers of the robot that are rows.
    """

    kernel: _Kernel
    robot: Robot
    varied: tuple[Parameter, ...]

    @cached_property
    def arguments(self) -> RowLayout:
        """Layout of the input rows: those of the kernel, then the varied numbers."""
        return RowLayout({**self.kernel.arguments.shapes, PARAMETERS: (len(self.varied),)})

    @property
    def results(self) -> RowLayout:
        """Layout of the output rows, that of the kernel."""
        return self.kernel.results

    def __call__(self, rows: Sequence[Scalar]) -> Sequence[Scalar]:
        """Compute with the numbers of each sample."""
        kernel_rows = len(rows) - len(self.varied)
        robot = with_numbers(self.robot, self.varied, rows[kernel_rows:])
        return self.kernel.of_robot(robot)(rows[:kernel_rows])


@dataclass(frozen=True, eq=False)
class Variants:
    """Robots that are equal except for some numbers.

    Attributes:
        robots: The robots.
        base: Robot of their structure, whose own values of the varied numbers do not count.
        varied: Numbers of `base` that are replaced by those of each variant.
    """

    robots: tuple[Robot, ...]
    base: Robot
    varied: tuple[Parameter, ...] = ()

    @classmethod
    def of_one(cls, robot: Robot) -> Self:
        """Return a single robot, all of whose numbers are constants of the kernel."""
        return cls((robot,), robot)

    def __len__(self) -> int:
        return len(self.robots)

    @cached_property
    def values(self) -> FloatArray:
        """Varied numbers of all robots, (numbers, variants)."""
        values = [[number_at(robot, number.path) for robot in self.robots] for number in self.varied]
        return np.array(values).reshape(len(self.varied), len(self.robots))

    def kernel(self, base_kernel: _Kernel) -> _Kernel | VariantKernel[_Kernel]:
        """Return the kernel of all variants from that of `base`."""
        return VariantKernel(base_kernel, self.base, self.varied) if self.varied else base_kernel

    def inputs(self, variant: IndexArray) -> dict[str, Sequence[FloatArray]]:
        """Return the further input rows of `kernel`, by name, from the variant of each sample."""
        return {PARAMETERS: self._number_rows(variant)} if self.varied else {}

    def robot_with_rows(self, variant: IndexArray) -> Robot:
        """Return a robot whose varied numbers are rows, (samples,), from the variant of each sample."""
        return with_numbers(self.base, self.varied, self._number_rows(variant))

    def _number_rows(self, variant: IndexArray) -> Sequence[FloatArray]:
        return list(np.ascontiguousarray(self.values[:, variant]))


def shared_structure(robot: Robot, varied: Sequence[Parameter]) -> tuple[Robot, tuple[Parameter, ...]] | None:
    """Return the robot with each varied number as in `varied`, or 1 for 0, and those that can differ from it.

    Robots for which this returns the same can be variants of each other. Numbers that decide on the
    equations stay as they are: zeros, infinite limits, and twists with exact zeros and ones. None if the
    robot lacks one of the numbers.
    """
    try:
        values = {number: number_at(robot, number.path) for number in varied}
    except (AttributeError, IndexError, TypeError):  # the robot has another record at a path
        return None
    differing = tuple(number for number, value in values.items() if not _decides_on_equations(number, value))
    structure = with_numbers(robot, differing, [number.value or 1.0 for number in differing])
    restored = with_numbers(structure, differing, [values[number] for number in differing])
    return (structure, differing) if restored == robot else None


def _decides_on_equations(number: Parameter, value: float) -> bool:
    """Return whether a value of a number decides on the equations."""
    is_angle = not ANGLE_KEYS.isdisjoint(number.path)
    exact = is_angle and any(type(trigonometric(name, value)) is int for name in ("cos", "sin"))
    return exact or value == 0 or not math.isfinite(value)
