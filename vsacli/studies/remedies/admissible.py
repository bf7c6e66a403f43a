"""Which stiffness a joint may have at an instant, as far as it depends on that instant alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.antagonistic import Antagonistic, solve_deflections
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Joint
from vsacli.studies.remedies.acceptance import Acceptance, path_reason
from vsacli.studies.remedies.impossible import ImpossibleError
from vsacli.studies.remedies.load import Load

HALVINGS = 50
"""Bisections of a share of 0 to 1: down to rounding."""


class Range(NamedTuple):
    """Smallest and largest admissible stiffness, (samples,); none where low > high or low is NaN."""

    low: FloatArray
    high: FloatArray


def checked_range(acceptance: Acceptance, joint: Joint, load: Load) -> Range:
    """The admissible stiffness at every instant of a load, whose low end always exists.

    Raises:
        ImpossibleError: no stiffness mends the joint, or it has none to choose.
    """
    chosen_actuator(joint)
    if reason := path_reason(joint, load.time, load.command):
        raise ImpossibleError(f"no stiffness changes that {reason}")
    admissible = admissible_stiffness(joint, load.command, acceptance.near_singular)
    if np.isnan(admissible.low).any():
        raise ImpossibleError(acceptance.reason(joint, load.time, load.command))
    return admissible


def chosen_actuator(joint: Joint) -> Antagonistic:
    """The actuator of a joint, if a trajectory chooses its stiffness.

    Raises:
        ImpossibleError: it does not.
    """
    if not isinstance(joint.actuator, Antagonistic):
        raise ImpossibleError(f"the actuator of {joint.name} has no stiffness to choose")
    return joint.actuator


def admissible_stiffness(joint: Joint, command: Command, near_singular: float) -> Range:
    """Stiffness that keeps the margin, the joint's stiffness limit and the deflection limits.

    The margin min(sigma - lower, upper - sigma)/sigma >= m means lower/(1-m) <= sigma <= upper/(1+m).

    Args:
        joint: with springs and limits.
        command: its elastic torque counts, and its stiffness as a scale.
        near_singular: the margin m.
    """
    actuator = chosen_actuator(joint)
    corridor = solve_deflections(actuator, command.tau_e, command.stiffness)
    least, most = joint.limits.stiffness
    low = np.maximum(corridor.lower / (1 - near_singular), least)
    high = np.minimum(corridor.upper / (1 + near_singular), most)
    if all(np.isinf(spring.max_deflection) for spring in actuator.spring):
        return Range(low, high)
    return Range(low, np.minimum(high, _deflection_ceiling(actuator, command, corridor.lower)))


def _deflection_ceiling(actuator: Antagonistic, command: Command, lower: FloatArray) -> FloatArray:
    """The stiffness from `lower` on up to which both deflections keep their limit.

    With the stiffness grows the preload: phi_1 increases and phi_2 decreases, or the other way round. What is
    halved is a share x of 0 to 1, which maps to all stiffness above `lower`.
    """
    limits = np.array([[spring.max_deflection] for spring in actuator.spring])
    kept, broken = np.zeros_like(lower), np.ones_like(lower)
    for _ in range(HALVINGS):
        share = (kept + broken) / 2
        stiffness = lower + command.stiffness * share / (1 - share)
        solution = solve_deflections(actuator, command.tau_e, stiffness)
        within = np.all(np.abs([solution.phi_1, solution.phi_2]) <= limits, axis=0)
        kept, broken = np.where(within, share, kept), np.where(within, broken, share)
    return lower + command.stiffness * kept / (1 - kept)
