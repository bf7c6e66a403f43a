"""What a study keeps of each run: scalars of its report, each declared once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.analysis.joint_report import JointReport
from vsacli.analysis.report import Report
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.units import Quantity
from vsacli.base.variables import MOTORS

JOINT, MOTOR = ("joint",), ("joint", "motor")


class Kept(NamedTuple):
    """A scalar of the report of each joint, or of each of its motors.

    Attributes:
        name: in study files and tables.
        dims: dimensions after `run`.
        quantity: its unit.
        long_name: a few words.
        of_joint: gives it.
        whole: whether it is NaN at a joint with infeasible or singular steps, since it would be that of the
            others alone.
    """

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str
    of_joint: Callable[[JointReport], float | tuple[float, float]]
    whole: bool = False

    def shape(self, joints: int) -> tuple[int, ...]:
        """Of its values in one run."""
        return (joints, len(MOTORS))[: len(self.dims)]

    def values(self, report: Report) -> FloatArray:
        """Its values in a run."""
        return np.array([self._of(joint) for joint in report.joints], dtype=float)

    def _of(self, joint: JointReport) -> float | tuple[float, float]:
        if self.whole and (joint.steps.get("infeasible") or joint.steps.get("singular")):
            return (math.nan,) * len(MOTORS) if self.dims == MOTOR else math.nan  # type: ignore[return-value]
        return self.of_joint(joint)


KEPT = {
    each.name: each
    for each in (
        Kept(
            "margin",
            JOINT,
            units.DIMENSIONLESS,
            "smallest relative margin to an end of the corridor",
            lambda joint: joint.margin,
        ),
        Kept(
            "margin_time", JOINT, units.TIME, "when the margin is smallest", lambda joint: joint.margin_time
        ),
        Kept(
            "infeasible_steps",
            JOINT,
            units.DIMENSIONLESS,
            "number of infeasible steps",
            lambda joint: float(joint.steps.get("infeasible", 0)),
        ),
        Kept(
            "first_infeasible",
            JOINT,
            units.TIME,
            "time of the first infeasible step",
            lambda joint: joint.first_time.get("infeasible", math.nan),
        ),
        Kept(
            "peak_tau_e",
            JOINT,
            units.TORQUE,
            "largest size of the elastic torque",
            lambda joint: joint.peak_tau_e,
        ),
        Kept(
            "peak_tau_motor",
            MOTOR,
            units.TORQUE,
            "largest size of the motor torque",
            lambda joint: joint.peak_tau_motor,
            whole=True,
        ),
        Kept(
            "peak_dtheta",
            MOTOR,
            units.VELOCITY,
            "largest size of the motor velocity",
            lambda joint: joint.peak_dtheta,
            whole=True,
        ),
        Kept(
            "energy_spent",
            JOINT,
            units.ENERGY,
            "energy that the motors spend",
            lambda joint: joint.energy.spent,
            whole=True,
        ),
        Kept(
            "energy_recovered",
            JOINT,
            units.ENERGY,
            "energy that the motors take back",
            lambda joint: joint.energy.recovered,
            whole=True,
        ),
        Kept(
            "elastic_peak",
            JOINT,
            units.ENERGY,
            "largest energy in the springs",
            lambda joint: joint.energy.elastic_peak,
            whole=True,
        ),
        Kept(
            "co_contraction",
            JOINT,
            units.TORQUE,
            "root mean square of half the difference of the spring torques",
            lambda joint: joint.energy.co_contraction,
            whole=True,
        ),
    )
}
"""By name."""


def columns(kept: Sequence[Kept], report: Report) -> FloatArray:
    """The values of a run one after the other, (columns,)."""
    return np.concatenate([each.values(report).ravel() for each in kept])
