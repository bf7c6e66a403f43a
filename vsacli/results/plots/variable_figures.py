"""Figures of variables that are asked for by name."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from vsacli.base.errors import InputError, Problem
from vsacli.base.variables import Variable, select_variables
from vsacli.results.curves import Failures
from vsacli.results.plots.groups import grouped_figure
from vsacli.results.plots.labels import variable_labels
from vsacli.results.store.reader import StoredResult


def drawable_variables(result: StoredResult, names: Sequence[str]) -> tuple[Variable, ...]:
    """The variables of these names, in declared order.

    Raises:
        InputError: for each of which there is no curve, why.
    """
    selected = select_variables(names, result.declared)
    reasons = [reason for variable in selected if (reason := _undrawable(result, variable))]
    if reasons:
        raise InputError(Problem(str(result.path), 0, reason) for reason in reasons)
    return selected


def _undrawable(result: StoredResult, variable: Variable) -> str:
    """Why there is no curve of a variable; nothing if there is one."""
    name = variable.name
    if name == "flags":
        return "flags are bits, no curve; where steps cannot be done, figures of other variables have bands"
    if "joint" not in variable.dims:
        return f"{name} is not one of joints, which are what figures show; `vsacli export` writes it"
    if name not in result.variables:
        return f"holds no {name}, which the run was without, or written without (--variables)"
    if not result.existing(variable).any():
        return f"none of {', '.join(result.joint_names)} has {name}"
    return ""


def draw_variable(variable: Variable, result: StoredResult, failures: Failures) -> Figure:
    """A figure of a variable, which has a curve."""
    return grouped_figure(result, failures, variable.name, variable_labels(variable), variable.long_name)
