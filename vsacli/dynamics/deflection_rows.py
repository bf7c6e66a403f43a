"""Deflections as inputs of a kernel, in place of the root of (14): states that are integrated over time.

`IntegratedRows` are deflections by (19), `InternalRows` those inside damped transmissions. Each class
declares its rows and picks those of a joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.transmission import InternalMotion
from vsacli.base.arrays import FloatArray
from vsacli.compute.vector import Scalar

INTERNAL = ("internal_phi", "internal_velocity", "internal_acceleration")
"""Names of the rows of internal motion in damped transmissions, in the order of `InternalMotion`."""

Inputs = Mapping[str, Sequence[Scalar]]
"""Input rows of a kernel by name."""


@dataclass(frozen=True)
class IntegratedRows:
    """Deflections that follow from (19), of all joints; a sample where they are NaN is infeasible."""

    def shapes(self, joints: int) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the inputs of a robot with this many joints, by name."""
        return {"phi": (joints, SIDES)}

    def of_joint(self, index: int, inputs: Inputs) -> FloatArray:
        """Return the deflections of a joint, (2, samples)."""
        return _spring_rows(inputs["phi"], index)


@dataclass(frozen=True)
class InternalRows:
    """Internal motion of damped transmissions.

    Attributes:
        joints: Joints with a damped transmission, by index.
        names: Names of `INTERNAL`; only the first where the rates follow from the damping.
    """

    joints: tuple[int, ...]
    names: tuple[str, ...] = INTERNAL

    def shapes(self, _joints: int) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the inputs, by name."""
        joint_shape = (len(self.joints),)
        return dict(zip(self.names, ((*joint_shape, SIDES), joint_shape, joint_shape), strict=False))

    def of_joint(self, index: int, inputs: Inputs) -> InternalMotion | None:
        """Return the internal motion of a joint; None unless its transmission is damped."""
        if index not in self.joints:
            return None
        position = self.joints.index(index)
        rates = (inputs[name][position] if name in self.names else None for name in INTERNAL[1:])
        return InternalMotion(_spring_rows(inputs[INTERNAL[0]], position), *rates)


def internal_rows(motions: Mapping[int, InternalMotion]) -> dict[str, FloatArray]:
    """Return the inputs of `InternalRows`, from the motion of each of its joints, in that order."""
    columns = zip(*motions.values(), strict=True)
    # Compiled code reads rows that are contiguous, which stacking columns would not give.
    return {
        name: np.ascontiguousarray(np.vstack(column)) for name, column in zip(INTERNAL, columns, strict=False)
    }


def _spring_rows(rows: Sequence[Scalar], position: int) -> FloatArray:
    """Return the rows of both springs of a joint, (2, samples), from those of all joints in order."""
    return np.stack(rows[SIDES * position : SIDES * (position + 1)])
