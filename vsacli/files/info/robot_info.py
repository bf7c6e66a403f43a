"""A robot: its numbers as they were understood, how far it reaches, what its weight asks of its joints."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.documents.fields import declared
from vsacli.files.info.extremes import Extremes, free_range, largest_sizes, unlimited
from vsacli.robot.joint import Joint
from vsacli.robot.kinematics import base_gravity, frames, tip_position
from vsacli.robot.model import Robot

LOAD_ROUNDING = 1e-12
"""Torques below this share of the largest are the rounding of a zero."""


def describe_robot(robot: Robot) -> dict[str, Any]:
    """A robot as JSON values in SI units: every declared field, reach, static load and reachable stiffness.

    `reach` and `static_load` are the largest values found over the configurations within the position limits;
    a prismatic joint without limits is held at zero. `static_load` is the torque of gravity alone.
    `stiffness_range` of a joint whose stiffness is commanded is reachable while it carries no torque,
    `loaded` while it carries the static load in either direction; an end that nothing bounds is infinite,
    both are NaN if the springs cannot carry the load. Of an elastic joint it is the stiffness that its spring
    then has.
    """
    return {
        "kind": "robot",
        **_json_fields(robot),
        "mass": sum(joint.link.mass for joint in robot.joints),
        "reach": _described_reach(robot),
        "joints": _joints(robot),
        "held_at_zero": held_at_zero(robot),
        "warnings": list(robot.warnings),
    }


def _json_fields(record: Any) -> dict[str, Any]:
    """The declared fields of a record."""
    return {
        name: None
        if (content := getattr(record, name)) is None
        else field.kind.json_value(content, _json_fields)
        for name, (field, _) in declared(type(record)).items()
    }


def _described_reach(robot: Robot) -> dict[str, Any]:
    found = reach(robot)
    return {
        "bound": reach_bound(robot),
        "found": float(found.values[0]),
        "at": found.configurations[0].tolist(),
    }


def _joints(robot: Robot) -> list[dict[str, Any]]:
    loads = static_load(robot)
    least = LOAD_ROUNDING * np.max(loads.values, initial=0.0)
    values = np.where(loads.values <= least, 0.0, loads.values)
    return [
        {
            **_json_fields(joint),
            "static_load": {"torque": float(value), "at": configuration.tolist()},
            "stiffness_range": stiffness_ranges(joint, float(value), float(configuration[index])),
        }
        for index, (joint, value, configuration) in enumerate(
            zip(robot.joints, values, loads.configurations, strict=True)
        )
    ]


def stiffness_ranges(joint: Joint, load: float, q: float) -> dict[str, list[float]]:
    """The stiffness reachable `unloaded`, and `loaded` by a torque in either direction, N m/rad (N/m), at q.

    Of a joint whose stiffness is not commanded, that which it has then; empty if it has no springs.
    """
    if not joint.actuator.sprung:
        return {}
    tau_e = np.array([0.0, load, -load])
    with np.errstate(all="ignore"):  # a load may be beyond all numbers
        if "stiffness" not in joint.actuator.commanded:
            at_rest = Command.at_rest(tau_e, np.full(3, q))
            held = joint.actuator.transmit(at_rest, NEAR_SINGULAR_MARGIN, None).stiffness
            return {
                "unloaded": [float(held[0])] * 2,
                "loaded": [float(held[1:].min()), float(held[1:].max())],
            }
        solution = joint.actuator.solve(tau_e, np.ones(3), np.full(3, q))
    return {
        "unloaded": [float(solution.lower[0]), float(solution.upper[0])],
        "loaded": [float(solution.lower.max()), float(solution.upper.min())],
    }


def gravity_torques(robot: Robot, q: FloatArray) -> FloatArray:
    """Torques that hold the links still, (samples, joints), N m (N), at q of (samples, joints).

    Moment of the weight of all links beyond a joint about its axis, or weight along it.
    """
    gravity = np.array([float(component) for component in base_gravity(robot)])
    poses = list(frames(robot, q))
    torques, mass, moment = np.empty_like(q), 0.0, np.zeros((len(q), 3))
    for index, joint in reversed(list(enumerate(robot.joints))):
        mass += joint.link.mass
        moment += joint.link.mass * poses[index + 1].point(joint.link.com)
        axis = poses[index].axes[..., 2]
        arm = np.cross(axis, moment - mass * poses[index].origin) if joint.is_revolute else mass * axis
        torques[:, index] = -arm @ gravity
    return torques


def reach(robot: Robot) -> Extremes:
    """The largest distance of the end effector's frame from the origin of DH frame 0 that was found, m."""

    def squared(q: FloatArray) -> FloatArray:
        position = tip_position(robot, q)
        return np.asarray(np.sum(position * position, axis=1, keepdims=True))

    found = largest_sizes(squared, 1, robot)
    return found._replace(values=np.sqrt(found.values))


def reach_bound(robot: Robot) -> float:
    """No configuration takes the end effector's frame farther than this from the origin of DH frame 0, m.

    The sum of the lengths of all links, of prismatic joints at the end of their range that is farther.
    """
    return sum(map(_length, robot.joints)) + math.hypot(*robot.tool.xyz)


def _length(joint: Joint) -> float:
    ends = (0.0,) if joint.is_revolute else free_range(joint)
    return math.hypot(joint.dh.a, max(abs(joint.dh.d + end) for end in ends))


def static_load(robot: Robot) -> Extremes:
    """The largest |torque| that gravity alone demands of each joint, N m (N), as far as was found."""
    return largest_sizes(lambda q: gravity_torques(robot, q), len(robot.joints), robot)


def held_at_zero(robot: Robot) -> list[str]:
    """Prismatic joints without both position limits, which reach and load take to stand at zero."""
    return [joint.name for joint in robot.joints if unlimited(joint)]
