"""Charts of optimized motions before and after, and of motor torques within the tolerances of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import STIFFNESS, TIME, TORQUE
from vsacli.base.variables import MOTORS
from vsacli.results.charts.chart import (
    ATTAINABLE,
    DEVIATIONS,
    PANEL_WIDTH,
    Chart,
    Limit,
    Line,
    PanelGrid,
    ShadedArea,
    Sheet,
)
from vsacli.results.charts.reduction import Curve, visible_range

MOST_ROWS = 7
ROW_HEIGHT, PACE_HEIGHT, BAND_HEIGHT = 1.7, 2.0, 1.6
"""Heights of panels, inches."""

BEFORE, AFTER, UNIFORM = 1, 0, 3
"""Looks of lines; the optimum is the solid line."""

PATH = f"place on the path, as commanded time [{TIME}]"
SHORT_PATH = f"place on the path [{TIME}]"


class JointMotion(NamedTuple):
    """Motion of a joint; all arrays (samples,), torques (motors, samples).

    Attributes:
        place: position on the path, or time.
        stiffness: stiffness; NaN throughout if it cannot be commanded.
        lower, upper: minimum and maximum attainable stiffness.
        torques: torques of the motors.
    """

    place: FloatArray
    stiffness: FloatArray
    lower: FloatArray
    upper: FloatArray
    torques: FloatArray

    def stiffness_line(self, style_index: int) -> Line:
        """Return the stiffness as a line; at the optimum with its attainable range."""
        band = ShadedArea(self.place, self.lower, self.upper, style_index)
        has_band = style_index == AFTER and not np.isnan(self.lower).all()
        return Line(Curve.reduced(self.place, self.stiffness), style_index, band=band if has_band else None)

    def torque_line(self, motor: int, style_index: int) -> Line:
        """Return the torque of a motor, 1 or 2, as a line."""
        return Line(Curve.reduced(self.place, self.torques[motor - 1]), style_index)


class OptimizedJoint(NamedTuple):
    """A joint before and after optimization.

    Attributes:
        name: name of the joint.
        joint_type: revolute or prismatic.
        before: motion as commanded.
        after: motion at the optimum.
        limits: lower and upper bound of the torque of each motor, (motors, 2), infinite if there are none.
    """

    name: str
    joint_type: str
    before: JointMotion
    after: JointMotion
    limits: FloatArray

    @property
    def stiffness(self) -> Chart | None:
        """Chart of the stiffness within its attainable range; None if the stiffness cannot be commanded."""
        if not np.isfinite(self.after.stiffness).any():
            return None
        stiffness_values = np.concatenate([self.before.stiffness, self.after.stiffness])
        unit = STIFFNESS.unit(self.joint_type)
        return Chart(
            title=self.name,
            unit=unit,
            lines=[self.before.stiffness_line(BEFORE), self.after.stiffness_line(AFTER)],
            axis=rf"$\sigma$ [{unit}]",
            shown=visible_range(stiffness_values, self.after.lower, self.after.upper),
            band=ATTAINABLE,
        )

    @property
    def motors(self) -> range:
        """Numbers of the motors."""
        return range(1, len(self.after.torques) + 1)

    def torque(self, motor: int) -> Chart | None:
        """Return the chart of the torque of a motor with its limits; None if there is no such motor."""
        if motor not in self.motors:
            return None
        unit = TORQUE.unit(self.joint_type)
        lines = [self.before.torque_line(motor, BEFORE), self.after.torque_line(motor, AFTER)]
        limits = [Limit(AFTER, 0, float(value)) for value in self.limits[motor - 1] if np.isfinite(value)]
        title, axis = f"{self.name}, motor {motor}", rf"$\tau_{motor}$ [{unit}]"
        return Chart(title, unit, lines, axis, limits=limits)


def change_sheet(joints: Sequence[OptimizedJoint], title: str, *, along_path: bool) -> Sheet:
    """Return a figure with a row of panels for each joint: stiffness, and the torque of each motor.

    Args:
        joints: motions before and after.
        title: title of the figure.
        along_path: whether places are positions on the path instead of times.
    """
    stiffness_charts = [joint.stiffness for joint in joints]
    motors = range(1, 1 + max(len(joint.motors) for joint in joints))
    panels = [[joint.torque(motor) for motor in motors] for joint in joints]
    if any(stiffness_charts):
        panels = [[chart, *torques] for chart, torques in zip(stiffness_charts, panels, strict=True)]
    block = PanelGrid(joints[0].before.place, panels, (ROW_HEIGHT,), MOST_ROWS)
    if along_path:
        block = block._replace(xlabel=SHORT_PATH)
    size = (max(2, block.columns) * PANEL_WIDTH, block.height + 1)
    return Sheet(title, size, {"as commanded": BEFORE, "optimum": AFTER}, [block])


def pace_sheet(path_position: FloatArray, speed: FloatArray, uniform_speed: float, title: str) -> Sheet:
    """Return the figure of the speed along the path at the optimum.

    Args:
        path_position: position on the path, (samples,), s as commanded.
        speed: speed there relative to the commanded motion, (samples,).
        uniform_speed: relative speed of the fastest uniformly scaled motion; NaN if unknown.
        title: title of the figure.
    """
    ends = path_position[[0, -1]]
    lines, legend = [Line(Curve.reduced(path_position, speed), AFTER)], {"optimum": AFTER}
    for label, style_index, value in (
        ("as commanded", BEFORE, 1.0),
        ("fastest uniform scaling", UNIFORM, uniform_speed),
    ):
        if np.isfinite(value):
            lines.append(Line(Curve(ends, np.full(2, value)), style_index))
            legend[label] = style_index
    chart = Chart("", "", lines, "relative speed", from_zero=True)
    block = PanelGrid(ends, [[chart]], (PACE_HEIGHT,), xlabel=PATH)
    return Sheet(title, (2 * PANEL_WIDTH, PACE_HEIGHT + 1), legend, [block])


class MotorTorqueCurve(NamedTuple):
    """Torque of a motor over time, with its standard deviation; arrays (samples,)."""

    joint: str
    joint_type: str
    motor: int
    values: FloatArray
    deviation: FloatArray

    def chart(self, time: FloatArray) -> Chart:
        """Return the torque with its band, both entirely within the range of the axis."""
        curve, half_width = Curve(time, self.values), DEVIATIONS * self.deviation
        low, high = np.nanmin(self.values - half_width), np.nanmax(self.values + half_width)
        margin = 0.05 * (high - low) or 1.0
        unit = TORQUE.unit(self.joint_type)
        return Chart(
            title=f"{self.joint}, motor {self.motor}",
            unit=unit,
            lines=[Line(curve, 0, band=ShadedArea.around(curve, self.deviation, style_index=1))],
            axis=rf"$\tau_{self.motor}$ [{unit}]",
            shown=(low - margin, high + margin),
        )


def band_sheet(time: FloatArray, torques: Sequence[MotorTorqueCurve], title: str) -> Sheet:
    """Return a figure of motor torques with their bands, a row of panels for each joint."""
    charts_by_joint: dict[str, dict[int, Chart]] = {}
    for torque in torques:
        charts_by_joint.setdefault(torque.joint, {})[torque.motor] = torque.chart(time)
    rows = [[charts.get(motor) for motor in MOTORS] for charts in charts_by_joint.values()]
    block = PanelGrid(time, rows, (BAND_HEIGHT,), MOST_ROWS)
    size = (block.columns * PANEL_WIDTH, block.height + 1)
    return Sheet(title, size, {"computed": 0}, [block])
