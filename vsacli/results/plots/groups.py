"""Figures of one variable: joints of one unit share panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from vsacli.base.arrays import FloatArray
from vsacli.base.variables import deviation
from vsacli.results.curves import Curves, Failures, read_curves
from vsacli.results.near_singular import GROWING
from vsacli.results.plots.drawing import draw_bands, draw_curve, draw_limits, draw_uncertainty
from vsacli.results.plots.labels import Label
from vsacli.results.plots.panels import (
    JOINTS_PER_PANEL,
    PANEL_WIDTH,
    add_legend,
    complete,
    panel_groups,
    result_title,
    share_time,
)
from vsacli.results.plots.scale import Peaked, cut_peaks
from vsacli.results.plots.styles import line_handle, line_style
from vsacli.results.store.reader import StoredResult

GROUP_HEIGHT, LEGEND_WIDTH = 2.3, 1.3
"""Inches; the latter is for names beside the panels of a group."""


def grouped_figure(
    result: StoredResult, failures: Failures, name: str, labels: Sequence[Label], words: str = ""
) -> Figure:
    """A figure of one variable that some joint has, with a column of panels for each of its curves.

    Args:
        result: the file.
        failures: its steps that cannot be done.
        name: of the variable.
        labels: of the axes, for each curve.
        words: what the variable is, if the labels do not say it.
    """
    groups = _groups(result, name)
    width = 2 * PANEL_WIDTH + legend_width(result)
    figure = Figure((width, GROUP_HEIGHT * len(groups) + 1), layout="constrained")
    handles = draw_groups(figure.add_gridspec()[0], result, failures, name, labels)
    return complete(figure, ": ".join(filter(None, (result_title(result), words))), handles)


def draw_groups(
    place: SubplotSpec,
    result: StoredResult,
    failures: Failures,
    name: str,
    labels: Sequence[Label],
    *,
    named: bool = True,
) -> list[Artist]:
    """Draw a variable as `grouped_figure` does, a row of panels for each group of joints that have it.

    With `named`, the joints of each group are named beside its panels if they are many. Returns what a legend
    of the figure shows: few joints as well.
    """
    there, groups = result.existing(result.declared[name]), _groups(result, name)
    drawn = np.flatnonzero(there.any(axis=0)).tolist()
    lines = [line_handle(line_style(joint), name) for joint, name in enumerate(result.joint_names)]
    curves = _Variable.of(result, failures, name)
    panels = place.subgridspec(len(groups), len(drawn)).subplots(squeeze=False)
    beside = legend_width(result) > 0
    handles = [] if beside else lines
    for group, row in zip(groups, panels, strict=True):
        for curve, axes in zip(drawn, row, strict=True):
            present = [joint for joint in group if there[joint, curve]]
            handles += curves.draw(axes, present, curve) if present else []
            handles += draw_bands(axes, failures.time, *failures.among(group))
            axes.set_ylabel(labels[curve](result.joint_types[group[0]]))
    shown = np.array([there[group][:, drawn].any(axis=0) for group in groups])
    share_time(panels, shown, failures.time)
    if named and beside:
        for group, row, exists in zip(groups, panels, shown, strict=True):
            add_legend(row[exists][-1], [lines[joint] for joint in group])
    return handles


def legend_width(result: StoredResult) -> float:
    """Inches that names take beside the panels: where one legend would be too long to find a joint in it."""
    return LEGEND_WIDTH if len(result.joint_names) > JOINTS_PER_PANEL else 0.0


def _groups(result: StoredResult, name: str) -> list[list[int]]:
    """The joints that share a panel of a variable, as far as one of them has it."""
    there = result.existing(result.declared[name])
    return [group for group in panel_groups(result.joint_types) if there[group].any()]


class _Variable(NamedTuple):
    """A variable of a result, to be drawn in panels.

    Attributes:
        joints: its curves, followed by their deviations if it has any.
        uncertain: whether it has.
        limits: (joints, 1 or 2, 2).
        failures: of the result, if near-singular peaks are to be cut off.
    """

    joints: Sequence[Curves]
    uncertain: bool
    limits: FloatArray
    failures: Failures | None

    @classmethod
    def of(cls, result: StoredResult, failures: Failures, name: str) -> _Variable:
        uncertain = deviation(name) in result.variables
        joints = read_curves(result, [name, deviation(name)] if uncertain else [name])
        columns = result.existing(result.declared[name]).shape
        limits = np.broadcast_to(result.limits(name), (*columns, 2))
        return cls(joints, uncertain, limits, failures if name in GROWING else None)

    def draw(self, axes: Axes, present: Sequence[int], curve: int) -> list[Artist]:
        """Draw a curve of some joints, what bounds it, and what its deviations leave open."""
        handles: list[Artist] = []
        for joint in present:
            handles += draw_curve(axes, self.joints[joint][curve], joint, line_style(joint))
        for joint in present if self.uncertain else ():
            values, deviations = np.split(self.joints[joint].values, 2)
            time, style = self.joints[joint].time, line_style(joint)
            handles += draw_uncertainty(axes, time, values[curve], deviations[curve], style)
        if self.failures is not None:
            handles += cut_peaks(axes, [self._peaked(joint, curve, self.failures) for joint in present])
        return handles + draw_limits(axes, {joint: self.limits[joint, curve] for joint in present})

    def _peaked(self, joint: int, curve: int, failures: Failures) -> Peaked:
        time, values = self.joints[joint].time, self.joints[joint].values[curve]
        return Peaked(time, values, line_style(joint).color, failures.calm(joint, time))
