"""Findings of a run at one joint."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

from vsacli.analysis.dry_friction import DryFriction
from vsacli.base.flags import LIMITS, Flag
from vsacli.base.json_records import JsonObject, Stored, named
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.inverse import Stop

COUNTED = {
    "infeasible": Flag.INFEASIBLE,
    "singular": Flag.SINGULAR | Flag.INTERNAL_INSTABILITY,
    "near_singular": Flag.NEAR_SINGULAR,
    "slack": Flag.SLACK,
    "over_limit": LIMITS,
}
"""Kinds of trouble whose steps are counted, and the bits that make them."""

UNKNOWN = (math.nan, math.nan)
"""Values of both motors in reports written before these were stated."""


DETERMINED = 0.1
"""Largest share of a variable's root mean square by which it may be wrong."""

JUDGED = "tau_motor"
"""The variable that a run is for, unless others are asked for."""


@dataclass(frozen=True)
class Worst(Stored):
    """The worst step of a kind of trouble: when, what value, against which bound.

    `bound` is NaN where the elastic torque itself cannot be carried; `motor` is 1, 2 or None.
    """

    kind: str
    time: float
    value: float
    bound: float
    unit: str
    motor: int | None = None

    key: ClassVar = "kind"
    shape: ClassVar = {**named("time", "value", "bound", "unit"), "motor?": "motor"}


@dataclass(frozen=True)
class Spread(Stored):
    """The uncertainty of a variable of a joint, away from the unreliable ends of recordings.

    Attributes:
        name: of the variable.
        rms: root mean square of its standard deviation; of the motor with the larger one, if it is one of
            motors. NaN if none can be stated, as the records do not determine a derivative.
        max: largest standard deviation.
        share: of the root mean square of the variable itself that `rms` is; the larger one of both motors.
        bound: share by which the variable may be wrong, twice `share`; where none is stated, what trials with
            such records left. NaN if nothing can be said.
        peak: largest size of the variable itself.
        unit: of all but the share.
    """

    name: str
    rms: float
    max: float
    share: float
    bound: float
    peak: float
    unit: str

    key: ClassVar = "name"
    shape: ClassVar = named("rms", "max", "share", "bound", "peak", "unit")

    @property
    def determined(self) -> bool:
        """Whether the records determine the variable to `DETERMINED`."""
        return self.bound <= DETERMINED


@dataclass(frozen=True)
class JointUncertainty(Stored):
    """The uncertainty of a joint that recorded signals leave.

    Attributes:
        variables: how uncertain the motor torque is, and each variable that was asked for.
        asked: names of those that were asked for, and so decide.
        steps: how many of the steps that are infeasible, and singular, would be otherwise within twice the
            standard deviation of the margin.
        limits: for each limit that is exceeded by no more than the uncertainty and does not count as
            exceeded there, the step at which it is exceeded most.
    """

    variables: dict[str, Spread] = field(default_factory=dict)
    asked: tuple[str, ...] = (JUDGED,)
    steps: dict[str, int] = field(default_factory=dict)
    limits: dict[str, Worst] = field(default_factory=dict)

    @property
    def undetermined(self) -> tuple[Spread, ...]:
        """Requested variables that are not determined."""
        return tuple(
            spread for name, spread in self.variables.items() if name in self.asked and not spread.determined
        )


@dataclass(frozen=True)
class JointReport(Stored):
    """The findings of a run at one joint; torques in N m (N), stiffness in N m/rad (N/m).

    Attributes:
        name: of the joint.
        type: "revolute" or "prismatic".
        actuator: its kind; what that does not have is NaN: motor 2, margin and corridor, stiffness.
        steps: how many steps have each kind of trouble.
        first_time: when each kind that occurs first does, s.
        worst: the worst step of each kind that occurs; limits one by one.
        margin: smallest relative margin to an end of the corridor, NaN if a torque cannot be carried.
        margin_time: when.
        reachable: the corridor at that time.
        commanded_min: smallest commanded stiffness.
        commanded_max: the largest.
        peak_tau_e: largest |tau_e|.
        peak_tau_motor: largest |tau_motor| of motors 1 and 2, over the steps where it exists.
        start_theta: motor positions at the first step, to which the motors go before the start.
        torque_step: |tau_motor - tau_transmission| at the first step: by how much the torque that holds the
            motor at rest must jump there; NaN at a rigid joint, where tau_e may jump as well.
        other_preload: whether every infeasible step could be done with the opposite preload.
        energy: work of the motors, elastic energy, co-contraction.
        start_dtheta: motor velocities at the first step.
        end_theta: motor positions at the last step of the trajectory; NaN if that was not computed.
        end_dtheta: motor velocities there.
        peak_dtheta: largest |dtheta| of motors 1 and 2, over the steps where it exists.
        uncertainty: what recorded signals leave uncertain; None if nothing comes from fits of records.
        between: what comes nearer to its bound between the steps than at any step: "margin" is the stiffness
            in its corridor, others are called as the flags of their limits.
        dry_friction: of each motor whose friction is sharp, where its torque is two-valued.
    """

    name: str
    type: str
    actuator: str
    steps: dict[str, int]
    first_time: dict[str, float]
    worst: dict[str, Worst]
    margin: float
    margin_time: float
    reachable: tuple[float, float]
    commanded_min: float
    commanded_max: float
    peak_tau_e: float
    peak_tau_motor: tuple[float, float]
    start_theta: tuple[float, float]
    torque_step: tuple[float, float]
    other_preload: bool
    energy: JointEnergy
    start_dtheta: tuple[float, float] = UNKNOWN
    end_theta: tuple[float, float] = UNKNOWN
    end_dtheta: tuple[float, float] = UNKNOWN
    peak_dtheta: tuple[float, float] = UNKNOWN
    uncertainty: JointUncertainty | None = None
    between: dict[str, Worst] = field(default_factory=dict)
    dry_friction: tuple[DryFriction, ...] = ()

    shape: ClassVar = {
        **named("name", "type", "actuator", "steps", "first_time", "worst"),
        "margin": {"min": "margin", "time": "margin_time", "reachable": "reachable"},
        "stiffness": {"min": "commanded_min", "max": "commanded_max"},
        "peak": {"tau_e": "peak_tau_e", "tau_motor": "peak_tau_motor", "dtheta": "peak_dtheta"},
        "start": {"theta": "start_theta", "dtheta": "start_dtheta", "torque_step": "torque_step"},
        "end": {"theta": "end_theta", "dtheta": "end_dtheta"},
        **named("other_preload", "energy"),
        "uncertainty?": "uncertainty",
        "between?": "between",
        "dry_friction?": "dry_friction",
    }

    def shows(self, verdict: str) -> bool:
        """Return whether the joint is a reason for a verdict that is not ok."""
        if verdict == "doubtful":
            return self.uncertainty is not None and bool(self.uncertainty.undetermined)
        return bool(self.steps.get(verdict))

    @classmethod
    def from_json(cls, content: JsonObject, **further: Any) -> Self:
        """Return a report from `as_json`: no upper end alone is NaN, so it is infinite."""
        joint = super().from_json(content, **further)
        lower, upper = joint.reachable
        if math.isnan(upper) and not math.isnan(lower):
            return replace(joint, reachable=(lower, math.inf))
        return joint


@dataclass(frozen=True)
class JointDrift(Stored):
    """The drift of the integrated deflections of a joint.

    Attributes:
        joint: its name.
        largest: largest distance of a deflection from the root of (14), NaN if no step was integrated.
        time: when, s.
        unit: of the distance.
        stop: from when on they could not be integrated, and why.
    """

    joint: str
    largest: float
    time: float
    unit: str
    stop: Stop | None = None

    shape: ClassVar = {"joint": "joint", "drift": "largest", **named("time", "unit"), "stopped": "stop"}
