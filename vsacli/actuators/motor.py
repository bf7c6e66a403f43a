"""A motor and its gear: the data as a file gives them, and as they act on the joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import (
    NON_NEGATIVE,
    NON_ZERO,
    POSITIVE,
    POSITIVE_OR_INFINITE,
    check_fields,
    number,
)

_SIDE = "joint side of the gear unless gear_ratio is given"


@dataclass(frozen=True)
class JointMotor:
    """A motor as its joint has it: at a prismatic joint it moves in m and pushes in N."""

    inertia: float = number(units.MOTOR_INERTIA, "inertia of the drive, joint side of the gear")
    damping: float = number(units.DAMPING, "viscous damping, joint side of the gear")
    max_torque: float = number(units.TORQUE, "largest |torque|, joint side of the gear")
    max_velocity: float = number(units.VELOCITY, "largest |velocity|, joint side of the gear")
    gear_ratio: float | None = number(
        units.GEAR_RATIO, "motion of the motor's shaft over that on the joint side", default=None
    )


@dataclass(frozen=True)
class Motor:
    """A motor as written down: on the joint side of its gear, or with a gear ratio on its own shaft."""

    inertia: float = number(units.MOTOR_INERTIA, f"inertia of the drive, {_SIDE}", check=POSITIVE)
    damping: float = number(units.DAMPING, f"viscous damping, {_SIDE}", check=NON_NEGATIVE, default=0.0)
    max_torque: float = number(
        units.TORQUE,
        f"largest |torque|, {_SIDE}; flagged beyond",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )
    max_velocity: float = number(
        units.VELOCITY,
        f"largest |velocity|, {_SIDE}; flagged beyond",
        check=POSITIVE_OR_INFINITE,
        default=math.inf,
    )
    gear_ratio: float | None = number(
        units.GEAR_RATIO,
        "turns of the motor to one of the joint, negative if against it; if given, the other numbers are "
        "those of the motor's shaft, as datasheets print them, in kg m^2, N m s/rad, N m, rad/s at any joint",
        check=NON_ZERO,
        default=None,
    )

    unit_variant_with = ("gear_ratio", "revolute")

    def __post_init__(self) -> None:
        problems = []
        inertia = self.at_joint.inertia
        if self.gear_ratio and POSITIVE.problem(inertia) and not POSITIVE.problem(self.inertia):
            reason = f"makes the inertia on the joint side {inertia:g}, too far from anything built"
            problems.append(FieldProblem(("gear_ratio",), reason))
        check_fields(self, *problems)

    @staticmethod
    def example(joint_type: str) -> dict[str, float]:
        """Plausible values of its fields, as a new robot file shows them."""
        revolute = joint_type == "revolute"
        return {"inertia": 0.5, "damping": 0.01} if revolute else {"inertia": 10, "damping": 0.1}

    @cached_property
    def at_joint(self) -> JointMotor:
        """What its joint has of it: inertia and damping times the ratio squared, torque times the ratio."""
        ratio = abs(self.gear_ratio or 1.0)
        return JointMotor(
            inertia=self.inertia * ratio * ratio,
            damping=self.damping * ratio * ratio,
            max_torque=self.max_torque * ratio,
            max_velocity=self.max_velocity / ratio,
            gear_ratio=self.gear_ratio,
        )
