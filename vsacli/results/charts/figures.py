"""Figures of stored files, by name: results as in Figs. 1-3 of Buondonno & De Luca (2016), and simulations.

Joints of one unit share panels; many joints are split into groups, with their names next to the panels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from vsacli.base.errors import InputError, Problem
from vsacli.base.simulation_variables import COMMANDS, SIMULATION_VARIABLES
from vsacli.base.variables import (
    MOTOR_CONSTANTS,
    MOTORS,
    OF_ANY_ROBOT,
    TIP_COMPLIANCE,
    VARIABLES,
    Variable,
    deviation,
    select_variables,
)
from vsacli.results.charts.chart import PANEL_WIDTH, Chart, Legend, PanelGrid, Row, Sheet
from vsacli.results.charts.stored import StoredCharts, compliant_joints
from vsacli.results.charts.tool_charts import AXES, ToolPath, tool_charts, tool_path
from vsacli.results.store.reader import StoredResult

JOINTS_PER_PANEL = 7

GROUP_HEIGHT, LEGEND_WIDTH = 2.3, 1.3
"""Height of the panels of a group, and width of the names next to them, inches."""

UTILIZATION = 0.55
"""Height of the panels of the utilization of limits, relative to those of the values above."""

NARROW_WIDTH, LOW_HEIGHT = 2.5, 1.4
"""Size of a stiffness panel next to the positions if there are several columns of them, inches."""

CORRIDOR_HEIGHT, CORRIDOR_ROWS = 1.7, 5
"""Height of a panel, inches, and rows of panels in the figure of the stiffness alone."""

MOTION_HEIGHT, MOTION_ROWS = 1.7, 7
"""Height of a panel, inches, and rows of panels in the figure of a simulated motion."""

FEASIBILITY = "feasibility"
"""Name of the figure of `check-feasibility`, whose file is called `<stem>-feasibility`."""

FEASIBILITY_VARIABLES = ("stiffness", "stiffness_min", "stiffness_max", "flags")
"""Variables needed for that figure."""

Part: TypeAlias = tuple[str, str]
"""A variable and the label of its axis; `{force}` becomes force or torque, `{motor}` the number of the
motor."""


class Drawing(NamedTuple):
    """A figure: the variables that it needs, and the function that declares its sheet, or a path of tools."""

    needs: tuple[str, ...]
    sheet: Callable[[StoredCharts], Sheet | ToolPath]


def panel_groups(joint_types: Sequence[str]) -> list[list[int]]:
    """Return the joints that share a panel: of one type and thus one unit; large groups are split evenly."""
    groups: list[list[int]] = []
    for joint_type in dict.fromkeys(joint_types):
        joints = [joint for joint, other_type in enumerate(joint_types) if other_type == joint_type]
        panels = math.ceil(len(joints) / JOINTS_PER_PANEL)
        groups += [group.tolist() for group in np.array_split(joints, panels)]
    return groups


def result_title(result: StoredResult, label: str = "") -> str:
    """Return robot and trajectory, the conditions of a simulation, and the end of an incomplete run.

    Names of robot and trajectory that are equal are written once.

    Args:
        result: open result or simulation.
        label: name that distinguishes the file from others; by default that of the trajectory.
    """
    names = ", ".join(dict.fromkeys((result.robot_name, label or result.trajectory_name)))
    ending = "" if result.complete else f" (stopped at {result.time[-1]:.4g} s)"
    return f"{names}{_conditions(result)}{ending}"


def _conditions(result: StoredResult) -> str:
    """Return what distinguishes a simulation from the plan: controller, and error of its model."""
    if result.kind != "simulation":
        return ""
    controller = str(result.report_json["controller"]).replace("-", " ")
    error = result.provenance()["options"].get("perturb", 0.0)
    return f": simulation, {controller}" + (f", model error {100 * error:.3g} %" if error else "")


def axis_label(words: str, unit: str, joint_type: str, column: int) -> str:
    """Return the axis label of a `Part`."""
    force = "force" if joint_type == "prismatic" else "torque"
    return f"{words.format(force=force, motor=MOTORS[column])} [{unit}]"


def variable_words(variable: Variable) -> str:
    """Return the axis label of a variable that has no label in words."""
    return f"{variable.name}_{{motor}}" if "motor" in variable.dims else variable.name


def grouped(charts: StoredCharts, *parts: Part, words: str = "") -> Sheet:
    """Return the figure of variables side by side, with a column of panels for each of their curves."""
    blocks = [_group_panels(charts, part, named=part == parts[-1]) for part in parts]
    columns = [len(block.rows[0]) for block in blocks]
    width = PANEL_WIDTH * sum(columns) if len(blocks) > 1 else 2 * PANEL_WIDTH + legend_width(charts)
    height = max(block.height for block in blocks) + 1
    title = ": ".join(filter(None, (result_title(charts.first), words)))
    return Sheet(title, (width, height), _legend(charts, blocks), blocks, columns)


def _parts_drawing(*parts: Part) -> Drawing:
    return Drawing(tuple(name for name, _ in parts), lambda charts: grouped(charts, *parts))


def _group_panels(charts: StoredCharts, part: Part, *, named: bool = True) -> PanelGrid:
    """Return a row of panels for each group of joints with the variable.

    Limits of several joints in one panel could not be told apart: their utilization has a row of its own.
    """
    name, words = part
    existing = charts.existing(charts.first.declared[name])
    groups = [group for group in panel_groups(charts.first.joint_types) if existing[group].any()]
    columns = np.flatnonzero(existing.any(axis=0)).tolist()
    signals = charts.signals({name: "computed"})

    def panels(group: Sequence[int], column: int) -> tuple[Chart | None, Chart | None]:
        present = [joint for joint in group if existing[joint, column]]
        if not present:
            return None, None
        chart, utilization = charts.with_utilization(charts.chart(name, signals, column, present), column)
        axis = axis_label(words, chart.unit, charts.first.joint_types[group[0]], column)
        failures = [(file_failures, group) for file_failures in charts.failures]
        return replace(chart, axis=axis, failures=failures), utilization

    rows: list[Row] = []
    for group in groups:
        rows += zip(*(panels(group, column) for column in columns), strict=True)
    beside: list[Legend] = [{charts.first.joint_names[joint]: joint for joint in group} for group in groups]
    heights: tuple[float, ...] = (GROUP_HEIGHT, UTILIZATION * GROUP_HEIGHT)
    if any(chart for row in rows[1::2] for chart in row):
        beside = [legend for names in beside for legend in (names, {})]
    else:
        rows, heights = rows[::2], (GROUP_HEIGHT,)
    named = named and legend_width(charts) > 0
    return PanelGrid(charts.first.time, rows, heights, beside=beside if named else ())


def legend_width(charts: StoredCharts) -> float:
    """Return the width of names next to the panels, inches; 0 for few joints, which one legend names."""
    return LEGEND_WIDTH if len(charts.first.joint_names) > JOINTS_PER_PANEL else 0.0


def _legend(charts: StoredCharts, blocks: Sequence[PanelGrid]) -> dict[str, int]:
    """Return the legend of the joints with a curve; empty if their names are next to the panels."""
    drawn_joints = {
        line.joint
        for block in blocks
        for row in block.rows
        for chart in row
        if chart
        for line in chart.lines
        if np.isfinite(line.curve.values).any()
    }
    names = enumerate(charts.first.joint_names)
    return {} if legend_width(charts) else {name: joint for joint, name in names if joint in drawn_joints}


def _corridors(charts: StoredCharts, most_rows: int, height: float) -> PanelGrid:
    """Return the stiffness of each joint within its attainable range, in rows of this height, inches."""
    rows = [
        [replace(chart, failures=[(file_failures, [joint]) for file_failures in charts.failures])]
        for joint, chart in zip(charts.compliant, charts.corridors(), strict=True)
    ]
    return PanelGrid(charts.first.time, rows, (height,), most_rows)


def feasibility(charts: StoredCharts) -> Sheet:
    """Return the figure of the commanded stiffness within the attainable range."""
    block = _corridors(charts, CORRIDOR_ROWS, CORRIDOR_HEIGHT)
    size = (PANEL_WIDTH * max(2, block.columns), block.height + 1)
    return Sheet(result_title(charts.first), size, {}, [block])


def check_drawable(actuators: Sequence[str]) -> None:
    """Refuse a robot without stiffness to draw, by the actuator types of its joints.

    Raises:
        InputError: all joints are rigid.
    """
    if not compliant_joints(actuators):
        raise InputError.one("there is no stiffness to plot: all joints are rigid")


def _motion(charts: StoredCharts) -> Sheet:
    """Return Fig. 1: positions at the left; at the right the stiffness, if any joint has one."""
    part = ("q", "joint position $q$")
    if not charts.compliant:
        return grouped(charts, part)
    positions = _group_panels(charts, part)
    positions_height = positions.height
    stiffness = _corridors(charts, max(CORRIDOR_ROWS, int(positions_height / LOW_HEIGHT)), LOW_HEIGHT)
    stiffness_columns = stiffness.columns
    widths = (PANEL_WIDTH, PANEL_WIDTH if stiffness_columns == 1 else NARROW_WIDTH * stiffness_columns)
    size = (sum(widths) + legend_width(charts), max(positions_height, stiffness.height) + 1)
    blocks = [positions, stiffness]
    return Sheet(result_title(charts.first), size, _legend(charts, blocks), blocks, widths)


_RESULT_PARTS: dict[str, tuple[Part, ...]] = {
    "motor-torque": (("tau_motor", r"motor {force} $\tau_{motor}$"),),
    "elastic-torque": (("tau_e", r"elastic {force} $\tau_e$"),),
    "energy": (("elastic_energy", "elastic energy"), ("motor_energy", "work of motor {motor}")),
    "losses": (("dissipated_power", "friction and damping"),),
    "damper": (("damping", "damping $d$"), ("tau_damper", "{force} of the damper")),
    "motor-current": (("current", "current of motor {motor}, $i_{motor}$"),),
    "motor-voltage": (("voltage", "voltage of motor {motor}, $u_{motor}$"),),
}
"""Figures of a result in addition to its motion; the first two are Figs. 2 and 3."""

_SIMULATION_PARTS: dict[str, Part] = {
    "position-error": ("q_error", "position error $q - q_d$"),
    "stiffness-error": ("stiffness_error", r"stiffness error $\sigma - \sigma_d$"),
    **{name: _RESULT_PARTS[name][0] for name in ("motor-torque", "losses", "motor-current", "motor-voltage")},
}

_COMMANDED_LABELS = {"q": "$q$", "stiffness": r"$\sigma$"}
"""Variables of simulations with a command, a column of panels each, with the axis label."""

_ROLES = {"commanded": 0, "simulated": 1}


def _energy(charts: StoredCharts) -> Sheet:
    """Return the energy in the springs, if there are any, and the work of each motor at its right."""
    parts = _RESULT_PARTS["energy"] if charts.compliant else _RESULT_PARTS["energy"][1:]
    return grouped(charts, *parts)


def _simulated_motion(charts: StoredCharts) -> Sheet:
    """Return a row of panels for each joint: position and stiffness, commanded and simulated."""
    first = charts.first
    existing = np.array([charts.existing(first.declared[name])[:, 0] for name in _COMMANDED_LABELS]).T
    existing = existing[:, existing.any(axis=0)]
    names = list(_COMMANDED_LABELS)[: existing.shape[1]]
    signals = {name: charts.signals({COMMANDS[name]: "commanded", name: "simulated"}) for name in names}

    def panel(joint: int, name: str) -> Chart:
        chart = charts.chart(name, signals[name], 0, [joint], "role")
        return replace(
            chart,
            title=first.joint_names[joint],
            axis=f"{_COMMANDED_LABELS[name]} [{chart.unit}]",
            limits=[limit._replace(style_index=len(_ROLES)) for limit in chart.limits],
            failures=[(file_failures, [joint]) for file_failures in charts.failures],
        )

    rows = [
        [panel(joint, name) if exists else None for name, exists in zip(names, joint_mask, strict=True)]
        for joint, joint_mask in enumerate(existing)
    ]
    block = PanelGrid(first.time, rows, (MOTION_HEIGHT,), MOTION_ROWS)
    size = (max(2, block.columns) * PANEL_WIDTH, block.height + 1.2)
    return Sheet(result_title(first), size, _ROLES, [block])


def _tool_stiffness(charts: StoredCharts) -> Sheet:
    """Return the stiffness of each tool in its softest direction, and below it these directions."""
    stiffness, *directions = tool_charts(charts.files)
    tools = {name: index for index, name in enumerate(charts.first.tool_names)}
    beside: list[Legend] = [
        tools,
        *({axis: style_index for style_index, axis in enumerate(AXES)} for _ in directions),
    ]
    rows = [[chart] for chart in (stiffness, *directions)]
    heights = (GROUP_HEIGHT, *(UTILIZATION * GROUP_HEIGHT for _ in directions))
    block = PanelGrid(charts.first.time, rows, heights, beside=beside)
    return Sheet(result_title(charts.first), (2 * PANEL_WIDTH + LEGEND_WIDTH, block.height + 1), {}, [block])


RESULT_DRAWINGS: dict[str, Drawing] = {
    "motion": Drawing(("q", "stiffness"), _motion),
    **{name: _parts_drawing(*parts) for name, parts in _RESULT_PARTS.items()},
    "energy": Drawing(tuple(name for name, _ in _RESULT_PARTS["energy"]), _energy),
    "tool-stiffness": Drawing((TIP_COMPLIANCE,), _tool_stiffness),
    "tool-path": Drawing(
        (TIP_COMPLIANCE, "q"), lambda charts: tool_path(charts.first, result_title(charts.first))
    ),
}
"""Figures of a result of `invdyn`, by name."""


def result_drawings(has_variable: Callable[[Variable], bool], tools_yield: bool) -> dict[str, Drawing]:
    """Return the figures whose variables the results of a robot have; of compliance, if any tool yields."""
    return {
        name: drawing
        for name, drawing in RESULT_DRAWINGS.items()
        if all(has_variable(VARIABLES[variable_name]) for variable_name in drawing.needs)
        and (tools_yield or TIP_COMPLIANCE not in drawing.needs)
    }


def simulation_drawings(has_variable: Callable[[Variable], bool]) -> dict[str, Drawing]:
    """Return the figures of a simulation whose variables at least one joint has."""
    return {
        "motion": Drawing(
            (*map(COMMANDS.__getitem__, _COMMANDED_LABELS), *_COMMANDED_LABELS), _simulated_motion
        ),
        **{
            name: _parts_drawing(part)
            for name, part in _SIMULATION_PARTS.items()
            if has_variable(SIMULATION_VARIABLES[part[0]])
        },
    }


def drawings_of(stored: StoredResult) -> dict[str, Drawing]:
    """Return the figures of a file by name, according to its kind."""
    if stored.kind == "simulation":
        return simulation_drawings(lambda variable: bool(stored.existing(variable).any()))
    rigid = ["rigid" in tool.get("stiffness", {}) for tool in stored.report_json.get("tools", [])]
    return result_drawings(stored.has_variable, not rigid or not all(rigid))


def drawable_figures(
    drawings: Mapping[str, Drawing], variables: Collection[str], path: str | Path = ""
) -> list[str]:
    """Return the names of the figures that can be drawn from these variables.

    Raises:
        InputError: no figure can be drawn; with the file `path`.
    """
    omitted = omitted_figures(drawings, variables)
    if len(omitted) == len(drawings):
        raise InputError.one("nothing can be plotted: " + "; ".join(omitted.values()), path)
    return [name for name in drawings if name not in omitted]


def omitted_figures(drawings: Mapping[str, Drawing], variables: Collection[str]) -> dict[str, str]:
    """Return the figures that cannot be drawn from these variables, by name, each with the reason."""
    reasons = {}
    for name, drawing in drawings.items():
        missing = [variable for variable in drawing.needs if variable not in variables]
        if missing:
            reasons[name] = missing_variables(name, missing)
    return reasons


def missing_variables(figure: str, variables: Sequence[str]) -> str:
    """Return the message for a figure that cannot be drawn."""
    needed = " and ".join(variables)
    return f"figure {figure} needs {needed}, which this result was written without (--variables)"


def chosen_figures(stored: StoredResult, variables: Sequence[str] | None) -> list[str]:
    """Return the names of the figures of these variables, or of all default figures that can be drawn.

    Raises:
        InputError: a variable has no curve, or no default figure can be drawn.
    """
    if variables is None:
        return drawable_figures(drawings_of(stored), stored.variables, stored.path)
    return [variable.name for variable in drawable_variables(stored, variables)]


def sheets_of(
    stored: StoredResult, variables: Sequence[str] | None = None
) -> Iterator[tuple[str, Sheet | ToolPath]]:
    """Yield the chosen figures by name; each is declared only when needed, since its curves take memory."""
    charts, drawings = StoredCharts([stored]), drawings_of(stored)
    for name in chosen_figures(stored, variables):
        if variables is None:
            yield name, drawings[name].sheet(charts)
        else:
            variable = stored.declared[name]
            yield name, grouped(charts, (name, variable_words(variable)), words=variable.long_name)


def drawable_variables(result: StoredResult, names: Sequence[str]) -> tuple[Variable, ...]:
    """Return the variables with these names, in declared order.

    Raises:
        InputError: with the reason for each variable without a curve.
    """
    selected = select_variables(names, result.declared)
    reasons = [reason for variable in selected if (reason := _undrawable(result, variable))]
    if reasons:
        raise InputError(Problem(str(result.path), 0, reason) for reason in reasons)
    return selected


def _undrawable(result: StoredResult, variable: Variable) -> str:
    """Return why a variable has no curve; empty if it has one."""
    name = variable.name
    if name == "flags":
        return "flags are bits, not a curve; figures of other variables mark infeasible samples by bands"
    if "joint" not in variable.dims:
        return f"{name} is not a variable of joints, which figures show; `vsacli export` writes it"
    if name not in result.variables:
        return _missing_reason(result, variable)
    if not result.existing(variable).any():
        return f"none of {', '.join(result.joint_names)} has {name}"
    return ""


def _missing_reason(result: StoredResult, variable: Variable) -> str:
    """Return why a file does not hold a variable."""
    name, robot = variable.name, result.robot_name
    if variable.requires in MOTOR_CONSTANTS and not result.has_variable(variable):
        return f"has no {name}: no motor of {robot} has a {variable.requires}"
    if variable.requires not in OF_ANY_ROBOT and not result.has_variable(variable):
        return f"has no {name}: no joint of {robot} has {variable.requires}, or --variables left it out"
    if name.endswith(suffix := deviation("")) and not any(
        stored_name.endswith(suffix) for stored_name in result.variables
    ):
        return f"has no {name}: no signal of its trajectory was recorded, or --variables left it out"
    return f"was written without {name} (--variables); compute it again without --variables"
