"""Charts of the stiffness of tools in their softest directions over time, and of these directions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import DIMENSIONLESS, LINEAR_STIFFNESS
from vsacli.base.variables import TIP_COMPLIANCE
from vsacli.results.charts.chart import Chart, Limit, Line
from vsacli.results.charts.reduction import read_curves
from vsacli.results.store.reader import StoredResult
from vsacli.robot.compliance import softest_direction

AXES = ("x", "y", "z")


class _SoftestDirections:
    """A result with four values for each tool: stiffness in the softest direction, and this unit vector."""

    def __init__(self, result: StoredResult) -> None:
        self._result = result
        self.time, self.joint_names = result.time, result.tool_names

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Return samples start..stop-1, (samples, tools, 4); NaN where there is no direction."""
        stiffness, direction = softest_direction(self._result.read(name, start, stop).astype(np.float64))
        stiffness[np.isinf(stiffness)] = np.nan
        turns = np.sum(direction[1:] * direction[:-1], axis=-1, keepdims=True) < 0
        direction[1:] *= np.cumprod(np.where(turns, -1, 1), axis=0)  # either sign is a softest direction
        return np.concatenate([stiffness[..., None], direction], axis=-1)


def tool_charts(files: Sequence[StoredResult]) -> Iterator[Chart]:
    """Yield the chart of the stiffness of all tools, then one of the direction of each tool."""
    curves = [read_curves(_SoftestDirections(file), [TIP_COMPLIANCE]) for file in files]
    names, bounds = files[0].tool_names, files[0].min_stiffness()
    lines = [
        Line(of_tool[0], tool, name, tool, file=file)
        for file, of_file in enumerate(curves)
        for tool, (name, of_tool) in enumerate(zip(names, of_file, strict=True))
    ]
    limits = [Limit(tool, tool, float(bound)) for tool, bound in enumerate(bounds) if np.isfinite(bound)]
    words, unit = "stiffness in the softest direction", LINEAR_STIFFNESS.unit("")
    yield Chart(words, unit, lines, f"stiffness [{unit}]", TIP_COMPLIANCE, limits, from_zero=True)
    for tool, name in enumerate(names):
        lines = [
            Line(of_file[tool][1 + axis], axis, letter, axis, file=file)
            for file, of_file in enumerate(curves)
            for axis, letter in enumerate(AXES)
        ]
        words = f"softest direction of {name}"
        yield Chart(words, DIMENSIONLESS.unit(""), lines, "direction", TIP_COMPLIANCE, shown=(-1.05, 1.05))
