"""Charts of the compliance of tools: stiffness and softest direction over time, ellipses along the path."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, evenly
from vsacli.base.units import DIMENSIONLESS, LINEAR_STIFFNESS
from vsacli.base.variables import TIP_COMPLIANCE
from vsacli.results.charts.arm_chart import SMALLEST_SIZE, ArmPoints, View, direction_of, views_of
from vsacli.results.charts.chart import Chart, Limit, Line
from vsacli.results.charts.reduction import read_curves
from vsacli.results.store.reader import StoredResult
from vsacli.robot.compliance import softest_direction

AXES = ("x", "y", "z")

POINTS, ELLIPSES = 400, 7
"""Number of points of a path, and of ellipses along it."""

LARGEST_ELLIPSE = 0.1
"""Largest semi-axis of an ellipse at most, relative to the size of the drawing."""


class _SoftestDirections:
    """A result with four values for each tool: stiffness in the softest direction, and this unit vector."""

    def __init__(self, result: StoredResult) -> None:
        self._result, self._last_direction = result, np.full((1, len(result.tool_names), 3), np.nan)
        self.time, self.joint_names = result.time, result.tool_names

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Return samples start..stop-1, (samples, tools, 4); NaN where there is no direction.

        A block continues the sign of the direction of the block read before.
        """
        stiffness, direction = softest_direction(self._result.read(name, start, stop).astype(np.float64))
        stiffness[np.isinf(stiffness)] = np.nan
        previous = np.concatenate([self._last_direction, direction[:-1]])
        flips = np.sum(direction * previous, axis=-1, keepdims=True) < 0
        direction *= np.cumprod(np.where(flips, -1, 1), axis=0)  # either sign is a softest direction
        self._last_direction = direction[-1:]
        return np.concatenate([stiffness[..., None], direction], axis=-1)


def tool_charts(files: Sequence[StoredResult]) -> Iterator[Chart]:
    """Yield the chart of the stiffness of all tools, then one of the direction of each tool that yields."""
    curves = [read_curves(_SoftestDirections(file), [TIP_COMPLIANCE]) for file in files]
    names, bounds = files[0].tool_names, files[0].min_stiffness()
    lines = [
        Line(tool_curves[0], tool, name, tool, file=file)
        for file, file_curves in enumerate(curves)
        for tool, (name, tool_curves) in enumerate(zip(names, file_curves, strict=True))
    ]
    limits = [Limit(tool, tool, float(bound)) for tool, bound in enumerate(bounds) if np.isfinite(bound)]
    title, unit = "stiffness in the softest direction", LINEAR_STIFFNESS.unit("")
    yield Chart(title, unit, lines, f"stiffness [{unit}]", TIP_COMPLIANCE, limits, from_zero=True)
    for tool, name in enumerate(names):
        if not any(np.isfinite(file_curves[tool].values).any() for file_curves in curves):
            continue
        lines = [
            Line(file_curves[tool][1 + axis], axis, letter, axis, file=file)
            for file, file_curves in enumerate(curves)
            for axis, letter in enumerate(AXES)
        ]
        title = f"softest direction of {name}"
        yield Chart(title, DIMENSIONLESS.unit(""), lines, "direction", TIP_COMPLIANCE, shown=(-1.05, 1.05))


class ToolPath(NamedTuple):
    """Paths of tools in the base frame, m.

    Attributes:
        title: title of the figure.
        links: corners of the links at the start and at the end, (corners, 3) each.
        paths: origins of each tool over time, (points, 3), by name.
        displacements: matrices from unit vectors of force to the displacement by a force of `force`,
            (tools, ellipses, 3, 3); NaN where there is no compliance.
        origins: origins of the tools there, (tools, ellipses, 3).
        force: force, N.
        size: size of the drawing.
        middle: middle of the drawing, (3,).
        views: views that show it.
    """

    title: str
    links: list[FloatArray]
    paths: Mapping[str, FloatArray]
    displacements: FloatArray
    origins: FloatArray
    force: float
    size: float
    middle: FloatArray
    views: tuple[View, ...]


def tool_path(result: StoredResult, title: str) -> ToolPath:
    """Return the paths of the tools of a result with `q` and `tip_compliance`."""
    sample_indices = evenly(result.samples, POINTS)
    geometry, q = result.geometry(), np.asarray(result.read("q"), dtype=np.float64)[sample_indices]
    points = ArmPoints.of(geometry, q)
    path_indices = _evenly_spaced_indices(points.tools)
    links = [line for end in (0, -1) for line in ArmPoints.of(geometry, q[[end]]).lines()]
    corners = np.concatenate([*links, points.tools.reshape(-1, 3)])
    extents = np.ptp(corners, axis=0)
    size = max(float(extents.max()), SMALLEST_SIZE)
    compliance = np.concatenate(
        [result.read(TIP_COMPLIANCE, sample, sample + 1) for sample in sample_indices[path_indices].tolist()]
    )
    translational = np.swapaxes(compliance[..., :3, :3], 0, 1).astype(np.float64)
    largest = float(np.nanmax(np.linalg.norm(np.nan_to_num(translational), ord=2, axis=(-2, -1))))
    force = _round_number(LARGEST_ELLIPSE * size / largest) if largest > 0 else 1.0
    return ToolPath(
        f"{title}: compliance along the path",
        links,
        dict(zip(result.tool_names, np.swapaxes(points.tools, 0, 1), strict=True)),
        force * translational,
        np.swapaxes(points.tools[path_indices], 0, 1),
        force,
        size,
        (corners.max(axis=0) + corners.min(axis=0)) / 2,
        views_of(direction_of(result.gravity()), extents, size),
    )


def _evenly_spaced_indices(origins: FloatArray) -> IndexArray:
    """Return the indices of `ELLIPSES` points at even distances along the paths, (points, tools, 3)."""
    lengths = np.linalg.norm(np.diff(origins, axis=0), axis=-1).sum(axis=-1).cumsum()
    distances = np.linspace(0, lengths[-1] if len(lengths) else 0.0, ELLIPSES)
    return np.unique(np.searchsorted(lengths, distances))


def _round_number(value: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at most a positive value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return decade * max(factor for factor in (1, 2, 5) if factor * decade <= value)
