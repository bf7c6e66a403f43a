"""What a run found at one joint."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from vsacli.base.flags import LIMITS, Flag
from vsacli.base.json_values import JsonObject, number, pair
from vsacli.dynamics.energy import JointEnergy

if TYPE_CHECKING:
    from vsacli.dynamics.integrated_deflections import Stop

COUNTED = {
    "infeasible": Flag.INFEASIBLE,
    "singular": Flag.SINGULAR,
    "near_singular": Flag.NEAR_SINGULAR,
    "slack": Flag.SLACK,
    "over_limit": LIMITS,
}
"""Kinds of trouble whose steps are counted, and the bits that make them."""


class Worst(NamedTuple):
    """The worst step of a kind of trouble: when, what value, against which bound.

    `bound` is NaN where the elastic torque itself cannot be carried; `motor` is 1, 2 or None.
    """

    kind: str
    time: float
    value: float
    bound: float
    unit: str
    motor: int | None = None

    def as_json(self) -> dict[str, Any]:
        """JSON values; the kind is the key under which they stand."""
        entry = {"time": self.time, "value": self.value, "bound": self.bound, "unit": self.unit}
        return entry if self.motor is None else {**entry, "motor": self.motor}

    @classmethod
    def from_json(cls, kind: str, content: JsonObject) -> Worst:
        """From what `as_json` gave, `finite`."""
        time, value, bound = (number(content[name]) for name in ("time", "value", "bound"))
        return cls(kind, time, value, bound, content["unit"], content.get("motor"))


class JointReport(NamedTuple):
    """What a run found at one joint; torques in N m (N), stiffness in N m/rad (N/m).

    Attributes:
        name: of the joint.
        type: "revolute" or "prismatic".
        actuator: "antagonistic", "elastic" or "rigid"; what the last two do not have is NaN: motor 2, margin
            and corridor, and the stiffness of a rigid joint.
        steps: how many steps have each kind of trouble.
        first_time: when each kind that occurs first does, s.
        worst: the worst step of each kind that occurs; limits one by one.
        margin: smallest relative margin to an end of the corridor, NaN if a torque cannot be carried.
        margin_time: when.
        reachable: the corridor at that time.
        stiffness: smallest and largest commanded stiffness.
        peak_tau_e: largest |tau_e|.
        peak_tau_motor: largest |tau_motor| of motors 1 and 2, over the steps where it exists.
        start_theta: motor positions at the first step, to which the motors go before the start.
        torque_step: |tau_motor - tau_spring| at the first step: by how much the torque that holds the motor
            at rest must jump there; NaN at a rigid joint, where tau_e may jump as well.
        other_preload: whether every infeasible step could be done with the opposite preload.
        energy: work of the motors, elastic energy, co-contraction.
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
    stiffness: tuple[float, float]
    peak_tau_e: float
    peak_tau_motor: tuple[float, float]
    start_theta: tuple[float, float]
    torque_step: tuple[float, float]
    other_preload: bool
    energy: JointEnergy

    def as_json(self) -> dict[str, Any]:
        """JSON values under the published keys."""
        return {
            "name": self.name,
            "type": self.type,
            "actuator": self.actuator,
            "steps": self.steps,
            "first_time": self.first_time,
            "worst": {kind: worst.as_json() for kind, worst in self.worst.items()},
            "margin": {"min": self.margin, "time": self.margin_time, "reachable": list(self.reachable)},
            "stiffness": {"min": self.stiffness[0], "max": self.stiffness[1]},
            "peak": {"tau_e": self.peak_tau_e, "tau_motor": list(self.peak_tau_motor)},
            "start": {"theta": list(self.start_theta), "torque_step": list(self.torque_step)},
            "other_preload": self.other_preload,
            "energy": self.energy.as_json(),
        }

    @classmethod
    def from_json(cls, content: JsonObject) -> JointReport:
        """From what `as_json` gave, `finite`: no end of a corridor is NaN alone, so the upper is infinite."""
        margin = content["margin"]
        lower, upper = pair(margin["reachable"])
        if math.isnan(upper) and not math.isnan(lower):
            upper = math.inf
        return cls(
            **{name: content[name] for name in ("name", "type", "actuator", "steps", "first_time")},
            worst={kind: Worst.from_json(kind, worst) for kind, worst in content["worst"].items()},
            margin=number(margin["min"]),
            margin_time=number(margin["time"]),
            reachable=(lower, upper),
            stiffness=pair(content["stiffness"][end] for end in ("min", "max")),
            peak_tau_e=number(content["peak"]["tau_e"]),
            peak_tau_motor=pair(content["peak"]["tau_motor"]),
            start_theta=pair(content["start"]["theta"]),
            torque_step=pair(content["start"]["torque_step"]),
            other_preload=content["other_preload"],
            energy=JointEnergy.from_json(content["energy"]),
        )


class JointDrift(NamedTuple):
    """What became of the followed deflections of a joint.

    Attributes:
        joint: its name.
        largest: largest distance of a deflection from the root of (14), NaN if no step was followed.
        time: when, s.
        unit: of the distance.
        stop: from when on they could not be followed, and why.
    """

    joint: str
    largest: float
    time: float
    unit: str
    stop: Stop | None = None

    def as_json(self) -> dict[str, Any]:
        """JSON values under the published keys."""
        return {
            "joint": self.joint,
            "drift": self.largest,
            "time": self.time,
            "unit": self.unit,
            "stopped": None if self.stop is None else {"time": self.stop.time, "reason": self.stop.reason},
        }

    @classmethod
    def from_json(cls, content: JsonObject) -> JointDrift:
        """From what `as_json` gave, `finite`."""
        from vsacli.dynamics.integrated_deflections import Stop

        stop = None if content["stopped"] is None else Stop(**content["stopped"])
        return cls(content["joint"], number(content["drift"]), number(content["time"]), content["unit"], stop)
