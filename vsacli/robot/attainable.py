"""Attainable stiffness of a joint at rest, as springs, motors, deflections and its own limits bound it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.reach import LimitCheck
from vsacli.actuators.transmission import Command, JointVariables
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import MIN_MARGIN, Flag, has_flag
from vsacli.base.signals import COMMANDED
from vsacli.robot.joint import Joint

LIMITS_AT_REST = {"tau_motor": "max_torque", "phi": "max_deflection"}
"""Key in robot files of the limits that matter at rest, by the variable that they bound."""

SPRINGS, STIFFNESS_LIMIT = "springs", "limits.stiffness"
"""Bounds in addition to these limits."""

EXCESSES = np.geomspace(1e-4, 1e5, 46)[:, None]
"""Stiffness values tried, as their excess over the minimum relative to it; beyond the last, none bounds."""

SHARES, REFINEMENTS = np.linspace(0, 1, 11)[1:-1, None, None], 5
"""Parts of a step of these values, 58 %, in which an end is searched, and how often: to 6e-6."""

Names = NDArray[np.object_]


class AttainableStiffness(NamedTuple):
    """Attainable stiffness of a joint.

    Attributes:
        range: lower and upper end, N m/rad (N/m); infinite where nothing bounds it, NaN if there is none.
        bounds: what bounds each end, `SPRINGS`, `STIFFNESS_LIMIT` or a limit at rest; None for an infinite
            end. Without a range, what excludes it.
    """

    range: tuple[float, float]
    bounds: tuple[str | None, str | None]


def state_at_rest(
    actuator: Actuator, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray
) -> JointVariables:
    """Return the variables of a joint at rest; all arrays (samples,).

    The torque of a motor at rest is that of its transmission; dry friction, which would help to hold the
    load, is left out.
    """
    still = np.zeros_like(tau_e)
    signal = dict(zip(COMMANDED["stiffness"].names, (stiffness, still, still), strict=True))
    command = Command.at_rest(tau_e, q)._replace(commanded=signal)
    with np.errstate(all="ignore"):  # springs overflow at very large torques
        state = actuator.transmit(command, MIN_MARGIN, None)
    return state._replace(tau_motor=state.tau_transmission)


def attainable_stiffnesses(joint: Joint, load: float, q: float) -> dict[str, AttainableStiffness]:
    """Return the stiffness attainable at rest `unloaded` and `loaded`, with a torque in either direction.

    Args:
        joint: joint with commanded stiffness.
        load: this torque, N m (N).
        q: position of the joint, rad (m).
    """
    tau_e = np.array([0.0, load, -load])
    with np.errstate(all="ignore"):  # a load may be infinite or NaN
        solution = joint.actuator.solve(tau_e, np.ones_like(tau_e), np.full_like(tau_e, q))
        ends, bounds = np.stack([solution.lower, solution.upper]), np.full((2, 3), SPRINGS, dtype=object)
        if any(_limits_at_rest(joint.actuator)):
            ends, bounds = _ends_within_limits(joint.actuator, tau_e, q, ends)
    return {
        "unloaded": _common_range(joint, ends[:, :1], bounds[:, :1]),
        "loaded": _common_range(joint, ends[:, 1:], bounds[:, 1:]),
    }


def _limits_at_rest(actuator: Actuator) -> list[LimitCheck]:
    return [
        check
        for check in actuator.limits
        if check.variable in LIMITS_AT_REST and math.isfinite(check.range[1])
    ]


def _common_range(joint: Joint, ends: FloatArray, bounds: Names) -> AttainableStiffness:
    """Return the range that all torques have in common, within the limits of the joint; (2, torques)."""
    limits = joint.limits.stiffness
    lowest, highest = np.append(ends[0], limits[0]), np.append(ends[1], limits[1])
    low, high = int(lowest.argmax()), int(highest.argmin())  # the index of NaN, if there is one
    names = [np.append(row, STIFFNESS_LIMIT) for row in bounds]
    words = str(names[0][low]), None if highest[high] == math.inf else str(names[1][high])
    if lowest[low] <= highest[high]:
        return AttainableStiffness((float(lowest[low]), float(highest[high])), words)
    return AttainableStiffness((math.nan, math.nan), words)


def _ends_within_limits(
    actuator: Actuator, tau_e: FloatArray, q: float, of_springs: FloatArray
) -> tuple[FloatArray, Names]:
    """Return the ends of the lowest range of stiffness within all limits, and what bounds them, (2, torques).

    The ends are NaN where there is no such range.

    Args:
        actuator: actuator of the joint.
        tau_e: torques, (torques,), N m (N).
        q: position of the joint, rad (m).
        of_springs: ends of the range that the springs attain, (2, torques), N m/rad (N/m).
    """
    lower, upper = of_springs
    unit = np.where(lower > 0, lower, np.where(np.isfinite(upper), upper, 1.0))
    levels = lower + np.minimum(EXCESSES * unit, (upper - lower) * (1 - EXCESSES[0]))
    bounds = _bounds_at(actuator, tau_e, levels, q)
    within, rows, columns = bounds == "", np.arange(len(levels))[:, None], np.arange(len(tau_e))
    first = within.argmax(axis=0)
    beyond = (~within & (rows > first)).argmax(axis=0)  # 0 if there is none
    open_ends = np.stack([first == 0, beyond == 0])
    inside, outside = levels[[first, beyond - 1], columns], levels[[first - 1, beyond], columns]
    names = bounds[[first - 1, beyond], columns]
    for _ in range(REFINEMENTS):
        parts = np.concatenate([inside[None], inside + SHARES * (outside - inside), outside[None]])
        at_parts = _bounds_at(actuator, tau_e, parts[1:-1].reshape(-1, len(tau_e)), q)
        at_parts = np.concatenate([at_parts.reshape(-1, *names.shape), names[None]])
        step = (at_parts != "").argmax(axis=0)[None]
        names = np.take_along_axis(at_parts, step, axis=0)[0]
        inside, outside = (np.take_along_axis(parts, step + side, axis=0)[0] for side in (0, 1))
    names, none = np.where(open_ends, SPRINGS, names), ~within.any(axis=0)
    ends = np.where(names == SPRINGS, of_springs, inside)
    return np.where(none, np.nan, ends), np.where(none, bounds[0], names)


def _bounds_at(actuator: Actuator, tau_e: FloatArray, levels: FloatArray, q: float) -> Names:
    """Return what excludes stiffness values, (levels, torques); empty where they are attainable."""
    torques = np.broadcast_to(tau_e, levels.shape).ravel()
    state = state_at_rest(actuator, torques, levels.ravel(), np.full_like(torques, q))
    names = np.where(has_flag(state.flags, Flag.INFEASIBLE), SPRINGS, "").astype(object)
    for check in _limits_at_rest(actuator):
        exceeded = (names == "") & (check.flags(state.by_name()) != 0)
        names[exceeded] = LIMITS_AT_REST[check.variable]
    return names.reshape(levels.shape)
