"""Two springs as a robot file declares them, on one of two branches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vsacli.actuators.laws.law import PairSolution, SpringLaw
from vsacli.actuators.pairs import make_pair
from vsacli.actuators.reach import classify_stiffness
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem

BRANCHES = ("positive", "negative")


@dataclass(frozen=True)
class PairOnBranch:
    """Springs 1 and 2, and the branch of their deflections.

    Attributes:
        spring: Laws as written in the robot file; `laws` has them as they act on each side.
        branch: One of `BRANCHES`; positive has phi_1 up and phi_2 down.
    """

    spring: tuple[SpringLaw, SpringLaw]
    branch: str

    @cached_property
    def laws(self) -> tuple[SpringLaw, SpringLaw]:
        """The springs as they act on sides 1 and 2, without their limits."""
        first, second = self.spring
        return first.unlimited, second.unlimited.as_second()

    @property
    def distinct(self) -> tuple[SpringLaw, ...]:
        """Springs without repetition, if one object serves both sides."""
        return tuple({id(law): law for law in self.spring}.values())

    def problems(self) -> Iterator[FieldProblem]:
        """Yield the reasons why the springs cannot set a stiffness, in the fields `spring` and `branch`."""
        if all(spring.is_linear for spring in self.spring):
            reason = (
                "both are linear: no motion of the motors changes the stiffness (A is singular everywhere)"
            )
            yield FieldProblem(("spring",), reason)
        if self.branch == "negative" and any(spring.pulls_only for spring in self.spring):
            yield FieldProblem(("branch",), "must be positive: a spring that only pulls cannot push")

    def solve(self, tau_e: FloatArray, stiffness: FloatArray) -> PairSolution:
        """Solve (14) on the branch, arrays (samples,)."""
        first, second = self.laws
        # Pairs have side 1 up; a negative branch is the pair with its sides exchanged.
        if self.branch == "negative":
            return make_pair(second, first).solve(tau_e, stiffness).exchanged()
        return make_pair(first, second).solve(tau_e, stiffness)

    @property
    def opposite(self) -> str | None:
        """The other branch; None if a spring only pulls."""
        if any(law.pulls_only for law in self.laws):
            return None
        return next(branch for branch in BRANCHES if branch != self.branch)

    def opposite_reaches(self, tau_e: FloatArray, stiffness: FloatArray) -> BoolArray:
        """Return where the stiffness is attainable on the other branch, (samples,)."""
        if self.opposite is None:
            return np.zeros(tau_e.shape, dtype=bool)
        opposite_pair = replace(self, branch=self.opposite)
        return ~classify_stiffness(stiffness, opposite_pair.solve(tau_e, stiffness)).infeasible
