"""Description of a robot: its parameters, its reach, the torques of its weight, and its attainable stiffness.

Reach and static load are maxima over configurations, found by coordinate ascent from random configurations.
As a function of a single revolute joint, each objective is a + b cos q + c sin q, so that a step is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import MIN_MARGIN
from vsacli.documents.record_values import json_fields
from vsacli.robot.attainable import attainable_stiffnesses
from vsacli.robot.joint import Joint
from vsacli.robot.kinematics import base_gravity, frames
from vsacli.robot.model import Robot

MOST_STARTS = 16
"""Number of random start configurations for each goal; fewer in long chains."""

MOST_SWEEPS = 50
NEGLIGIBLE_GAIN = 1e-11
"""Relative gain of a sweep over all joints below which the search ends."""

MOST_EVALUATIONS = 1e7
"""Limit on samples times joints evaluated by a search; beyond it, random configurations are not improved."""

SAMPLES_AT_NO_COST = 300
"""Number of samples up to which an evaluation takes the same time."""

SEED = 0
TURN = 2 * math.pi
_ANGLES = np.array([0, TURN / 3, 2 * TURN / 3])

Objective = Callable[[FloatArray], FloatArray]
"""Function of configurations (samples, joints) that returns values of the goals (samples, goals)."""


class Extremes(NamedTuple):
    """Largest magnitude of each goal, (goals,), and a configuration that attains it, (goals, joints)."""

    values: FloatArray
    configurations: FloatArray


def free_range(joint: Joint) -> tuple[float, float]:
    """Return the positions to search: within limits; without limits one turn, or zero if prismatic."""
    low, high = joint.limits.position
    if math.isfinite(low) and math.isfinite(high):
        return low, high
    if not joint.is_revolute:
        return (0.0, 0.0)
    if math.isfinite(low):
        return low, low + TURN
    return (high - TURN, high) if math.isfinite(high) else (-math.pi, math.pi)


def unlimited(joint: Joint) -> bool:
    """Return whether the joint is prismatic and lacks a position limit, so that it is held at zero."""
    return not joint.is_revolute and not all(map(math.isfinite, joint.limits.position))


def largest_magnitudes(objective: Objective, goals: int, robot: Robot) -> Extremes:
    """Maximize the magnitude of each goal separately; NaN if values overflow."""
    with np.errstate(all="ignore"):
        q = _coordinate_ascent(objective, _start_configurations(goals, robot), robot)
        magnitudes = np.abs(_values_of_goals(objective, q))
    best_start, goal_index = magnitudes.argmax(axis=1), np.arange(goals)
    return Extremes(magnitudes[goal_index, best_start], q[goal_index, best_start])


def _start_configurations(goals: int, robot: Robot) -> FloatArray:
    """Return start configurations, (goals, starts, joints)."""
    joint_count = len(robot.joints)
    starts = min(MOST_STARTS, max(2, 200 // joint_count))
    low, high = np.array([free_range(joint) for joint in robot.joints]).T
    return np.random.default_rng(SEED).uniform(low, high, (goals, starts, joint_count))


def _coordinate_ascent(objective: Objective, q: FloatArray, robot: Robot) -> FloatArray:
    """Return the configurations after sweeps over all joints, repeated until the gain is negligible."""
    joint_count = len(robot.joints)
    sweep_evaluations = max(q[..., 0].size * len(_ANGLES), SAMPLES_AT_NO_COST) * joint_count * joint_count
    previous_magnitudes = np.zeros(len(q))
    for _ in range(min(MOST_SWEEPS, int(MOST_EVALUATIONS / sweep_evaluations))):
        for index, joint in enumerate(robot.joints):
            best_position = _best_angle if joint.is_revolute else _best_end
            q[..., index] = best_position(objective, q, index, np.array(free_range(joint)))
        magnitudes = np.abs(_values_of_goals(objective, q)).max(axis=1)
        if np.all(magnitudes - previous_magnitudes <= NEGLIGIBLE_GAIN * magnitudes):
            break
        previous_magnitudes = magnitudes
    return q


def _values_of_goals(objective: Objective, q: FloatArray) -> FloatArray:
    """Return the values of each goal at its own configurations, (..., goals, starts, joints)."""
    all_values = objective(q.reshape(-1, q.shape[-1])).reshape(*q.shape[:-1], q.shape[-3])
    goal_values: FloatArray = np.einsum("...gsg->...gs", all_values)
    return goal_values


def _values_at_positions(
    objective: Objective, q: FloatArray, index: int, positions: FloatArray
) -> FloatArray:
    """Return values with one joint moved to each of several positions, (positions, goals, starts)."""
    moved_q = np.repeat(q[None], len(positions), axis=0)
    moved_q[..., index] = positions[:, None, None]
    return _values_of_goals(objective, moved_q)


def _best_end(objective: Objective, q: FloatArray, index: int, limits: FloatArray) -> FloatArray:
    low_magnitude, high_magnitude = np.abs(_values_at_positions(objective, q, index, limits))
    best: FloatArray = np.where(high_magnitude > low_magnitude, limits[1], limits[0])
    return best


def _best_angle(objective: Objective, q: FloatArray, index: int, limits: FloatArray) -> FloatArray:
    """Return the maximum of |a + b cos q + c sin q| between the ends, from its values at three angles."""
    values_at_thirds = _values_at_positions(objective, q, index, _ANGLES)
    a = values_at_thirds.mean(axis=0)
    b, c = (np.tensordot(wave(_ANGLES), values_at_thirds, 1) * 2 / len(_ANGLES) for wave in (np.cos, np.sin))
    peak = np.arctan2(c, b)
    peak_angles = [limits[0] + np.mod(angle - limits[0], TURN) for angle in (peak, peak + math.pi)]
    candidates = np.stack(
        [np.minimum(angle, limits[1]) for angle in peak_angles] + [np.full_like(peak, end) for end in limits]
    )
    magnitudes = np.abs(a + b * np.cos(candidates) + c * np.sin(candidates))
    best: FloatArray = np.take_along_axis(candidates, magnitudes.argmax(axis=0)[None], axis=0)[0]
    return best


LOAD_ROUNDING = 1e-12
"""Fraction of the largest torque below which torques are rounding errors and count as zero."""


def describe_robot(robot: Robot) -> dict[str, Any]:
    """Describe a robot as JSON values in SI units: fields, reach, static load and attainable stiffness.

    `reach`, by tool if there are `tools`, and `static_load` are the largest values found over the
    configurations within the position limits; a prismatic joint without limits is held at zero. `static_load`
    is the torque of gravity alone. `stiffness_range` of a joint with commanded stiffness is the attainable
    range `unloaded`, without torque, and `loaded`, with the static load in either direction; an unbounded end
    is infinite, and both ends are NaN if the springs cannot carry the load. For an elastic joint it is the
    stiffness of its spring at these torques. `attainable_stiffness` is the part of it within the limits that
    matter at rest, with what `bounds` each end.
    """
    reach_by_tool = _describe_reaches(robot)
    return {
        "kind": "robot",
        **_without_defaults(json_fields(robot), "tools"),
        "mass": sum(joint.link.mass for joint in robot.joints),
        "reach": reach_by_tool if robot.tools else next(iter(reach_by_tool.values()), None),
        "joints": _describe_joints(robot),
        "held_at_zero": held_at_zero(robot),
        "warnings": list(robot.warnings),
    }


def _without_defaults(fields: dict[str, Any], *names: str) -> dict[str, Any]:
    """Return fields without those of trees that are not given."""
    return {name: content for name, content in fields.items() if content or name not in names}


def _describe_reaches(robot: Robot) -> dict[str, Any]:
    """Return the reach of each tool by its name."""
    if not robot.end_effectors:
        return {}
    farthest, bounds = reach(robot), reach_bounds(robot)
    return {
        name: {"bound": bound, "found": float(found), "at": configuration.tolist()}
        for name, bound, found, configuration in zip(
            robot.tool_names, bounds, farthest.values, farthest.configurations, strict=True
        )
    }


def _describe_joints(robot: Robot) -> list[dict[str, Any]]:
    loads = static_load(robot)
    carriers = [None if parent < 0 else robot.joint_names[parent] for parent in robot.parents]
    chain_carriers = [None, *robot.joint_names[:-1]]
    return [
        {
            **_without_defaults({**json_fields(joint), "parent": None}, "parent", "mount"),
            **({} if carriers == chain_carriers else {"parent": carriers[index]}),
            "static_load": {"torque": float(value), "at": configuration.tolist()},
            "stiffness_range": stiffness_ranges(joint, float(value), float(configuration[index])),
            "attainable_stiffness": _describe_attainable(joint, float(value), float(configuration[index])),
        }
        for index, (joint, value, configuration) in enumerate(
            zip(robot.joints, static_loads(loads), loads.configurations, strict=True)
        )
    ]


def stiffness_ranges(joint: Joint, load: float, q: float) -> dict[str, list[float]]:
    """Return the stiffness attainable `unloaded` and `loaded` (a torque either way) at q, N m/rad (N/m).

    For a joint without commanded stiffness, its stiffness at these torques; empty if it has no springs.
    """
    if not joint.actuator.sprung:
        return {}
    tau_e = np.array([0.0, load, -load])
    with np.errstate(all="ignore"):  # a load may be infinite or NaN
        if "stiffness" not in joint.actuator.commanded:
            at_rest = Command.at_rest(tau_e, np.full(3, q))
            stiffness = joint.actuator.transmit(at_rest, MIN_MARGIN, None).stiffness
            return {
                "unloaded": [float(stiffness[0])] * 2,
                "loaded": [float(stiffness[1:].min()), float(stiffness[1:].max())],
            }
        solution = joint.actuator.solve(tau_e, np.ones(3), np.full(3, q))
    return {
        "unloaded": [float(solution.lower[0]), float(solution.upper[0])],
        "loaded": [float(solution.lower.max()), float(solution.upper.min())],
    }


def _describe_attainable(joint: Joint, load: float, q: float) -> dict[str, dict[str, Any]]:
    """Return the stiffness attainable within all limits; empty if it is not commanded."""
    if "stiffness" not in joint.actuator.commanded:
        return {}
    attainable = attainable_stiffnesses(joint, load, q)
    return {
        name: {"range": [*attainable_range.range], "bounds": [*attainable_range.bounds]}
        for name, attainable_range in attainable.items()
    }


def gravity_torques(robot: Robot, q: FloatArray) -> FloatArray:
    """Return the torques that hold the links at rest at q, (samples, joints), N m (N).

    Moment of the weight of all links that a joint moves about its axis, or weight along it.
    """
    gravity = np.array([float(component) for component in base_gravity(robot)])
    _, seats, links, _ = frames(robot, q)
    torques = np.empty_like(q)
    mass, moment = np.zeros(len(robot.joints)), np.zeros((len(robot.joints), len(q), 3))
    for index, joint in reversed(list(enumerate(robot.joints))):
        mass[index] += joint.link.mass
        moment[index] += joint.link.mass * links[index].point(joint.link.com)
        axis, origin = seats[index].axes[..., 2], seats[index].origin
        moment_arm = np.cross(axis, moment[index] - mass[index] * origin)
        torques[:, index] = -(moment_arm if joint.is_revolute else mass[index] * axis) @ gravity
        if (parent := robot.parents[index]) >= 0:
            mass[parent] += mass[index]
            moment[parent] += moment[index]
    return torques


def reach(robot: Robot) -> Extremes:
    """Return the largest distance found of each tool from the origin of DH frame 0, m."""

    def squared(q: FloatArray) -> FloatArray:
        positions = [tool.origin for tool in frames(robot, q).tools]
        return np.stack([np.sum(position * position, axis=1) for position in positions], axis=1)

    farthest = largest_magnitudes(squared, len(robot.end_effectors), robot)
    return farthest._replace(values=np.sqrt(farthest.values))


def reach_bounds(robot: Robot) -> list[float]:
    """Return an upper bound on the distance of each tool from the origin of DH frame 0, m.

    The bound is the sum of the lengths of all links on the way and of their mounts, with prismatic joints at
    the farther end of their range.
    """
    return [
        sum(_farthest_length(robot.joints[index]) for index in robot.paths[carrier]) + math.hypot(*tool.xyz)
        for tool, carrier in zip(robot.end_effectors, robot.tool_joints, strict=True)
    ]


def _farthest_length(joint: Joint) -> float:
    positions = (0.0,) if joint.is_revolute else free_range(joint)
    mount = 0.0 if joint.mount is None else math.hypot(*joint.mount.xyz)
    return mount + math.hypot(joint.dh.a, max(abs(joint.dh.d + end) for end in positions))


def static_load(robot: Robot) -> Extremes:
    """Return the largest |torque| of each joint found for gravity alone, N m (N)."""
    return largest_magnitudes(lambda q: gravity_torques(robot, q), len(robot.joints), robot)


def static_loads(loads: Extremes) -> FloatArray:
    """Return the static loads of all joints, (joints,), N m (N), with zero in place of rounding errors."""
    rounding = LOAD_ROUNDING * np.max(loads.values, initial=0.0)
    return np.where(loads.values <= rounding, 0.0, loads.values)


def held_at_zero(robot: Robot) -> list[str]:
    """Return the prismatic joints without both position limits, held at zero for reach and load."""
    return [joint.name for joint in robot.joints if unlimited(joint)]
