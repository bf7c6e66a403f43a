"""What dampers are held against: the inertia that they calm, and the stiffness with which it swings."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.documents.plausibility import Measured, Rule, Slip
from vsacli.documents.record_numbers import Entry
from vsacli.robot.joint import Joint
from vsacli.robot.plausibility.body_rules import SIZES
from vsacli.robot.plausibility.facts import Facts, joint_path
from vsacli.robot.plausibility.spring_rules import corridor


def _stiffness_at_rest(joint: Joint) -> float:
    """The least that a joint can have without load, N m/rad (N/m)."""
    found = corridor(joint)
    if found is not None:
        return found.lower if found.lower > 0 else found.upper
    held = joint.actuator.transmit(Command.at_rest(np.zeros(1), np.zeros(1)), NEAR_SINGULAR_MARGIN, None)
    return float(held.stiffness[0])


def _largest_dampings(facts: Facts) -> Iterator[Measured]:
    """The upper end of each damper's range over twice the root of inertia times stiffness."""
    for number, joint in enumerate(facts.joints):
        if joint.damper is None or not joint.actuator.sprung or facts.placeholder:
            continue
        inertia, stiffness = float(facts.sizes.moved[number]), _stiffness_at_rest(joint)
        damping = joint.damper.range[1]
        size = damping / (2 * math.sqrt(inertia * stiffness)) if inertia * stiffness > 0 else math.nan
        unit = "N m s/rad" if joint.is_revolute else "N s/m"
        yield Measured(joint_path(number, joint, "damper", "range", Entry(1)), damping, unit, size)


DAMPER_RULES: tuple[Rule[Facts], ...] = (
    Rule(
        name="ranges of dampers",
        fields="`damper.range`",
        measure=_largest_dampings,
        size="over 2 sqrt(I sigma), with the inertia of the stretched arm and the least stiffness",
        low=1e-3,
        high=100,
        usual=0.7,
        finding="gives the stretched arm on its springs a damping ratio of {size}",
        reason="below a thousandth nothing is calmed, above a hundred the joint creeps",
        slips=(
            Slip("N mm s/rad", 1e-3, instead_of="N m s/rad"),
            Slip("N m s/deg", 180 / math.pi, instead_of="N m s/rad"),
            Slip("N s/mm", 1e3, instead_of="N s/m"),
        ),
        advice="check the units of damping, stiffness and inertia",
        explained_by=SIZES,
    ),
)
