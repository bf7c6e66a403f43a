"""Excitations scaled into the limits of their robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli.analysis.clearances import Bounded, bounded_quantities, clearances
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag
from vsacli.base.variables import Block
from vsacli.dynamics.inverse import compute_block
from vsacli.studies.identification.excitation.allowed import MARGIN
from vsacli.studies.identification.excitation.design import Design
from vsacli.studies.remedies.acceptance import ImpossibleError
from vsacli.trajectory.trajectory import Trajectory

BISECTIONS = 6
"""Of the share of a motion that limits allow, down to 1.6 %."""

ROUNDED = 1e-3
"""Relative clearance by which digits of a file, and what lies between samples, may miss the margin."""


@dataclass(frozen=True, eq=False)
class Feasible:
    """An excitation that keeps all limits of its robot at the times of its design's grid.

    Attributes:
        trajectory: the excitation.
        block: all that inverse dynamics finds there.
    """

    trajectory: Trajectory
    block: Block


def feasible(design: Design, numbers: FloatArray) -> Feasible | None:
    """The member of a family, made as small as limits of torques, currents and the like ask for.

    None if it keeps them not even nearly at rest.
    """
    found = _tried(design, numbers, 1.0)
    if found is not None:
        return found
    kept, broken = 0.0, 1.0
    for _ in range(BISECTIONS):
        share = (kept + broken) / 2
        smaller = _tried(design, numbers, share)
        if smaller is None:
            broken = share
        else:
            kept, found = share, smaller
    return found


def least_clearances(design: Design, block: Block) -> FloatArray:
    """The least relative distance of everything that is `watched` to its bounds."""
    least: FloatArray = clearances(watched(design), block).min(axis=1, initial=np.inf)
    return least


def watched(design: Design) -> list[Bounded]:
    """What has bounds and is moved; dampers stand at the least of their ranges."""
    quantities = bounded_quantities(design.robot)
    return [each for each in quantities if Flag.DAMPING_LIMIT not in each.bits]


def _tried(design: Design, numbers: FloatArray, share: float) -> Feasible | None:
    try:
        trajectory = design.member(numbers, share)
    except ImpossibleError:
        return None
    block = compute_block(design.robot, trajectory.at(design.grid))
    if (least_clearances(design, block) < MARGIN - ROUNDED).any():
        return None
    return Feasible(trajectory, block)


def obstacle(design: Design, numbers: FloatArray) -> str:
    """What a member that is nearly at rest lacks to be feasible, a clause."""
    try:
        trajectory = design.member(numbers, 0.0)
    except ImpossibleError as error:
        return str(error)
    gaps = least_clearances(design, compute_block(design.robot, trajectory.at(design.grid)))
    quantity = watched(design)[int(gaps.argmin())]
    motor = "" if quantity.limit is None else quantity.limit.flag.quantity_of(quantity.limit.motor)
    return f"{quantity.joint.name} comes too near to the bounds of its {motor or 'stiffness'} at rest already"
