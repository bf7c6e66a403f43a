"""Motors of a catalogue for a joint whose rotors are coupled: only pairs with which the robot can be built.

A coupled inertia stays as it is on the joint's side, whatever the motors. Rotors that are too light for it
would have an inertia matrix that is not positive definite, so motors of such a joint are chosen together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vsacli.actuators.rotors import largest_coupling
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.robot.joint import Joint
from vsacli.studies.sizing.catalogue import CatalogueMotor
from vsacli.studies.sizing.choices import Choice, cost_of


def coupled_choices(
    joint: Joint,
    first: Sequence[Choice],
    second: Sequence[Choice],
    motors: Mapping[str, CatalogueMotor],
    criterion: str,
) -> tuple[tuple[Choice, ...], tuple[Choice, ...]]:
    """Return the choices for both motors of a joint that can be coupled with the best of the other's.

    Of the pairs with which the robot can be built, the best has most motors that do, then least of the
    criterion: the sum of both, or the larger share of a limit.

    Args:
        joint: with a coupled inertia.
        first: choices for motor 1, the best first.
        second: choices for motor 2, likewise.
        motors: of the catalogue by name.
        criterion: by which they are sorted.

    Raises:
        InputError: no two rotors are heavy enough.
    """
    inertias = [[motors[each.motor].inertia * each.ratio**2 for each in some] for some in (first, second)]
    possible = _buildable(joint, *inertias)
    lacking, cost = (
        np.add.outer([not each.does for each in first], [not each.does for each in second]).astype(float),
        _costs(first, second, criterion),
    )
    ranks = np.add.outer(np.arange(len(first)), np.arange(len(second)))
    order = np.lexsort([each.ravel() for each in (ranks, cost, lacking, ~possible)])
    one, other = np.unravel_index(order[0], possible.shape)
    return (
        tuple(each for each, fits in zip(first, possible[:, other], strict=True) if fits),
        tuple(each for each, fits in zip(second, possible[one], strict=True) if fits),
    )


def _buildable(joint: Joint, first: Sequence[float], second: Sequence[float]) -> BoolArray:
    """Which pairs of rotors, by their inertias on the joint's side, can be coupled as they are."""
    coupled = joint.actuator.coupled_rotors
    largest = np.array([[largest_coupling(one, other) for other in second] for one in first])
    possible: BoolArray = abs(coupled) < largest
    if not possible.any():
        raise InputError.one(
            f"joint {joint.name}: coupled_inertia is {coupled:g} on the joint's side, that of rotors of the "
            f"catalogue, with their best gears, must be below {largest.max():.4g}; correct it, or offer "
            "heavier rotors or larger gears, and size again"
        )
    return possible


def _costs(first: Sequence[Choice], second: Sequence[Choice], criterion: str) -> FloatArray:
    costs = [[cost_of(each, criterion) for each in some] for some in (first, second)]
    together = np.maximum if criterion == "utilisation" else np.add
    return np.asarray(together.outer(*costs), dtype=np.float64)
