"""A user-defined mechanism: the robot file contains its potential as an expression."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms.mechanism import Mechanism
from vsacli.actuators.mechanisms.potentials.continuation import ContinuedBranch, LevelCurves
from vsacli.actuators.mechanisms.potentials.potential_energy import (
    ACCELERATION_DERIVATIVES,
    RESERVED,
    PotentialEnergy,
    PotentialState,
    read_energy,
)
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import (
    FINITE,
    NamedNumbers,
    RecordOf,
    interval,
    number,
    text,
    value,
)
from vsacli.documents.record_checks import DeclaredRecord

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

GRID = 32
"""Number of points along each range at which the energy is checked."""

UNBOUNDED = 1e9
"""Stiffness relative to that at the start from which on a pole is reported."""

LEAST_START_SINE = 1e-6
"""Sine of the angle between the gradients of torque and stiffness at the start, over the ranges, below which
A counts as singular."""


@dataclass(frozen=True)
class BranchStart(DeclaredRecord):
    """State of the springs that selects the branch."""

    theta_1: float = number(units.POSITION, "position of motor 1")
    theta_2: float = number(units.POSITION, "position of motor 2")


@dataclass(frozen=True)
class PotentialRange(DeclaredRecord):
    """Range of validity of a potential."""

    phi: tuple[float, float] = interval(units.POSITION, "deflection theta_1 - q")
    theta_2: tuple[float, float] = interval(units.POSITION, "position of motor 2")


@dataclass(frozen=True)
class Potential(Mechanism):
    """Springs of any kind, described by the energy that they store."""

    energy: str = text(
        "energy of the springs, J: an expression of `q`, `theta_1`, `theta_2`, `phi` (which is theta_1 - q), "
        "`pi` and the constants, with + - * / ^, parentheses, sin, cos, tan, sqrt, exp and log"
    )
    constants: tuple[tuple[str, float], ...] = value(
        NamedNumbers(), "constants of the energy by name", check=FINITE, default=()
    )
    start: BranchStart = value(RecordOf(BranchStart), "motor positions at q = 0 that select the branch")
    range: PotentialRange = value(
        RecordOf(PotentialRange), "range of validity of the energy; its ends bound the stiffness"
    )

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Return a spring on an arm of variable length; on a slide, a spring of variable stiffness."""
        if joint_type == "prismatic":
            return {
                "energy": "k/2 * (theta_2/l)^2 * phi^2",
                "constants": {"k": 6400, "l": 0.08},
                "start": {"theta_1": 0, "theta_2": 0.08},
                "range": {"phi": [-0.05, 0.05], "theta_2": [0.05, 0.12]},
            }
        return {
            "energy": "k/2 * (r*theta_2)^2 * sin(phi)^2",
            "constants": {"k": 100000, "r": 0.01},
            "start": {"theta_1": 0, "theta_2": 8},
            "range": {"phi": [-0.7, 0.7], "theta_2": [5, 12]},
        }

    @property
    def deflection_range(self) -> tuple[float, float]:
        """Range of phi."""
        return self.range.phi

    @property
    def setting_range(self) -> tuple[float, float]:
        """Range of theta_2."""
        return self.range.theta_2

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of points at which the energy is invalid."""
        return (*self._gap_warnings(), *self._pole_warnings())

    def _gap_warnings(self) -> Iterator[str]:
        """Yield the grid point nearest to the start at which the energy is not finite."""
        shares = (np.arange(GRID) + 0.5) / GRID
        ends, start = (self.range.phi, self.range.theta_2), (self.start.theta_1, self.start.theta_2)
        axes = [low + (high - low) * shares for low, high in ends]
        distances = [
            (axis - origin) / (high - low)
            for axis, origin, (low, high) in zip(axes, start, ends, strict=True)
        ]
        grid = np.meshgrid(*axes, [0.0], indexing="ij")
        with np.errstate(all="ignore"):
            is_undefined = ~self._potential.derivatives(grid, ACCELERATION_DERIVATIVES).finite[..., 0]
        if is_undefined.any():
            distance = np.where(is_undefined, np.hypot(distances[0][:, None], distances[1]), np.inf)
            phi, s = np.unravel_index(distance.argmin(), distance.shape)
            what = "the energy or one of its first four derivatives is not finite"
            yield f"{what} {_format_position(axes[0][phi], axes[1][s])}; narrow the range to where it holds"

    def _pole_warnings(self) -> Iterator[str]:
        """Yield a point at which the stiffness grows without bound on the branch of the start."""
        stiffest = self._branch.stiffest
        if stiffest.stiffness[0] > UNBOUNDED * self._branch.start.stiffness[0]:
            position = _format_position(stiffest.phi[0], stiffest.s[0])
            yield f"the energy is not finite {position}, where the stiffness grows beyond all bounds"

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """See `Mechanism.solve`; on the branch of the start."""
        return self._branch.solve(tau_e, stiffness, q)

    def state(self, phi: FloatArray, s: FloatArray, q: FloatArray) -> PotentialState:
        """Return the potential with its derivatives."""
        return PotentialState(self._potential, (phi, s, q))

    @cached_property
    def _potential(self) -> PotentialEnergy:
        constants = dict(self.constants)
        return PotentialEnergy(read_energy(self.energy, constants), constants)

    @cached_property
    def _branch(self) -> ContinuedBranch:
        curves = LevelCurves(self._potential, self.range.phi, self.range.theta_2)
        return ContinuedBranch(curves, self.start.theta_1, self.start.theta_2)

    def _problems(self) -> Iterator[FieldProblem]:
        """Yield the problems of the energy; without any, those of the branch."""
        problems = [*self._word_problems(), *self._range_problems()]
        yield from problems or self._branch_problems()

    def _word_problems(self) -> Iterator[FieldProblem]:
        constants = dict(self.constants)
        invalid_names = {name: reason for name in constants if (reason := _invalid_name_reason(name))}
        yield from (FieldProblem(("constants", name), reason) for name, reason in invalid_names.items())
        if invalid_names:
            return
        try:
            names = read_energy(self.energy, constants).names
        except ExpressionError as error:
            yield FieldProblem(("energy",), str(error))
            return
        required = (("theta_2",), ("theta_1", "phi"), ("q", "phi"))
        missing = [words[0] for words in required if names.isdisjoint(words)]
        yield from (FieldProblem(("energy",), f"does not depend on {word}") for word in missing)
        if not missing:  # otherwise the unused constants may belong to the missing terms
            unused = (name for name in constants if name not in names)
            yield from (FieldProblem(("constants", name), "does not occur in the energy") for name in unused)

    def _range_problems(self) -> Iterator[FieldProblem]:
        start_positions = {"phi": self.start.theta_1, "theta_2": self.start.theta_2}
        for name, position in start_positions.items():
            low, high = getattr(self.range, name)
            if not -math.inf < low < high < math.inf:
                yield FieldProblem(("range", name), "must have two finite ends, the lower one first")
            elif not low < position < high:
                motor = "theta_1" if name == "phi" else name
                reason = f"must lie within the range of {name}, {low:g} to {high:g}, not at {position:g}"
                yield FieldProblem(("start", motor), reason)

    def _branch_problems(self) -> Iterator[FieldProblem]:
        """Yield the state at the start, and whether the stiffness can be followed from there to both ends."""
        start = self._branch.start
        with np.errstate(all="ignore"):
            (sine,), (stiffness,) = np.abs(start.sine), start.stiffness
            start_coordinates = np.array([[self.start.theta_1], [self.start.theta_2], [0.0]])
            is_finite = self._potential.derivatives(start_coordinates, ACCELERATION_DERIVATIVES).finite
        if not is_finite.all():
            reason = "the energy or one of its first four derivatives is not finite here"
        elif stiffness <= 0:
            reason = f"the stiffness, the second derivative over q, must be positive here, not {stiffness:g}"
        elif not sine > LEAST_START_SINE:
            reason = "the matrix A is singular here: motors that keep the torque cannot change the stiffness"
        elif not self._is_followed:
            reason = "the stiffness cannot be followed from here to its least and its largest value"
            reason = " and ".join([reason, *self.warnings])
        else:
            return
        yield FieldProblem(("start",), f"{reason}; choose another state")

    @property
    def _is_followed(self) -> bool:
        start = self._branch.start
        solution = self.solve(start.tau_e, start.stiffness, np.zeros(1))
        return bool((solution.lower < solution.upper)[0])


def _format_position(phi: float, theta_2: float) -> str:
    return f"at phi = {phi:.4g}, theta_2 = {theta_2:.4g}"


def _invalid_name_reason(name: str) -> str:
    """Return why no constant may have a name; empty if one may."""
    if not _NAME.fullmatch(name):
        return "is not a name: expected letters, digits and _, beginning with a letter or _"
    return "has a meaning of its own in the energy; choose another name" if name in RESERVED else ""
