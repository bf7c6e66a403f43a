"""A robot: its numbers as they were understood, and what follows from them."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsacli.actuators.antagonistic import Antagonistic, solve_deflections
from vsacli.files.info.record import plain
from vsacli.files.info.workspace import held, reach, reach_bound, static_load
from vsacli.robot.model import Joint, Robot

RELATIVE_ROUNDING = 1e-12
"""Torques below this share of the largest are the rounding of a zero."""


def describe_robot(robot: Robot) -> dict[str, Any]:
    """A robot as JSON values in SI units: every declared field, reach, static load and reachable stiffness.

    `reach` and `static_load` are the largest values found over the configurations within the position limits;
    a prismatic joint without limits is held at zero. `static_load` is the torque of gravity alone.
    `stiffness_range` of an antagonistic joint is reachable while it carries no torque, `loaded` while it
    carries the static load in either direction; an end that nothing bounds is infinite, both are NaN if the
    springs cannot carry the load.
    """
    return {
        "kind": "robot",
        **plain(robot),
        "mass": sum(joint.link.mass for joint in robot.joints),
        "reach": _described_reach(robot),
        "joints": _joints(robot),
        "held_at_zero": held(robot),
        "warnings": list(robot.warnings),
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
    least = RELATIVE_ROUNDING * np.max(loads.values, initial=0.0)
    values = np.where(loads.values <= least, 0.0, loads.values)
    return [
        {
            **plain(joint),
            "static_load": {"torque": float(value), "at": configuration.tolist()},
            "stiffness_range": stiffness_ranges(joint, float(value)),
        }
        for joint, value, configuration in zip(robot.joints, values, loads.configurations, strict=True)
    ]


def stiffness_ranges(joint: Joint, load: float) -> dict[str, list[float]]:
    """The stiffness reachable `unloaded`, and `loaded` by a torque in either direction, N m/rad (N/m).

    Empty if the joint is not antagonistic.
    """
    if not isinstance(joint.actuator, Antagonistic):
        return {}
    tau_e = np.array([0.0, load, -load])
    with np.errstate(all="ignore"):  # a load may be beyond all numbers
        solution = solve_deflections(joint.actuator, tau_e, np.ones(3))
    return {
        "unloaded": [float(solution.lower[0]), float(solution.upper[0])],
        "loaded": [float(solution.lower.max()), float(solution.upper.min())],
    }
