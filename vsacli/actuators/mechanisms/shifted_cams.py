"""Two cams that motor 2 rotates relative to each other, as in the floating spring joint of the DLR."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.mechanisms.mechanism import Mechanism, Partials, Range
from vsacli.actuators.pairs.pair_on_branch import BRANCHES, PairOnBranch
from vsacli.actuators.spring_elements import SpringElement
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import OneOf, PairOf, choice, value


@dataclass(frozen=True)
class ShiftedCams(Mechanism):
    """Two cams, rotated in opposite directions by s = theta_2: U = U_1(phi + s) + U_2(phi - s).

    The form of the floating spring joint (Wolf, Eiberger & Hirzinger, ICRA 2011) and of the bidirectional
    antagonism BAVS (Petit, Friedl, Hoeppner & Grebenstein, IEEE/ASME Transactions on Mechatronics 2015).
    Torque, stiffness, branch and attainable range are those of an antagonistic pair (14) with
    phi_1 = phi + s and phi_2 = phi - s.
    """

    spring: tuple[SpringLaw, SpringLaw] = value(
        PairOf(OneOf(LAWS)),
        "torque of cams 1 and 2 over phi + theta_2 and phi - theta_2; one mapping applies to both",
    )
    branch: str = choice(BRANCHES, "sign of theta_2 on the branch that is used", default="positive")

    def _problems(self) -> Iterator[FieldProblem]:
        yield from self._cams.problems()
        for side, law in enumerate(self.spring):
            if math.isfinite(law.max_deflection):  # of the rotation of a cam, which is no variable to flag
                reason = "is not known of a cam, whose turn is not a variable of results; leave it out"
                yield FieldProblem(("spring", side, "max_deflection"), reason)

    @cached_property
    def _cams(self) -> PairOnBranch:
        return PairOnBranch(self.spring, self.branch)

    @classmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Return equal cams, whose torque grows with the cube of the rotation."""
        revolute = joint_type == "revolute"
        constants = {"k": 200, "k_c": 8000} if revolute else {"k": 2000, "k_c": 500000}
        return {"spring": {"type": "cubic", **constants}}

    @property
    def deflection_range(self) -> Range:
        """Range of phi in which both cams' laws hold for some theta_2."""
        (low_1, high_1), (low_2, high_2) = self.ranges
        return (low_1 + low_2) / 2, (high_1 + high_2) / 2

    @property
    def setting_range(self) -> Range:
        """Range of theta_2 in which both cams' laws hold for some phi."""
        (low_1, high_1), (low_2, high_2) = self.ranges
        return (low_1 - high_2) / 2, (high_1 - low_2) / 2

    @property
    def ranges(self) -> tuple[Range, Range]:
        """Domains of both cams' laws."""
        first, second = self._cams.laws
        return first.domain, second.domain

    def ranged(self, phi: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rotations of both cams."""
        return phi + s, phi - s

    @property
    def parts(self) -> tuple[SpringLaw, ...]:
        """The laws of the cams, once if one law serves both."""
        return self._cams.distinct

    @property
    def spring_elements(self) -> tuple[SpringElement, ...]:
        """Both cams."""
        first, second = self._cams.laws
        return (SpringElement(first, -1.0, (1.0, 1.0)), SpringElement(second, -1.0, (1.0, -1.0)))

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:  # noqa: ARG002
        """Return deflection and setting from the solution of the pair."""
        with np.errstate(all="ignore"):  # a torque may be infinite
            solution = self._cams.solve(tau_e, stiffness)
        return solution._replace(
            phi_1=(solution.phi_1 + solution.phi_2) / 2, phi_2=(solution.phi_1 - solution.phi_2) / 2
        )

    @property
    def opposite_branch(self) -> str | None:
        """The other sign of theta_2; None if the cams are equal and it makes no difference."""
        first, second = self._cams.laws
        return None if first == second else self._cams.opposite

    def other_branch(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> BoolArray:  # noqa: ARG002
        """See `Mechanism.other_branch`: the branch with the other sign of theta_2."""
        return self._cams.opposite_reaches(tau_e, stiffness)

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """Return sums and differences of both cams' derivatives; det A is -2 times that of the pair."""
        first, second = self._cams.laws
        (energy_1, one), (energy_2, two) = first.energy_and_state(phi + s), second.energy_and_state(phi - s)
        return Partials(
            energy=energy_1 + energy_2,
            setting_torque=one.tau - two.tau,
            setting_stiffness=one.sigma + two.sigma,
            T=one.tau + two.tau,
            T_p=one.sigma + two.sigma,
            T_s=one.sigma - two.sigma,
            T_pp=one.zeta + two.zeta,
            T_ps=one.zeta - two.zeta,
            T_ss=one.zeta + two.zeta,
            T_ppp=one.eta + two.eta,
            T_pps=one.eta - two.eta,
            T_pss=one.eta + two.eta,
        )
