"""Charts, robots and numbers for the scripts of a page: arrays in base64, everything else as JSON."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import json_value
from vsacli.results.charts.arm_chart import direction_of
from vsacli.results.charts.chart import ATTAINABLE, LIMIT_STYLE, Chart, ShadedArea
from vsacli.robot.joint import Pose
from vsacli.robot.kinematics import Geometry, rotation_matrix

BEYOND = 5.0
"""Height up to which the attainable range extends beyond the initial view, in heights of that view."""

CUT_OFF = "peaks of near-singular samples are cut off; Ctrl and the wheel show them"


class Packed:
    """Arrays of a page, each stored once and referenced by its number.

    Single precision suffices: a screen resolves four digits of a curve, a cursor shows six.
    """

    def __init__(self) -> None:
        self._array_numbers: dict[bytes, int] = {}

    def add(self, values: ArrayLike) -> int:
        """Return the number of an array of any shape; values not finite in single precision become NaN."""
        with np.errstate(over="ignore"):
            single = np.asarray(values, dtype="<f4")
        content = np.where(np.isfinite(single), single, np.float32(np.nan)).astype("<f4").tobytes()
        return self._array_numbers.setdefault(content, len(self._array_numbers))

    @property
    def texts(self) -> list[str]:
        """Arrays in base64, by number."""
        return [base64.b64encode(content).decode("ascii") for content in self._array_numbers]

    def chart(self, chart: Chart, start: float) -> dict[str, Any]:
        """Return a chart for `charts.js`, with arrays replaced by their numbers.

        Args:
            chart: chart over time.
            start: time origin of the page, s.
        """
        series = []
        for line in chart.lines:
            band = None if line.band is None else self._band(line.band, chart)
            series.append(
                {
                    "label": line.label,
                    "color": line.color,
                    "joint": line.joint,
                    "file": line.file,
                    "role": line.role,
                    "time": self.add(line.curve.time - start),
                    "values": self.add(line.curve.values),
                    "band": band,
                    "rms": line.rms,
                }
            )
        return {
            "title": chart.title,
            "name": chart.name,
            "unit": chart.unit,
            "series": series,
            "limits": [
                {"joint": None if limit.style_index == LIMIT_STYLE else limit.joint, "value": limit.value}
                for limit in chart.limits
            ],
            "shown": chart.shown,
            "band": chart.band if any(line.band for line in chart.lines) else "",
            "note": "; ".join(filter(None, [CUT_OFF if chart.cut_off else "", chart.note])),
        }

    def _band(self, band: ShadedArea, chart: Chart) -> tuple[int, int]:
        """Return the numbers of lower and upper edge; an attainable range is cut off far outside the view."""
        low, high = band.low, band.high
        if chart.band == ATTAINABLE and chart.shown is not None:
            margin = BEYOND * (chart.shown[1] - chart.shown[0])
            low, high = np.maximum(low, chart.shown[0] - margin), np.minimum(high, chart.shown[1] + margin)
        return self.add(low), self.add(high)


def arm_values(geometry: Geometry, gravity: FloatArray, tool_names: Sequence[str]) -> dict[str, Any]:
    """Return the values of a robot for `kinematics.js`.

    Args:
        geometry: poses, rows and mounts of the robot.
        gravity: acceleration of gravity in the base frame, (3,).
        tool_names: names of the tools.

    Returns:
        The frame `base`; for each of the `joints` its Denavit-Hartenberg row, its mount, and whether it is
        prismatic; for each of the `tools` its name and frame; both with the index of the carrying DH frame,
        0 for frame 0; and the unit vector `down` along gravity, zero without it.
    """
    joints = [
        {
            "carrier": parent + 1,
            "mount": None if joint.mount is None else _frame(joint.mount),
            "dh": {name: getattr(joint.dh, name) for name in ("a", "alpha", "d", "theta")},
            "sliding": not joint.is_revolute,
        }
        for joint, parent in zip(geometry.joints, geometry.parents, strict=True)
    ]
    tools = [
        {"name": name, "carrier": carrier + 1, "frame": _frame(pose)}
        for name, carrier, pose in zip(tool_names, geometry.tool_joints, geometry.end_effectors, strict=True)
    ]
    down = direction_of(gravity).tolist()
    return {"base": _frame(geometry.base), "joints": joints, "tools": tools, "down": down}


def _frame(pose: Pose) -> list[list[float]]:
    """Return the axes x, y and z and the origin of a frame."""
    rotation = np.array(rotation_matrix(pose), dtype=np.float64)
    return [*rotation.T.tolist(), list(pose.xyz)]


def as_script(content: Any) -> str:
    """Return JSON values for a `script` element, without characters that could end it."""
    text = json.dumps(json_value(content), separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
