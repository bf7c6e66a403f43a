"""Charts of stored results and simulations, of one file or of several on the same axes.

`StoredSignals` reads and reduces a variable once. `StoredCharts` makes its charts: curves with standard
deviations, limits, axis ranges without near-singular peaks, attainable stiffness, and differences.
`charts_of` returns everything that a page shows of a variable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.simulation_variables import COMMANDS, SIMULATED, measured
from vsacli.base.units import WrenchQuantity
from vsacli.base.variables import (
    MOTORS,
    TIP_COMPLIANCE,
    VARIABLES,
    Variable,
    column_names,
    deviation,
)
from vsacli.base.wrench import WRENCH_AXES
from vsacli.results.charts.chart import ATTAINABLE, LIMIT_STYLE, Chart, Failures, Limit, Line, ShadedArea
from vsacli.results.charts.reduction import (
    BLOCK_SAMPLES,
    GROWING,
    Curve,
    Sampled,
    calm_range,
    read_curves,
    visible_range,
)
from vsacli.results.charts.tool_charts import tool_charts
from vsacli.results.store.reader import StoredResult
from vsacli.robot.joint import existing_columns

STIFFNESS_BOUNDS = ("stiffness_min", "stiffness_max")

FULL_UTILIZATION = 100.0
"""Utilization of a limit that is reached, %."""

UTILIZATION_MARGIN = 1.06
"""Upper end of an axis of utilizations, relative to the largest value shown."""

NEGLIGIBLE = 1e-6
"""Largest difference of curves that count as equal, relative to their largest value.

Single precision rounds by 6e-8, and interpolation between 700 samples per second by 2e-8 of a motor torque.
"""

FLAT_HALF_RANGE = 0.01
"""Half the range of an axis of negligible differences, relative to the largest value that was subtracted."""

By: TypeAlias = Literal["joint", "file", "role"]
"""Property that the looks of the lines of a chart distinguish."""


class ResultDifference:
    """A result minus another one, at the times of the former that both cover; the latter is interpolated.

    Attributes:
        time: common times, (samples,), s; empty if the files do not overlap.
        joint_names: names of the joints, in the order of the robot file.
    """

    def __init__(self, result: StoredResult, other: StoredResult) -> None:
        self._result, self._other = result, other
        start = max(result.time[0], other.time[0])
        end = min(result.time[-1], other.time[-1])
        bounds = (np.searchsorted(result.time, start), np.searchsorted(result.time, end, side="right"))
        self._offset, last = map(int, bounds)
        self.time: FloatArray = result.time[self._offset : max(self._offset, last)]
        self.joint_names = result.joint_names

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Return differences at times start..stop-1, in the shape of the variable; NaN where a value is."""
        stop = self.time.size if stop is None else stop
        result_values = np.asarray(
            self._result.read(name, self._offset + start, self._offset + stop), dtype=np.float64
        )
        with np.errstate(over="ignore", invalid="ignore"):  # inf - inf is NaN
            return result_values - self._interpolated(name, self.time[start:stop])

    def _interpolated(self, name: str, time: FloatArray) -> FloatArray:
        """Return values of the other result, interpolated linearly between its samples."""
        times = self._other.time
        start = max(int(np.searchsorted(times, time[0], side="right")) - 1, 0)
        stop = int(np.searchsorted(times, time[-1])) + 1
        values = np.asarray(self._other.read(name, start, stop), dtype=np.float64)
        if np.array_equal(times[start:stop], time):
            return values
        columns = values.reshape(len(values), -1)
        interpolated_columns = [np.interp(time, times[start:stop], column) for column in columns.T]
        return np.stack(interpolated_columns, axis=-1).reshape(len(time), *values.shape[1:])

    def rms(self, name: str) -> FloatArray:
        """Return the root mean square of all finite differences, in the shape of a sample."""
        sum_of_squares, count = 0.0, 0
        with np.errstate(over="ignore", invalid="ignore"):
            for start in range(0, self.time.size, BLOCK_SAMPLES):
                block = self.read(name, start, min(start + BLOCK_SAMPLES, self.time.size))
                block = np.where(np.isfinite(block), block, np.nan)
                sum_of_squares = sum_of_squares + np.nansum(block**2, axis=0)
                count = count + np.count_nonzero(~np.isnan(block), axis=0)
            return np.asarray(np.sqrt(np.divide(sum_of_squares, count)))


class StoredSignals:
    """A variable of each joint of some files, in all roles stored there.

    Args:
        files: files by number.
        roles: roles, such as "commanded", by the names under which they are stored.
        width: number of curves of each joint, 1 or 2.
        spread: name of the standard deviation; empty for none.
        rms: root mean squares of differences, (joints, width), by number of the file.
    """

    def __init__(
        self,
        files: Mapping[int, Sampled],
        roles: Mapping[str, str],
        curves_per_joint: int,
        deviation_name: str = "",
        rms: Mapping[int, FloatArray] | None = None,
    ) -> None:
        names = [*roles, deviation_name] if deviation_name else list(roles)
        self._curves = {number: read_curves(file, names) for number, file in files.items()}
        self._joint_names = next(iter(files.values())).joint_names if files else ()
        self._roles, self._curves_per_joint, self._deviation_name, self._rms = (
            list(roles.values()),
            curves_per_joint,
            deviation_name,
            rms,
        )

    def lines(self, column: int, joints: Sequence[int], by: By = "joint") -> list[Line]:
        """Return a line for each file, role and joint."""
        return [
            self._line(
                file, role_index, joint, column, {"joint": joint, "file": file, "role": role_index}[by]
            )
            for file in self._curves
            for role_index in range(len(self._roles))
            for joint in joints
        ]

    def _line(self, file: int, role_index: int, joint: int, column: int, style_index: int) -> Line:
        curves, band = self._curves[file][joint], None
        curve = curves[role_index * self._curves_per_joint + column]
        if self._deviation_name:
            band = ShadedArea.around(
                curve, curves.values[len(self._roles) * self._curves_per_joint + column], style_index
            )
        rms = None if self._rms is None else float(self._rms[file][joint, column])
        return Line(
            curve,
            style_index,
            self._joint_names[joint],
            joint,
            joint,
            file,
            self._roles[role_index],
            band,
            rms,
        )


class StoredCharts:
    """The charts of files of one kind with the same joints.

    Attributes:
        files: open files.
        first: first of the files.
        common: names of the variables in all files.
    """

    def __init__(self, files: Sequence[StoredResult]) -> None:
        self.files, self.first = files, files[0]
        self.common = [
            name for name in self.first.variables if all(self._has_common(name, file) for file in files)
        ]

    def _has_common(self, name: str, file: StoredResult) -> bool:
        """Return whether a file has a variable of the first one, and along the same tools if along any."""
        if name not in file.variables or "tool" not in self.first.declared[name].dims:
            return name in file.variables
        return file.tool_names == self.first.tool_names

    @cached_property
    def failures(self) -> list[Failures]:
        """Failures of each file."""
        return [Failures.of(file) for file in self.files]

    @cached_property
    def compliant(self) -> list[int]:
        """Joints with a stiffness."""
        return compliant_joints(self.first.actuators)

    def existing(self, variable: Variable) -> BoolArray:
        """Return which curves of a variable any file has at each joint, (joints, 1 or 2)."""
        return np.asarray(np.any([file.existing(variable) for file in self.files], axis=0))

    def signals(self, roles: Mapping[str, str], *, uncertain: bool = True) -> StoredSignals:
        """Read a variable by the names of its roles, with its standard deviation if `uncertain`."""
        name = next(iter(roles))
        deviation_name = deviation(name) if uncertain and deviation(name) in self.common else ""
        curves_per_joint = self.existing(self.first.declared[name]).shape[1]
        return StoredSignals(dict(enumerate(self.files)), roles, curves_per_joint, deviation_name)

    def differences(self, name: str) -> StoredSignals:
        """Read a variable of the other files minus that of the first file, at common times."""
        all_differences = {
            file_number: ResultDifference(file, self.first)
            for file_number, file in enumerate(self.files[1:], 1)
        }
        differences = {
            file_number: difference
            for file_number, difference in all_differences.items()
            if difference.time.size
        }
        rms = {
            file_number: difference.rms(name).reshape(len(difference.joint_names), -1)
            for file_number, difference in differences.items()
        }
        return StoredSignals(
            differences, {name: "computed"}, self.existing(self.first.declared[name]).shape[1], rms=rms
        )

    def chart(
        self, name: str, signals: StoredSignals, column: int, joints: Sequence[int], by: By = "joint"
    ) -> Chart:
        """Return the chart of a curve of some joints, all of one type, without title."""
        lines = signals.lines(column, joints, by)
        y_limits = self.calm(lines) if name in GROWING else None
        unit = self.first.declared[name].quantity.unit(self.first.joint_types[joints[0]])
        return Chart(
            "",
            unit,
            lines,
            name=name,
            limits=self._limits(name, column, joints),
            shown=y_limits,
            cut_off=y_limits is not None,
            note=self._undefined_note(lines),
        )

    def with_utilization(self, chart: Chart, column: int) -> tuple[Chart, Chart | None]:
        """Return a chart, and the utilization of its limits if several joints share the chart.

        Limits of several joints could not be told apart; the chart is returned without those that the
        utilization shows.
        """
        utilization = (
            self._utilization(chart, column) if len({line.joint for line in chart.lines}) > 1 else None
        )
        if utilization is None:
            return chart, None
        utilized_joints = {line.joint for line in utilization.lines}
        return replace(
            chart, limits=[limit for limit in chart.limits if limit.joint not in utilized_joints]
        ), utilization

    def _utilization(self, chart: Chart, column: int) -> Chart | None:
        """Return the utilization of the limits of a chart; None if no joint has a lower and an upper limit.

        0 % is the middle between both limits, 100 % either of them, so that all joints share one limit line.
        """
        bounds = self.first.limits(chart.name)
        bounds = bounds[:, column % bounds.shape[1]]
        lines = []
        for line in chart.lines:
            low, high = bounds[line.joint].tolist()
            if np.isfinite(high - low) and high > low:
                utilization = np.abs(2 * line.curve.values - high - low) / (high - low)
                lines.append(
                    line._replace(curve=Curve(line.curve.time, FULL_UTILIZATION * utilization), band=None)
                )
        if not lines:
            return None
        y_limits = self.calm(lines) if chart.name in GROWING else None
        peaks = (
            [np.nanmax(line.curve.values, initial=0) for line in lines] if y_limits is None else [y_limits[1]]
        )
        return Chart(
            "",
            "%",
            lines,
            axis="utilization [%]",
            name=chart.name,
            limits=[Limit(LIMIT_STYLE, 0, FULL_UTILIZATION)],
            shown=(0.0, UTILIZATION_MARGIN * max(FULL_UTILIZATION, *peaks)),
            cut_off=y_limits is not None,
        )

    def _undefined_note(self, lines: Sequence[Line]) -> str:
        """Return a sentence that names the joints without a value at any time; empty if there are none."""
        undefined_lines = [line for line in lines if not np.isfinite(line.curve.values).any()]
        has_infeasible = any(
            self.failures[line.file].infeasible[line.joint].any() for line in undefined_lines
        )
        names = ", ".join(dict.fromkeys(line.label for line in undefined_lines))
        return (
            f"undefined{' because of infeasible samples' if has_infeasible else ''}: {names}"
            if undefined_lines
            else ""
        )

    def calm(self, lines: Sequence[Line], *other_files: int) -> tuple[float, float] | None:
        """Return the range of an axis without near-singular peaks; None if they do not matter.

        Args:
            lines: lines of joints.
            other_files: numbers of further files that must be calm, as for differences.
        """
        masks = []
        for line in lines:
            assert line.joint is not None, "as of all variables that grow"
            file_masks = [
                self.failures[file].calm(line.joint, line.curve.time) for file in (line.file, *other_files)
            ]
            masks.append(np.all(file_masks, axis=0))
        return calm_range([line.curve.values for line in lines], masks)

    def corridors(self) -> Iterator[Chart]:
        """Yield the stiffness of each joint within its attainable range, if that is stored."""
        bounds = STIFFNESS_BOUNDS if set(STIFFNESS_BOUNDS) <= set(self.common) else ()
        curves = read_curves(self.first, ["stiffness", *bounds])
        quantity = VARIABLES["stiffness"].quantity
        for joint in self.compliant:
            time, (command, *edges) = curves[joint].time, curves[joint].values
            band = None
            if edges and not np.isnan(edges[0]).all():
                lower, upper = edges
                band = ShadedArea(time, lower, upper, joint)
            line = Line(curves[joint][0], joint, self.first.joint_names[joint], joint, joint, band=band)
            yield Chart(
                title=self.first.joint_names[joint],
                unit=(unit := quantity.unit(self.first.joint_types[joint])),
                lines=[line],
                axis=rf"$\sigma$ [{unit}]",
                name="stiffness",
                limits=self._limits("stiffness", 0, [joint]),
                shown=visible_range(command, *edges),
                band=ATTAINABLE,
            )

    def _limits(self, name: str, column: int, joints: Sequence[int]) -> list[Limit]:
        limits = self.first.limits(name)
        bounds = limits[:, column % limits.shape[1]]
        return [
            Limit(joint, joint, float(value))
            for joint in joints
            for value in bounds[joint]
            if np.isfinite(value)
        ]

    def charts_of(self, name: str) -> list[Chart]:
        """Return all charts of a variable: by motor and type of joint, of simulations with the command."""
        variable = self.first.declared[name]
        if name == TIP_COMPLIANCE:
            return list(tool_charts(self.files))
        if "joint" not in variable.dims:
            return (
                list(self._wrench_charts(variable)) if isinstance(variable.quantity, WrenchQuantity) else []
            )
        columns = list(self._columns(variable))
        if name == "stiffness" and set(STIFFNESS_BOUNDS) <= set(self.common) and len(self.files) == 1:
            return [
                replace(corridor, title=f"{variable.long_name}, {corridor.title}")
                for corridor in self.corridors()
            ]
        roles = self._roles(name)
        charts = []
        if roles:
            signals = self.signals(roles)
            for column, title, joints in columns:
                chart, utilization = self.with_utilization(self.chart(name, signals, column, joints), column)
                charts.append(replace(chart, title=title))
                if utilization is not None:
                    charts.append(replace(utilization, title=f"{title}: utilization of limits"))
        for stored_name in roles if len(self.files) > 1 else ():
            differences = self.differences(stored_name)
            for column, title, joints in columns:
                unit = variable.quantity.unit(self.first.joint_types[joints[0]])
                lines = differences.lines(column, joints)
                y_limits = flat_range(lines, signals.lines(column, joints))
                note = "" if y_limits is None else f"equal within {NEGLIGIBLE:g} of the largest value"
                if lines:
                    difference_chart = Chart(
                        f"difference: {title}", unit, lines, name=name, shown=y_limits, note=note
                    )
                    charts.append(difference_chart)
        return charts

    def _roles(self, name: str) -> dict[str, str]:
        """Return the roles of a variable by its stored names; of several files only its own."""
        simulated = self.first.kind == "simulation" and name in SIMULATED
        roles = {COMMANDS[name]: "commanded"} if simulated and name in COMMANDS else {}
        roles |= {name: "simulated" if simulated else "computed", measured(name): "measured"}
        names = roles if len(self.files) == 1 else (name,)
        return {stored_name: roles[stored_name] for stored_name in names if stored_name in self.common}

    def _columns(self, variable: Variable) -> Iterator[tuple[int, str, list[int]]]:
        """Yield each column of a variable and type of joint, with a title and the joints that have it."""
        existing, joint_types = self.existing(variable), self.first.joint_types
        words = variable.long_name
        for column in range(existing.shape[1]):
            motor_text = f", motor {MOTORS[column]}" if "motor" in variable.dims else ""
            for joint_type in dict.fromkeys(joint_types):
                joints = [
                    joint
                    for joint, other_type in enumerate(joint_types)
                    if other_type == joint_type and existing[joint, column]
                ]
                type_text = f" ({joint_type} joints)" if len(set(joint_types)) > 1 else ""
                if joints:
                    yield column, f"{words}{motor_text}{type_text}", joints

    def _wrench_charts(self, variable: Variable) -> Iterator[Chart]:
        """Yield charts of forces and of moments, on each of several tools."""
        assert isinstance(variable.quantity, WrenchQuantity), "see WRENCH_AXES"
        curves = [read_curves(_Components(file, variable), [variable.name]) for file in self.files]
        tool_texts = [f" on {tool}" for tool in self.first.tool_names] if "tool" in variable.dims else [""]
        for tool_index, tool_text in enumerate(tool_texts):
            first_component = tool_index * len(WRENCH_AXES)
            for words, axes in (("forces", range(3)), ("moments", range(3, 6))):
                lines = [
                    Line(file_curves[first_component + axis][0], axis, WRENCH_AXES[axis], axis % 3, file=file)
                    for file, file_curves in enumerate(curves)
                    for axis in axes
                ]
                unit = variable.quantity.of_axis(axes[0])
                yield Chart(f"{variable.long_name}, {words}{tool_text}", unit, lines, name=variable.name)


class _Components:
    """A wrench over time, with its components, those of several tools in turn, in place of joints."""

    def __init__(self, file: StoredResult, variable: Variable) -> None:
        self._file = file
        self.joint_names = column_names(variable, file.labels)

    @property
    def time(self) -> FloatArray:
        return self._file.time

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        return np.asarray(self._file.read(name, start, stop), dtype=np.float64)


def flat_range(differences: Sequence[Line], lines: Sequence[Line]) -> tuple[float, float] | None:
    """Return the range of an axis on which negligible differences are flat; None if they are not negligible.

    Args:
        differences: differences of curves.
        lines: the curves.
    """
    largest_difference, largest_value = (
        max((float(np.nanmax(np.abs(line.curve.values), initial=0.0)) for line in curves), default=0.0)
        for curves in (differences, lines)
    )
    return (
        (-FLAT_HALF_RANGE * largest_value, FLAT_HALF_RANGE * largest_value)
        if 0 < largest_value < np.inf and largest_difference <= NEGLIGIBLE * largest_value
        else None
    )


def compliant_joints(actuators: Sequence[str]) -> list[int]:
    """Return the joints with a stiffness, by the types of their actuators."""
    existing = existing_columns(VARIABLES["stiffness"], actuators)
    return [joint for joint, [has_stiffness] in enumerate(existing) if has_stiffness]
