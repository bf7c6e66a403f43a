"""The plots of a page of results or simulations: one or more for each variable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.simulation_variables import actual, measured
from vsacli.base.units import WrenchQuantity
from vsacli.base.variables import MOTORS, VARIABLES, Variable, deviation
from vsacli.base.wrench import WRENCH_AXES
from vsacli.results.corridors import BOUNDS, visible_range
from vsacli.results.curves import Curves, Failures, Sampled, read_curves
from vsacli.results.near_singular import GROWING, calm_range
from vsacli.results.pages.charts import Banded, Chart, Limit, Series
from vsacli.results.pages.packing import Packed
from vsacli.results.pages.sections import Section, sections_of
from vsacli.results.several import Difference
from vsacli.results.store.reader import StoredResult

DEVIATIONS = 2
"""Standard deviations to both sides of a curve that its band holds, as in figures."""

BEYOND = 5.0
"""How far the corridor is drawn beyond what is shown of it at first, in heights of that."""


CUT_OFF = "peaks of near-singular steps are cut off; Ctrl and the wheel show them"


class ResultCharts:
    """What makes the plots of one file, or of several on the same axes.

    Args:
        files: open, of one kind and of the same joints.
        packed: what holds the arrays.

    Attributes:
        start: time from which the page counts, s.
    """

    def __init__(self, files: Sequence[StoredResult], packed: Packed) -> None:
        self._files, self._packed = files, packed
        self._first = files[0]
        self.start = min(float(file.time[0]) for file in files)
        self._common = [name for name in self._first.variables if all(name in f.variables for f in files)]

    @cached_property
    def sections(self) -> list[Section]:
        """The sections, with the variables that all files hold.

        Raises:
            InputError: there is nothing to plot.
        """
        found = list(sections_of(self._common))
        if not found:
            what = "hold no variable in common" if len(self._files) > 1 else "holds no variable"
            raise InputError.one(f"nothing can be plotted: {what} that has a plot", self._first.path)
        return found

    @cached_property
    def _failures(self) -> list[Failures]:
        return [Failures.of(file) for file in self._files]

    @cached_property
    def _differences(self) -> list[Difference]:
        """The files after the first, each minus that."""
        return [Difference(file, self._first) for file in self._files[1:]]

    def of(self, name: str) -> list[Chart]:
        """The plots of a variable, of simulations with what came of it."""
        variable = self._variable(name)
        if "joint" not in variable.dims:
            return list(self._of_wrench(variable))
        if name == "stiffness" and set(BOUNDS) <= set(self._common) and len(self._files) == 1:
            return list(self._corridors(variable))
        return [*self._of_joints(name, variable), *self._of_differences(name, variable)]

    def _variable(self, name: str) -> Variable:
        declared = self._first.declared
        return declared[name] if name in declared else declared[actual(name)]

    def _roles(self, name: str) -> dict[str, str]:
        """What is drawn of a variable, by the name it is stored under; of several files the outcome alone."""
        simulated = actual(name) in self._common
        roles = {name: "commanded" if simulated else "computed"}
        roles |= {actual(name): "actual", measured(name): "measured"}
        there = {stored: role for stored, role in roles.items() if stored in self._common}
        if len(self._files) > 1:
            outcome = actual(name) if simulated else name
            return {outcome: there[outcome]} if outcome in there else {}
        return there

    def _existing(self, variable: Variable) -> BoolArray:
        there = [file.existing(variable) for file in self._files]
        return np.asarray(np.any(there, axis=0))

    def _words(self, variable: Variable) -> str:
        """What it is called; where what was commanded and what came of it are one plot, neither of both."""
        if actual(variable.name) in self._common:
            return VARIABLES[variable.name].long_name.replace("commanded ", "")
        return variable.long_name

    def _columns(self, variable: Variable) -> Iterator[tuple[int, str, str, list[int]]]:
        """For each column of a variable and type of joint: title, unit, and the joints that have it."""
        there, types = self._existing(variable), self._first.joint_types
        for column in range(there.shape[1]):
            motor = f", motor {MOTORS[column]}" if "motor" in variable.dims else ""
            for joint_type in dict.fromkeys(types):
                joints = [at for at, each in enumerate(types) if each == joint_type and there[at, column]]
                if joints:
                    kind = f" ({joint_type} joints)" if len(set(types)) > 1 else ""
                    title = f"{self._words(variable)}{motor}{kind}"
                    yield column, title, variable.quantity.unit(joint_type), joints

    def _of_joints(self, name: str, variable: Variable) -> Iterator[Chart]:
        roles, width = self._roles(name), self._existing(variable).shape[1]
        uncertain = deviation(name) in self._common
        wanted = [*roles, deviation(name)] if uncertain else list(roles)
        curves = [read_curves(file, wanted) for file in self._files]
        for column, title, unit, joints in self._columns(variable):
            spread = len(roles) * width + column if uncertain else None
            series = [
                self._series(joint, file, role, _curve(of_file[joint], at * width + column, spread))
                for file, of_file in enumerate(curves)
                for at, role in enumerate(roles.values())
                for joint in joints
            ]
            band = "two standard deviations" if any(each.band for each in series) else ""
            limits = self._limits(name, column, joints)
            rows = [at * width + column for at in range(len(roles))]
            shown = self._calm(curves, rows, joints) if name in GROWING else None
            note = CUT_OFF if shown else ""
            yield Chart(title, name, unit, tuple(series), limits, shown, band, note)

    def _calm(
        self, curves: Sequence[Sequence[Curves]], rows: Sequence[int], joints: Sequence[int]
    ) -> tuple[float, float] | None:
        """What is shown if near-singular peaks would set the scale otherwise."""
        places = [(file, row, joint) for file in range(len(curves)) for row in rows for joint in joints]
        values = [curves[file][joint].values[row] for file, row, joint in places]
        calm = [self._failures[file].calm(joint, curves[file][joint].time) for file, _, joint in places]
        found = calm_range(values, calm)
        return None if found is None else (found.bottom, found.top)

    def _series(self, joint: int, file: int, role: str, curve: Banded, **further: Any) -> Series:
        arrays: Any = curve.packed(self._packed, self.start)
        return Series(self._first.joint_names[joint], joint, joint, file, role, **arrays, **further)

    def _limits(self, name: str, column: int, joints: Sequence[int]) -> tuple[Limit, ...]:
        bounds = self._first.limits(name)[:, column % self._first.limits(name).shape[1]]
        return tuple(
            Limit(joint, float(value)) for joint in joints for value in bounds[joint] if np.isfinite(value)
        )

    def _corridors(self, variable: Variable) -> Iterator[Chart]:
        """Stiffness of each joint in what its load allows."""
        curves = read_curves(self._first, [variable.name, *BOUNDS])
        for _, _, unit, joints in self._columns(variable):
            for joint in joints:
                time, (command, lower, upper) = curves[joint].time, curves[joint].values
                shown = visible_range(command, lower, upper)
                spare = BEYOND * (shown[1] - shown[0])
                carried = None
                if np.isfinite(lower).any():
                    carried = np.maximum(lower, shown[0] - spare), np.minimum(upper, shown[1] + spare)
                series = self._series(joint, 0, "computed", Banded(time, command, carried))
                title = f"{variable.long_name}, {self._first.joint_names[joint]}"
                limits = self._limits(variable.name, 0, [joint])
                band = "reachable" if carried else ""
                yield Chart(title, variable.name, unit, (series,), limits, shown, band)

    def _of_differences(self, name: str, variable: Variable) -> Iterator[Chart]:
        """Each file minus the first one, where they have times in common."""
        apart = {file: each for file, each in enumerate(self._differences, 1) if each.time.size}
        for outcome in self._roles(name) if apart else ():
            curves = {file: read_curves(each, [outcome]) for file, each in apart.items()}
            joints_first = (len(self._first.joint_names), -1)
            rms = {file: each.rms(outcome).reshape(joints_first) for file, each in apart.items()}
            for column, title, unit, joints in self._columns(variable):
                series = [
                    self._series(joint, file, "computed", curve, rms=float(rms[file][joint, column]))
                    for file in apart
                    for joint in joints
                    for curve in [_curve(curves[file][joint], column)]
                ]
                yield Chart(f"difference: {title}", name, unit, tuple(series))

    def _of_wrench(self, variable: Variable) -> Iterator[Chart]:
        assert isinstance(variable.quantity, WrenchQuantity), "see WRENCH_AXES"
        curves = [read_curves(_Components(file), [variable.name]) for file in self._files]
        for words, axes in (("forces", range(3)), ("moments", range(3, 6))):
            series = []
            for file, of_file in enumerate(curves):
                for axis in axes:
                    arrays: Any = _curve(of_file[axis], 0).packed(self._packed, self.start)
                    series.append(Series(WRENCH_AXES[axis], axis % 3, None, file, "computed", **arrays))
            title = f"{variable.long_name}, {words}"
            yield Chart(title, variable.name, variable.quantity.of_axis(axes[0]), tuple(series))


def _curve(curves: Curves, row: int, deviation_row: int | None = None) -> Banded:
    """One of the curves of a joint; if its deviation is another one of them, with a band."""
    values = curves.values[row]
    if deviation_row is None or np.isnan(curves.values[deviation_row]).all():
        return Banded(curves.time, values)
    spread = DEVIATIONS * curves.values[deviation_row]
    return Banded(curves.time, values, (values - spread, values + spread))


class _Components:
    """A wrench over time, its components in place of joints."""

    joint_names = WRENCH_AXES

    def __init__(self, file: Sampled) -> None:
        self._file = file

    @property
    def time(self) -> FloatArray:
        return self._file.time

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        return np.asarray(self._file.read(name, start, stop), dtype=np.float64)
