"""Findings of a run at one joint: records that the report stores, without the code that computes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

from vsacli.analysis.dry_friction import DryFriction
from vsacli.base.flags import LIMITS, Flag
from vsacli.base.json_records import JsonObject, Stored, named
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.inverse import DeflectionStop
from vsacli.dynamics.limits import Finding

COUNTED = {
    "infeasible": Flag.INFEASIBLE,
    "singular": Flag.SINGULAR | Flag.INTERNAL_INSTABILITY,
    "near_singular": Flag.NEAR_SINGULAR,
    "slack": Flag.SLACK,
    "over_limit": LIMITS,
}
"""Kinds of trouble whose samples are counted, with their bits."""

UNKNOWN = (math.nan, math.nan)
"""Values of both motors in reports from before these values existed."""


DETERMINED = 0.1
"""Largest error of a determined variable, as a share of its root mean square."""

JUDGED = "tau_motor"
"""Variable that decides whether a recording is sufficient, unless others are requested."""


@dataclass(frozen=True)
class Spread(Stored):
    """Uncertainty of a variable of a joint, away from the unreliable ends of recordings.

    Attributes:
        name: Name of the variable.
        rms: Root mean square of the standard deviation, for a motor variable the larger of both motors. NaN
            if none can be stated, since the recordings do not determine a derivative.
        max: Largest standard deviation.
        share: Ratio of `rms` to the root mean square of the variable; the larger of both motors.
        bound: Largest relative error, twice `share`; where none is stated, the error of trials with such
            recordings. NaN if unknown.
        peak: Largest absolute value of the variable.
        unit: Unit of all but the share.
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
        """Whether the recordings determine the variable to `DETERMINED`."""
        return self.bound <= DETERMINED


@dataclass(frozen=True)
class JointUncertainty(Stored):
    """Uncertainty of a joint's variables by recorded signals.

    Attributes:
        variables: Uncertainty of the motor torque, and of each requested variable.
        asked: Names of the requested variables, which decide on the verdict.
        samples: Number of infeasible, and of singular samples that are not so within twice the standard
            deviation of the margin.
        limits: Worst sample of each limit that is exceeded only within the uncertainty, and not flagged.
        start_dtheta: Standard deviation of the initial motor velocity, the larger of both motors; NaN if it
            is unknown.
        end_dtheta: The same of the final motor velocity.
    """

    variables: dict[str, Spread] = field(default_factory=dict)
    asked: tuple[str, ...] = (JUDGED,)
    samples: dict[str, int] = field(default_factory=dict)
    limits: dict[str, Finding] = field(default_factory=dict)
    start_dtheta: float = math.nan
    end_dtheta: float = math.nan

    @property
    def undetermined(self) -> tuple[Spread, ...]:
        """Requested variables that are not determined."""
        return tuple(
            spread for name, spread in self.variables.items() if name in self.asked and not spread.determined
        )


@dataclass(frozen=True)
class JointReport(Stored):
    """Findings of a run at one joint; torques in N m (N), stiffness in N m/rad (N/m).

    Attributes:
        name: Name of the joint.
        type: "revolute" or "prismatic".
        actuator: Kind of the actuator; values that it lacks are NaN: motor 2, margin, stiffness range.
        samples: Number of samples with each kind of trouble.
        first_time: Time of the first sample of each kind that occurs, s.
        worst: Worst sample of each kind that occurs; limits one by one.
        margin: Smallest margin, relative to the stiffness; NaN if a torque cannot be carried.
        margin_time: Time of the smallest margin, s.
        attainable: Attainable range of the stiffness at that time.
        commanded_min: Smallest commanded stiffness.
        commanded_max: Largest commanded stiffness.
        peak_tau_e: Largest |tau_e|.
        peak_tau_motor: Largest |tau_motor| of motors 1 and 2, over the samples at which it exists.
        start_theta: Initial motor positions.
        torque_discontinuity: |tau_motor - tau_transmission| at the first sample, of motors that rest before
            the start; NaN at a rigid joint, where tau_e may jump as well.
        other_branch: Whether every infeasible sample is feasible on the opposite branch.
        energy: Work of the motors, elastic energy, co-contraction.
        start_dtheta: Initial motor velocities.
        end_theta: Final motor positions; NaN if the last sample was not computed.
        end_dtheta: Final motor velocities.
        peak_dtheta: Largest |dtheta| of motors 1 and 2, over the samples at which it exists.
        uncertainty: Uncertainty by recorded signals; None if no signal comes from a fit of a recording.
        between: Quantities nearer to their bound between samples than at any sample: "margin" for the
            stiffness, or the flag of a limit.
        dry_friction: Dry friction of each motor with sharp friction, whose torque at rest is two-valued.
    """

    name: str
    type: str
    actuator: str
    samples: dict[str, int]
    first_time: dict[str, float]
    worst: dict[str, Finding]
    margin: float
    margin_time: float
    attainable: tuple[float, float]
    commanded_min: float
    commanded_max: float
    peak_tau_e: float
    peak_tau_motor: tuple[float, float]
    start_theta: tuple[float, float]
    torque_discontinuity: tuple[float, float]
    other_branch: bool
    energy: JointEnergy
    start_dtheta: tuple[float, float] = UNKNOWN
    end_theta: tuple[float, float] = UNKNOWN
    end_dtheta: tuple[float, float] = UNKNOWN
    peak_dtheta: tuple[float, float] = UNKNOWN
    uncertainty: JointUncertainty | None = None
    between: dict[str, Finding] = field(default_factory=dict)
    dry_friction: tuple[DryFriction, ...] = ()

    shape: ClassVar = {
        **named("name", "type", "actuator", "samples", "first_time", "worst"),
        "margin": {"min": "margin", "time": "margin_time", "attainable": "attainable"},
        "stiffness": {"min": "commanded_min", "max": "commanded_max"},
        "peak": {"tau_e": "peak_tau_e", "tau_motor": "peak_tau_motor", "dtheta": "peak_dtheta"},
        "start": {
            "theta": "start_theta",
            "dtheta": "start_dtheta",
            "torque_discontinuity": "torque_discontinuity",
        },
        "end": {"theta": "end_theta", "dtheta": "end_dtheta"},
        **named("other_branch", "energy"),
        "uncertainty?": "uncertainty",
        "between?": "between",
        "dry_friction?": "dry_friction",
    }

    def shows(self, verdict: str) -> bool:
        """Return whether the joint is a reason for a verdict that is not ok."""
        if verdict == "unreliable":
            return self.uncertainty is not None and bool(self.uncertainty.undetermined)
        return bool(self.samples.get(verdict))

    @classmethod
    def from_json(cls, content: JsonObject, **further: Any) -> Self:
        """Return a report from the output of `as_json`; a missing upper end alone stands for infinity."""
        joint = super().from_json(content, **further)
        lower, upper = joint.attainable
        if math.isnan(upper) and not math.isnan(lower):
            return replace(joint, attainable=(lower, math.inf))
        return joint


def largest_of_motors(
    joints: Iterable[JointReport], values: Callable[[JointReport], Iterable[float]]
) -> tuple[float, JointReport] | None:
    """Return the largest of the values of all motors, with its joint; None if all are NaN."""
    entries = [(value, joint) for joint in joints for value in values(joint) if not math.isnan(value)]
    return max(entries, key=lambda entry: entry[0], default=None)


@dataclass(frozen=True)
class JointDrift(Stored):
    """Drift of the integrated deflections of a joint.

    Attributes:
        joint: Name of the joint.
        largest: Largest distance of a deflection from the root of (14); NaN if no sample was integrated.
        time: Time of the largest distance, s.
        unit: Unit of the distance.
        stop: Time and reason at which the integration ended, if it did.
    """

    joint: str
    largest: float
    time: float
    unit: str
    stop: DeflectionStop | None = None

    shape: ClassVar = {"joint": "joint", "drift": "largest", **named("time", "unit"), "stopped": "stop"}
