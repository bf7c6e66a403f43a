"""Derivatives of what joints do, by numbers of the robot, over a block of steps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vsacli.actuators.reach import margin
from vsacli.base.arrays import FloatArray
from vsacli.base.variables import Block
from vsacli.studies.sensitivities.drive_derivatives import MARGIN


class Slopes(ABC):
    """Derivatives of the variables of a joint by some numbers."""

    @abstractmethod
    def __getitem__(self, name: str) -> FloatArray:
        """Of a variable: (numbers, 2, samples) of its motors, else (numbers, samples)."""

    @abstractmethod
    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """Weighted sum of those of its motors that exist, (numbers,); weights are (2, samples)."""


class Known(Slopes):
    """Derivatives that were computed.

    Args:
        of_variables: by name.
    """

    def __init__(self, of_variables: Mapping[str, FloatArray]) -> None:
        self._of_variables = of_variables

    def __getitem__(self, name: str) -> FloatArray:
        return self._of_variables[name]

    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """As of `Slopes`."""
        return np.tensordot(_existing(self[name]), weights, 2)


class Chained(Slopes):
    """Derivatives by numbers that tau_e depends on, by the chain rule when they are asked for.

    Args:
        of_torques: of tau_e, tau_e', tau_e'' by the numbers, (numbers, 3, samples).
        by_torques: of each variable by the three, (3, [2,] samples).
    """

    def __init__(self, of_torques: FloatArray, by_torques: Mapping[str, FloatArray]) -> None:
        self._of_torques, self._by_torques = of_torques, by_torques

    def __getitem__(self, name: str) -> FloatArray:
        by_torques = self._by_torques[name]
        of_torques = self._of_torques if by_torques.ndim == 2 else self._of_torques[:, :, None]
        total: FloatArray = of_torques[:, 0] * by_torques[0]
        for order in range(1, len(by_torques)):
            if by_torques[order].any():  # some depend on tau_e alone
                total += of_torques[:, order] * by_torques[order]
        return total

    def total(self, name: str, weights: FloatArray) -> FloatArray:
        """As of `Slopes`."""
        by_torques = (_existing(self._by_torques[name]) * weights).sum(axis=1)
        return np.tensordot(self._of_torques, by_torques, 2)


class Group(NamedTuple):
    """Derivatives by some numbers.

    Attributes:
        places: of the numbers, among all.
        of_joints: of each joint; None if nothing of it depends on these numbers.
    """

    places: Sequence[int]
    of_joints: Sequence[Slopes | None]


@dataclass(frozen=True, eq=False)
class Derivatives:
    """What changes with the numbers of a robot over a block of steps, per SI unit of each.

    NaN where the variable does not exist, and where the decoupling matrix is singular.

    Attributes:
        block: the steps, with the variables themselves.
        numbers: how many there are.
        groups: the derivatives; those that are zero for a whole joint are left out.
    """

    block: Block
    numbers: int
    groups: Sequence[Group] = field(repr=False)

    @property
    def time(self) -> FloatArray:
        """Times of the steps, (samples,), s."""
        time: FloatArray = self.block.time
        return time

    @property
    def margin(self) -> FloatArray:
        """Of the stiffness to the nearer end of its corridor, relative, (samples, joints)."""
        return margin(self.block.stiffness, self.block.stiffness_lower, self.block.stiffness_upper)

    def over_time(self, name: str) -> FloatArray:
        """Derivatives of a variable by all numbers, (samples, numbers, joints[, 2]); NaN wherever it is."""
        variable = self.margin if name == MARGIN else self.block.arrays()[name]
        nothing = np.where(np.isnan(variable), np.nan, 0.0)
        slopes = np.repeat(nothing[:, None], self.numbers, axis=1)
        for places, of_joints in self.groups:
            for joint, of_joint in enumerate(of_joints):
                if of_joint is not None:
                    slopes[:, places, joint] = np.moveaxis(of_joint[name], -1, 0)
        return slopes


def _existing(slopes: FloatArray) -> FloatArray:
    return np.where(np.isfinite(slopes), slopes, 0.0)
