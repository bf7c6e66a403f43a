"""Columns of the table of a study: scalars of the report of each run, and variables over time.

Each is declared once as a `Column`. The values of a run form a row of numbers, column after column: `scalars`
and `Recorder` make such rows, `arrays_of` and `pad_curves` convert many rows to arrays by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

import numpy as np

from vsacli.analysis.joint_report import JointReport
from vsacli.analysis.report import Report
from vsacli.analysis.tool_report import ToolReport
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import LIMITS, ToolFlag
from vsacli.base.variables import MOTORS, UNCERTAIN, VARIABLES, Block, deviation

JOINT, MOTOR = ("joint",), ("joint", "motor")
STEP, TIME = "step", "time"


class Column(NamedTuple):
    """A column of the table.

    Attributes:
        name: name in study files and tables.
        dims: dimensions after `run`.
        quantity: physical quantity, which determines the unit.
        long_name: description in a few words.
        of: function that returns the value, or those of two motors, from its source; None for the attribute
            `name`.
        whole: whether the value is NaN for a joint with infeasible or singular samples, since it would only
            describe the other samples.
    """

    name: str
    dims: tuple[str, ...]
    quantity: units.Quantity
    long_name: str
    of: Callable[[Any], Any] | None = None
    whole: bool = False

    def shape(self, joints: int) -> tuple[int, ...]:
        """Return the shape of the values in one run, or at one sample."""
        return (joints, len(MOTORS))[: len(self.dims) - self.dims.count(STEP)]

    def scalar(self, joint: JointReport) -> float | tuple[float, float]:
        """Return the value in the report of a joint, or those of its motors."""
        if self.whole and (joint.samples.get("infeasible") or joint.samples.get("singular")):
            return (math.nan, math.nan) if self.dims == MOTOR else math.nan
        value: float | tuple[float, float] = (self.of or attrgetter(self.name))(joint)
        return value


KEPT = {
    each.name: each
    for each in (
        Column(
            "margin",
            JOINT,
            units.DIMENSIONLESS,
            "smallest relative margin to an end of the attainable stiffness range",
        ),
        Column("margin_time", JOINT, units.TIME, "time of the smallest margin"),
        Column(
            "infeasible_steps",
            JOINT,
            units.DIMENSIONLESS,
            "number of infeasible samples",
            lambda joint: float(joint.samples.get("infeasible", 0)),
        ),
        Column(
            "first_infeasible",
            JOINT,
            units.TIME,
            "time of the first infeasible sample",
            lambda joint: joint.first_time.get("infeasible", math.nan),
        ),
        Column("peak_tau_e", JOINT, units.TORQUE, "peak absolute elastic torque"),
        Column("peak_tau_motor", MOTOR, units.TORQUE, "peak absolute motor torque", whole=True),
        Column("peak_dtheta", MOTOR, units.VELOCITY, "peak absolute motor velocity", whole=True),
        *(
            Column(name, JOINT, quantity, long_name, attrgetter(f"energy.{attribute}"), whole=True)
            for name, attribute, quantity, long_name in (
                (
                    "energy_spent",
                    "spent",
                    units.ENERGY,
                    "positive motor work: energy that the motors deliver",
                ),
                (
                    "energy_recovered",
                    "recovered",
                    units.ENERGY,
                    "negative motor work: energy that the motors recover",
                ),
                ("elastic_peak", "elastic_peak", units.ENERGY, "peak elastic energy of the springs"),
                (
                    "co_contraction",
                    "co_contraction",
                    units.TORQUE,
                    "root mean square of half the difference of the spring torques",
                ),
            )
        ),
    )
}
"""Scalars of the report of each joint, or of each of its motors, by name."""

_NOT_OVER_TIME = {"flags", *(deviation(name) for name in UNCERTAIN)}

OVER_TIME = {
    name: Column(name, (STEP, *variable.dims), variable.quantity, variable.long_name)
    for name, variable in VARIABLES.items()
    if variable.dims in ((), JOINT, MOTOR) and name not in _NOT_OVER_TIME
}
"""Variables of results that may be kept over time, by name; `time` is kept with them."""


def curve_columns(names: Sequence[str]) -> tuple[Column, ...]:
    """Return the columns of the named variables, preceded by the time; none without names."""
    return tuple(OVER_TIME[name] for name in dict.fromkeys((TIME, *names))) if names else ()


def scalars(columns: Sequence[Column], report: Report) -> FloatArray:
    """Return the concatenated values of a run, (columns,)."""
    values = ([each.scalar(joint) for joint in report.joints] for each in columns)
    return np.concatenate([np.array(each, dtype=float).ravel() for each in values])


def first_limit(report: Report) -> str:
    """Return joint or tool, and its limit that a run exceeds first, as `base motor_torque_limit`; "" if none.

    Of limits that are exceeded at the same time, the one of the joint nearest to the base comes first, and
    tools come last.
    """
    joints_and_tools: tuple[JointReport | ToolReport, ...] = (*report.joints, *report.tools)
    exceeded_limits = [
        (place.first_time[flag.label], f"{place.name} {flag.label}")
        for place in joints_and_tools
        for flag in (*LIMITS, ToolFlag.TOOL_STIFFNESS_LIMIT)
        if flag.label in place.first_time
    ]
    return min(exceeded_limits, default=(0.0, ""), key=itemgetter(0))[1]


def row_length(columns: Sequence[Column], joints: int) -> int:
    """Return the number of values in a row."""
    return sum(math.prod(each.shape(joints)) for each in columns)


def arrays_of(columns: Sequence[Column], rows: FloatArray, joints: int) -> dict[str, FloatArray]:
    """Return rows (..., width) as arrays (..., joints[, 2]) by name."""
    offsets = np.cumsum([math.prod(each.shape(joints)) for each in columns])
    column_blocks = np.split(rows, offsets[:-1], axis=-1)
    return {
        each.name: part.reshape(*rows.shape[:-1], *each.shape(joints))
        for each, part in zip(columns, column_blocks, strict=True)
    }


class Recorder:
    """A recorder of variables over the blocks of a run, in order.

    Args:
        kept: variables to record.
        every: decimation factor: one of this many samples is recorded, from the first on.
    """

    def __init__(self, kept: Sequence[Column], every: int) -> None:
        self._columns, self._stride = kept, every
        self._step = 0
        self._rows: list[FloatArray] = []

    def add(self, block: Block) -> None:
        """Record the next samples."""
        if self._columns:
            first_index, sample_count = -self._step % self._stride, len(block.time)
            columns = [
                np.reshape(getattr(block, each.name), (sample_count, -1))[first_index :: self._stride]
                for each in self._columns
            ]
            self._rows.append(np.concatenate(columns, axis=1))
            self._step += sample_count

    @property
    def curves(self) -> FloatArray:
        """Recorded values, flat: all variables of the first sample, then of the next."""
        return np.concatenate(self._rows).ravel() if self._rows else np.empty(0)


def steps_of(curves: FloatArray, columns: Sequence[Column], joints: int) -> int:
    """Return the number of recorded samples."""
    return len(curves) // row_length(columns, joints) if columns else 0


def pad_curves(
    rows: Sequence[FloatArray], columns: Sequence[Column], steps: int, joints: int
) -> dict[str, FloatArray]:
    """Return curves of several runs as arrays (runs, steps, ...) by name, NaN after the end of a run."""
    table = np.full((len(rows), steps, row_length(columns, joints)), np.nan)
    for row_index, curves in enumerate(rows):
        step_count = steps_of(curves, columns, joints)
        table[row_index, :step_count] = curves.reshape(step_count, -1) if step_count else np.nan
    return arrays_of(columns, table, joints)
