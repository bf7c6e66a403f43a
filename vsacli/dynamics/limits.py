"""Limits of a joint, flags where they are exceeded, and findings: quantities beyond a bound, and their words.

Runs, simulations, searches of fixes and planned excitations make one record, `Finding`; `worst_excess` makes
that of a limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from vsacli.actuators.reach import LimitCheck, VariablesOfJoint
from vsacli.base.arrays import FLAG_TYPE, BoolArray, FlagArray, FloatArray
from vsacli.base.flags import Flag, ToolFlag, labeled_flag
from vsacli.base.json_records import Stored, named
from vsacli.base.signals import DAMPING
from vsacli.base.texts import distinguish, significant
from vsacli.base.units import time_text
from vsacli.robot.joint import Joint


def limit_checks(joint: Joint) -> list[LimitCheck]:
    """Return the finite limits of a joint."""
    limits = joint.limits
    checks = [
        LimitCheck(Flag.POSITION_LIMIT, "q", None, limits.position),
        LimitCheck(Flag.VELOCITY_LIMIT, "dq", None, limits.velocity),
        LimitCheck(Flag.STIFFNESS_LIMIT, "stiffness", None, limits.stiffness),
    ]
    if joint.damper is not None:
        checks.append(LimitCheck(Flag.DAMPING_LIMIT, DAMPING.key, None, joint.damper.range))
    checks += joint.actuator.limits
    return [check for check in checks if check.exists]


def limit_flags(joint: Joint, variables: VariablesOfJoint, flags: FlagArray) -> FlagArray:
    """Return `flags`, (samples,), with the bits of all limits on variables that are given.

    Where the standard deviation of a variable is given, its limit is exceeded only beyond the allowance.
    """
    for check in limit_checks(joint):
        if check.variable in variables:
            flags = flags | check.flags(variables, check.allowance(variables))
    return flags


def undecided_samples(joint: Joint, variables: VariablesOfJoint) -> BoolArray:
    """Return the samples at which standard deviations decide whether limits are exceeded, (samples,).

    A value is beyond a limit there, but none by more than the largest allowance.
    """
    beyond, too_far = np.zeros((2, len(variables["flags"])), dtype=FLAG_TYPE)
    for check in limit_checks(joint):
        if check.variable in variables:
            beyond |= check.flags(variables)
            too_far |= check.flags(variables, check.largest_allowance)
    undecided: BoolArray = (beyond != 0) & (too_far == 0)
    return undecided


MARGIN = "margin"
"""Kind of the distance of a stiffness from its attainable range; limits have the names of their flags."""

OFF_TARGET = "off_target"
"""Kind of the final position error of a simulation; its bound is the goal tolerance, signed as the error."""


@dataclass(frozen=True)
class Finding(Stored):
    """A quantity of a joint or tool at the instant at which it is furthest beyond a bound, or nearest to it.

    Attributes:
        kind: Name of a flag, `MARGIN` or `OFF_TARGET`.
        time: Time of the instant, s.
        value: Value of the quantity there.
        bound: Bound of the value; NaN where the elastic torque itself cannot be carried.
        unit: Unit of value and bound.
        motor: Motor or spring 1 or 2; None for a quantity of the joint.
        joint: Name of the joint.
        tool: Name of the tool, in place of a joint; None for a quantity of a joint.
        between: Whether the instant lies between two samples.
        at_rest: Whether the motion is held at that instant.
        end: End of the attainable range if the bound keeps a margin from it, else NaN.
        margin: This margin.
        advice: What to do, as a clause.
        fixable: Whether any change that was tried helps.
        first: Time of the first sample beyond the bound among those compared, s.
    """

    kind: str
    time: float
    value: float
    bound: float
    unit: str
    motor: int | None = None
    joint: str = ""
    between: bool = False
    at_rest: bool = False
    end: float = math.nan
    margin: float = 0.0
    advice: str = ""
    fixable: bool = True
    first: float = field(default=math.nan, compare=False)
    tool: str | None = None

    key: ClassVar = "kind"
    shape: ClassVar = {
        **named("time", "value", "bound", "unit"),
        **{f"{name}?": name for name in ("motor", "joint", "tool", "between", "at_rest")},
    }

    def as_json(self) -> dict[str, Any]:
        """See `Published.as_json`; a tool has no joint."""
        return {key: entry for key, entry in super().as_json().items() if key != "joint" or not self.tool}

    def __str__(self) -> str:
        return f"{self.tool or self.joint}: {self.text}"

    @property
    def excess(self) -> float:
        """Distance of the value from the bound."""
        return abs(self.value - self.bound)

    @property
    def share(self) -> float:
        """Excess as a share of the bound; infinite where there is none, as no stiffness would do."""
        return self.excess / abs(self.bound) if abs(self.bound) > 0 else math.inf

    @property
    def below(self) -> bool:
        """Whether the value is below its bound."""
        return self.value < self.bound

    @property
    def quantity(self) -> str:
        """Quantity in words, with the number of its motor."""
        flag = labeled_flag(self.kind)
        if flag is None or flag.quantity is None:
            return "elastic torque" if flag is Flag.INFEASIBLE else "stiffness"
        return flag.quantity_of(self.motor)

    def when(self, *, closed: bool = False) -> str:
        """Return the time in words; closed by a comma, if it needs one before a verb."""
        between = ", between two samples" if self.between else ""
        added = f"{between}{', even at rest' if self.at_rest else ''}"
        return f"at t = {time_text(self.time)}{added}{',' if added and closed else ''}"

    @property
    def numbers(self) -> tuple[str, str]:
        """Value and bound as texts; a bound that a margin requires is rounded so that its text suffices."""
        return distinguish(self.value, self.bound, safely=self.margin > 0)

    @property
    def brief(self) -> str:
        """Value and bound without their unit, for a list."""
        value, bound = self.numbers
        if self.kind == OFF_TARGET:
            return f"{self.value:.3g} (tolerance {abs(self.bound):.3g})"
        return f"{value} {'<' if self.below else '>'} {bound}"

    @property
    def text(self) -> str:
        """The finding as a clause without the name of joint or tool, and the advice."""
        return f"{self._fact_text('')}{self.advice and ': '}{self.advice}"

    @property
    def clause(self) -> str:
        """The finding as a clause that names the joint or tool."""
        return f"the {self._fact_text(f' of {self.tool or self.joint}').removeprefix('the ')}"

    def _fact_text(self, owner: str) -> str:
        """Return the finding as a clause in which the quantity, or the springs, are followed by `owner`."""
        if self.kind == OFF_TARGET:
            error, tolerance = (f"{value:.3g} {self.unit}" for value in (self.value, abs(self.bound)))
            return f"final q error{owner} {error} exceeds the goal tolerance of {tolerance}"
        if self.kind == Flag.NOT_FINITE.label:
            return f"a motor variable{owner} is not finite {self.when()}"
        if self.kind == ToolFlag.STATIC_INSTABILITY.label:
            return f"its pose is statically unstable {self.when()}: with the motors held, the links buckle"
        if math.isnan(self.bound):
            return f"the springs{owner} cannot carry the elastic torque {self.when()}"
        (value, bound), side = self.numbers, "below" if self.below else "above"
        limit = f"its limit of {bound} {self.unit}"
        if self.margin:
            end = f"{'minimum' if self.below else 'maximum'} {significant(self.end)}"
            limit = f"the {bound} {self.unit} needed for a margin of {100 * self.margin:.4g} % ({end})"
        return f"{self.quantity}{owner} is {value} {self.unit} {self.when()}, {side} {limit}"


def worst_excess(
    joint: Joint,
    check: LimitCheck,
    variables: VariablesOfJoint,
    time: FloatArray,
    beyond: BoolArray,
    *,
    between: bool = False,
) -> Finding | None:
    """Return the worst excess over a limit, among samples that are beyond it; None without any.

    Args:
        joint: Joint with the limit.
        check: Limit.
        variables: Variables of the joint, by name.
        time: Times of the samples, (samples,).
        beyond: Mask of the samples to compare, (samples,).
        between: Whether the times lie between samples.
    """
    values = check.values(variables)
    outside = np.nan_to_num(check.outside(values), nan=-np.inf)
    beyond = beyond & (outside > check.tolerance)
    if not beyond.any():
        return None
    worst = int(np.where(beyond, outside, -np.inf).argmax())
    value, (lower, upper) = float(values[worst]), check.range
    return Finding(
        check.flag.label,
        float(time[worst]),
        value,
        lower if value < lower else upper,
        check.unit(joint.type),
        check.motor,
        joint.name,
        between,
        first=float(time[beyond.argmax()]),
    )


def keep_worse(worst: dict[str, Finding], finding: Finding | None) -> None:
    """Keep a finding, if there is one, where it is the worst of its kind so far."""
    if finding is not None and (finding.kind not in worst or finding.excess > worst[finding.kind].excess):
        worst[finding.kind] = finding
