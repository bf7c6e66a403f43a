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
from vsacli.results.charts.chart import ATTAINABLE, LIMIT_LOOK, Chart, Failures, Limit, Line, ShadedArea
from vsacli.results.charts.reduction import (
    BLOCK,
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

BOUNDS = ("stiffness_min", "stiffness_max")

FULL = 100.0
"""Utilization of a limit that is reached, %."""

SPARE = 1.06
"""Upper end of an axis of utilizations, relative to the largest value shown."""

NEGLIGIBLE = 1e-6
"""Largest difference of curves that count as equal, relative to their largest value.

Single precision rounds by 6e-8, and interpolation between 700 samples per second by 2e-8 of a motor torque.
"""

FLAT = 0.01
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
        self._first, last = map(int, bounds)
        self.time: FloatArray = result.time[self._first : max(self._first, last)]
        self.joint_names = result.joint_names

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Return differences at times start..stop-1, in the shape of the variable; NaN where a value is."""
        stop = self.time.size if stop is None else stop
        own = np.asarray(self._result.read(name, self._first + start, self._first + stop), dtype=np.float64)
        with np.errstate(over="ignore", invalid="ignore"):  # inf - inf is NaN
            return own - self._interpolated(name, self.time[start:stop])

    def _interpolated(self, name: str, time: FloatArray) -> FloatArray:
        """Return values of the other result, interpolated linearly between its samples."""
        steps = self._other.time
        before = max(int(np.searchsorted(steps, time[0], side="right")) - 1, 0)
        after = int(np.searchsorted(steps, time[-1])) + 1
        values = np.asarray(self._other.read(name, before, after), dtype=np.float64)
        if np.array_equal(steps[before:after], time):
            return values
        columns = values.reshape(len(values), -1)
        found = [np.interp(time, steps[before:after], column) for column in columns.T]
        return np.stack(found, axis=-1).reshape(len(time), *values.shape[1:])

    def rms(self, name: str) -> FloatArray:
        """Return the root mean square of all finite differences, in the shape of a sample."""
        total, count = 0.0, 0
        with np.errstate(over="ignore", invalid="ignore"):
            for start in range(0, self.time.size, BLOCK):
                block = self.read(name, start, min(start + BLOCK, self.time.size))
                block = np.where(np.isfinite(block), block, np.nan)
                total = total + np.nansum(block**2, axis=0)
                count = count + np.count_nonzero(~np.isnan(block), axis=0)
            return np.asarray(np.sqrt(np.divide(total, count)))


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
        width: int,
        spread: str = "",
        rms: Mapping[int, FloatArray] | None = None,
    ) -> None:
        names = [*roles, spread] if spread else list(roles)
        self._curves = {number: read_curves(file, names) for number, file in files.items()}
        self._names = next(iter(files.values())).joint_names if files else ()
        self._roles, self._width, self._spread, self._rms = list(roles.values()), width, spread, rms

    def lines(self, column: int, joints: Sequence[int], by: By = "joint") -> list[Line]:
        """Return a line for each file, role and joint."""
        return [
            self._line(file, at, joint, column, {"joint": joint, "file": file, "role": at}[by])
            for file in self._curves
            for at in range(len(self._roles))
            for joint in joints
        ]

    def _line(self, file: int, at: int, joint: int, column: int, look: int) -> Line:
        curves, band = self._curves[file][joint], None
        curve = curves[at * self._width + column]
        if self._spread:
            band = ShadedArea.around(curve, curves.values[len(self._roles) * self._width + column], look)
        rms = None if self._rms is None else float(self._rms[file][joint, column])
        return Line(curve, look, self._names[joint], joint, joint, file, self._roles[at], band, rms)


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
        spread = deviation(name) if uncertain and deviation(name) in self.common else ""
        width = self.existing(self.first.declared[name]).shape[1]
        return StoredSignals(dict(enumerate(self.files)), roles, width, spread)

    def differences(self, name: str) -> StoredSignals:
        """Read a variable of the other files minus that of the first file, at common times."""
        several = {
            number: ResultDifference(file, self.first) for number, file in enumerate(self.files[1:], 1)
        }
        apart = {number: each for number, each in several.items() if each.time.size}
        rms = {number: each.rms(name).reshape(len(each.joint_names), -1) for number, each in apart.items()}
        return StoredSignals(
            apart, {name: "computed"}, self.existing(self.first.declared[name]).shape[1], rms=rms
        )

    def chart(
        self, name: str, signals: StoredSignals, column: int, joints: Sequence[int], by: By = "joint"
    ) -> Chart:
        """Return the chart of a curve of some joints, all of one type, without title."""
        lines = signals.lines(column, joints, by)
        shown = self.calm(lines) if name in GROWING else None
        unit = self.first.declared[name].quantity.unit(self.first.joint_types[joints[0]])
        return Chart(
            "",
            unit,
            lines,
            name=name,
            limits=self._limits(name, column, joints),
            shown=shown,
            cut_off=shown is not None,
            note=self._undefined(lines),
        )

    def with_utilization(self, chart: Chart, column: int) -> tuple[Chart, Chart | None]:
        """Return a chart, and the utilization of its limits if several joints share the chart.

        Limits of several joints could not be told apart; the chart is returned without those that the
        utilization shows.
        """
        used = self._utilization(chart, column) if len({line.joint for line in chart.lines}) > 1 else None
        if used is None:
            return chart, None
        elsewhere = {line.joint for line in used.lines}
        return replace(chart, limits=[each for each in chart.limits if each.joint not in elsewhere]), used

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
                share = np.abs(2 * line.curve.values - high - low) / (high - low)
                lines.append(line._replace(curve=Curve(line.curve.time, FULL * share), band=None))
        if not lines:
            return None
        shown = self.calm(lines) if chart.name in GROWING else None
        peaks = [np.nanmax(line.curve.values, initial=0) for line in lines] if shown is None else [shown[1]]
        return Chart(
            "",
            "%",
            lines,
            axis="utilization [%]",
            name=chart.name,
            limits=[Limit(LIMIT_LOOK, 0, FULL)],
            shown=(0.0, SPARE * max(FULL, *peaks)),
            cut_off=shown is not None,
        )

    def _undefined(self, lines: Sequence[Line]) -> str:
        """Return a sentence that names the joints without a value at any time; empty if there are none."""
        missing = [line for line in lines if not np.isfinite(line.curve.values).any()]
        failed = any(self.failures[line.file].infeasible[line.joint].any() for line in missing)
        names = ", ".join(dict.fromkeys(line.label for line in missing))
        return f"undefined{' because of infeasible samples' if failed else ''}: {names}" if missing else ""

    def calm(self, lines: Sequence[Line], *others: int) -> tuple[float, float] | None:
        """Return the range of an axis without near-singular peaks; None if they do not matter.

        Args:
            lines: lines of joints.
            others: numbers of further files that must be calm, as for differences.
        """
        calm = []
        for line in lines:
            assert line.joint is not None, "as of all variables that grow"
            of_files = [
                self.failures[file].calm(line.joint, line.curve.time) for file in (line.file, *others)
            ]
            calm.append(np.all(of_files, axis=0))
        return calm_range([line.curve.values for line in lines], calm)

    def corridors(self) -> Iterator[Chart]:
        """Yield the stiffness of each joint within its attainable range, if that is stored."""
        bounds = BOUNDS if set(BOUNDS) <= set(self.common) else ()
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
            return list(self._of_wrench(variable)) if isinstance(variable.quantity, WrenchQuantity) else []
        columns = list(self._columns(variable))
        if name == "stiffness" and set(BOUNDS) <= set(self.common) and len(self.files) == 1:
            return [replace(each, title=f"{variable.long_name}, {each.title}") for each in self.corridors()]
        roles = self._roles(name)
        charts = []
        if roles:
            signals = self.signals(roles)
            for column, title, joints in columns:
                chart, used = self.with_utilization(self.chart(name, signals, column, joints), column)
                charts.append(replace(chart, title=title))
                if used is not None:
                    charts.append(replace(used, title=f"{title}: utilization of limits"))
        for outcome in roles if len(self.files) > 1 else ():
            apart = self.differences(outcome)
            for column, title, joints in columns:
                unit = variable.quantity.unit(self.first.joint_types[joints[0]])
                lines = apart.lines(column, joints)
                shown = flat_range(lines, signals.lines(column, joints))
                note = "" if shown is None else f"equal within {NEGLIGIBLE:g} of the largest value"
                if lines:
                    apart_chart = Chart(
                        f"difference: {title}", unit, lines, name=name, shown=shown, note=note
                    )
                    charts.append(apart_chart)
        return charts

    def _roles(self, name: str) -> dict[str, str]:
        """Return the roles of a variable by its stored names; of several files only its own."""
        simulated = self.first.kind == "simulation" and name in SIMULATED
        roles = {COMMANDS[name]: "commanded"} if simulated and name in COMMANDS else {}
        roles |= {name: "simulated" if simulated else "computed", measured(name): "measured"}
        wanted = roles if len(self.files) == 1 else (name,)
        return {stored: roles[stored] for stored in wanted if stored in self.common}

    def _columns(self, variable: Variable) -> Iterator[tuple[int, str, list[int]]]:
        """Yield each column of a variable and type of joint, with a title and the joints that have it."""
        there, types = self.existing(variable), self.first.joint_types
        words = variable.long_name
        for column in range(there.shape[1]):
            motor = f", motor {MOTORS[column]}" if "motor" in variable.dims else ""
            for joint_type in dict.fromkeys(types):
                joints = [at for at, each in enumerate(types) if each == joint_type and there[at, column]]
                kind = f" ({joint_type} joints)" if len(set(types)) > 1 else ""
                if joints:
                    yield column, f"{words}{motor}{kind}", joints

    def _of_wrench(self, variable: Variable) -> Iterator[Chart]:
        """Yield charts of forces and of moments, on each of several tools."""
        assert isinstance(variable.quantity, WrenchQuantity), "see WRENCH_AXES"
        curves = [read_curves(_Components(file, variable), [variable.name]) for file in self.files]
        tools = [f" on {tool}" for tool in self.first.tool_names] if "tool" in variable.dims else [""]
        for number, on_tool in enumerate(tools):
            before = number * len(WRENCH_AXES)
            for words, axes in (("forces", range(3)), ("moments", range(3, 6))):
                lines = [
                    Line(of_file[before + axis][0], axis, WRENCH_AXES[axis], axis % 3, file=file)
                    for file, of_file in enumerate(curves)
                    for axis in axes
                ]
                unit = variable.quantity.of_axis(axes[0])
                yield Chart(f"{variable.long_name}, {words}{on_tool}", unit, lines, name=variable.name)


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
    apart, peak = (
        max((float(np.nanmax(np.abs(line.curve.values), initial=0.0)) for line in each), default=0.0)
        for each in (differences, lines)
    )
    return (-FLAT * peak, FLAT * peak) if 0 < peak < np.inf and apart <= NEGLIGIBLE * peak else None


def compliant_joints(actuators: Sequence[str]) -> list[int]:
    """Return the joints with a stiffness, by the types of their actuators."""
    there = existing_columns(VARIABLES["stiffness"], actuators)
    return [joint for joint, [has_stiffness] in enumerate(there) if has_stiffness]
