"""Base parameters: those combinations of inertial parameters that torques tell apart.

Columns of the regressor at random motions are taken one after the other, base to tip; one that is a
combination of those before it is regrouped into them (M. Gautier, "Numerical calculation of the base inertial
parameters of robots", Journal of Robotic Systems 8 (1991)). So each keeps the name of the parameter that it
begins with, whatever rounding does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.robot.model import Robot
from vsacli.studies.identification.estimation.independence import first_independent, in_words, shares_of
from vsacli.studies.identification.links.inertial_parameters import SYMBOLS
from vsacli.studies.identification.links.regressor import regressor

SAMPLES_A_LINK = 30
"""Random poses, speeds and accelerations: three for each parameter, and a row of each joint."""

SEED = 0
"""Of the random motions, so that the same robot has the same base parameters each time."""

STRUCTURAL = 1e-9
"""Distance of a column from a combination of others, over its norm, below which it is one. Of the robots that
come along dependent columns are below 1e-15, the others above 0.3."""

PREFERRED = ("Ixx", "Ixy", "Ixz", "Iyz", "Izz", "mx", "my", "Iyy", "mz", "m")
"""Parameters of a link in the order in which they are kept: with revolute joints the last three are regrouped
into the link before."""


class BaseParameters(NamedTuple):
    """Combinations of the standard parameters of all links.

    Attributes:
        kept: standard parameter that each begins with, (base,), ascending.
        shares: of all standard parameters in each, (base, parameters).
    """

    kept: IndexArray
    shares: FloatArray

    def of(self, parameters: FloatArray) -> FloatArray:
        """Values from standard parameters, (..., parameters)."""
        values: FloatArray = parameters @ self.shares.T
        return values

    def names(self, names: Sequence[str]) -> list[str]:
        """That of the parameter that each begins with; with a star if others are regrouped into it."""
        alone = np.count_nonzero(self.shares, axis=1) == 1
        return [f"{names[at]}{'' if one else '*'}" for at, one in zip(self.kept, alone, strict=True)]

    def words(self, place: int, names: Sequence[str]) -> str:
        """What one is the sum of, e.g. `shoulder.Izz + 0.09 elbow.m`."""
        first, factors = int(self.kept[place]), self.shares[place]
        others = ((int(at), float(factors[at])) for at in np.flatnonzero(factors) if at != first)
        return in_words([(first, 1.0), *others], names)


def base_parameters(robot: Robot) -> BaseParameters:
    """Those of a robot's links."""
    joints = len(robot.joints)
    q, dq, ddq = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (3, SAMPLES_A_LINK * joints, joints))
    columns = np.moveaxis(regressor(robot, q, dq, ddq), 1, -1).reshape(-1, len(SYMBOLS) * joints)
    links = len(SYMBOLS) * np.arange(joints)[:, None]
    order = (links + [SYMBOLS.index(symbol) for symbol in PREFERRED]).ravel()
    kept: IndexArray = np.sort(order[first_independent(columns[:, order], STRUCTURAL)])
    return BaseParameters(kept, shares_of(columns[:, kept], columns, STRUCTURAL))
