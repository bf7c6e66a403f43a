"""Which figures a file has, by name, and which of them its variables allow."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import NamedTuple, TypeAlias

from matplotlib.figure import Figure

from vsacli.base.errors import InputError
from vsacli.results.curves import Failures
from vsacli.results.plots.panels import missing_variables
from vsacli.results.store.reader import StoredResult

Figures: TypeAlias = dict[str, Figure]
"""By name, such as "motion"."""


class Drawing(NamedTuple):
    """How a figure is drawn, and the variables without which it cannot be."""

    needs: tuple[str, ...]
    draw: Callable[[StoredResult, Failures], Figure]


def drawable_figures(
    drawings: Mapping[str, Drawing], variables: Collection[str], path: str | Path = ""
) -> list[str]:
    """Names of the figures that can be drawn from these variables.

    Raises:
        InputError: there is none; `path` is the file it names.
    """
    omitted = omitted_figures(drawings, variables)
    if len(omitted) == len(drawings):
        raise InputError.one("nothing can be plotted: " + "; ".join(omitted.values()), path)
    return [name for name in drawings if name not in omitted]


def omitted_figures(drawings: Mapping[str, Drawing], variables: Collection[str]) -> dict[str, str]:
    """Figures that cannot be drawn from these variables, by name, each with the reason as a sentence."""
    reasons = {}
    for name, drawing in drawings.items():
        missing = [variable for variable in drawing.needs if variable not in variables]
        if missing:
            reasons[name] = missing_variables(name, missing)
    return reasons
