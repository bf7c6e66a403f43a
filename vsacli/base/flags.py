"""The bits that mark a step of a joint: one enum for result file, report and documentation."""

from __future__ import annotations

import enum


class Flag(enum.IntFlag):
    """Bits of the variable `flags`; each meaning is a sentence that fits after "this step is"/"has"."""

    INFEASIBLE = 1
    SINGULAR = 2
    NEAR_SINGULAR = 4
    SLACK = 8
    DEFLECTION_LIMIT = 16
    MOTOR_TORQUE_LIMIT = 32
    MOTOR_VELOCITY_LIMIT = 64
    POSITION_LIMIT = 128
    VELOCITY_LIMIT = 256
    STIFFNESS_LIMIT = 512

    @property
    def label(self) -> str:
        """Lower-case name, as in `flag_meanings` and the report."""
        return str(self.name).lower()

    @property
    def meaning(self) -> str:
        """What the bit says, for people."""
        return _MEANING[self]


_MEANING = {
    Flag.INFEASIBLE: "the stiffness cannot be reached while the joint carries its elastic torque",
    Flag.SINGULAR: "the decoupling matrix is singular: deflection rates and motor torques are undefined",
    Flag.NEAR_SINGULAR: "the relative margin to a singular decoupling matrix is below the threshold",
    Flag.SLACK: "a tendon that can only pull would have to push",
    Flag.DEFLECTION_LIMIT: "a transmission is deflected beyond its max_deflection",
    Flag.MOTOR_TORQUE_LIMIT: "a motor torque exceeds max_torque",
    Flag.MOTOR_VELOCITY_LIMIT: "a motor velocity exceeds max_velocity",
    Flag.POSITION_LIMIT: "the commanded position leaves the joint's range",
    Flag.VELOCITY_LIMIT: "the commanded velocity exceeds the joint's limit",
    Flag.STIFFNESS_LIMIT: "the commanded stiffness leaves the joint's allowed range",
}

LIMITS = (
    Flag.DEFLECTION_LIMIT
    | Flag.MOTOR_TORQUE_LIMIT
    | Flag.MOTOR_VELOCITY_LIMIT
    | Flag.POSITION_LIMIT
    | Flag.VELOCITY_LIMIT
    | Flag.STIFFNESS_LIMIT
)
"""The bits that mean "over a limit"."""
