"""What a joint costs along what it is asked to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.drive import drive
from vsacli.robot.joint import Joint
from vsacli.studies.optimisation.criteria import Criterion
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.task import STEPS


def asked_cost(joint: Joint, load: Load, criterion: Criterion) -> float:
    """What a load as commanded costs over the steps; NaN if it is out of reach."""
    steps = load.at(STEPS)
    return criterion.of(joint, drive(joint, steps.command), steps.time)


def asked_size(joint: Joint, load: Load, criterion: Criterion) -> float:
    """By what that is scaled."""
    steps = load.at(STEPS)
    return criterion.size(joint, drive(joint, steps.command), steps.time)


def cost(joint: Joint, load: Load, criterion: Criterion, rows: FloatArray) -> float:
    """What another stiffness with its derivatives, (3, instants), costs over the steps."""
    commanded = {**load.command.commanded, **dict(zip(STIFFNESS.names, rows, strict=True))}
    other = replace(load, command=load.command._replace(commanded=commanded))
    return asked_cost(joint, other, criterion)


def asked_stiffness(load: Load) -> FloatArray:
    """Stiffness, rate and second derivative as they are commanded."""
    return np.stack([load.command.commanded[name] for name in STIFFNESS.names])
