"""Figures of stored results: the only package that imports matplotlib (Figure API, no pyplot, no display)."""

from vsacli.plots.comparison import COMPARISON, compare_results
from vsacli.plots.feasibility import (
    FEASIBILITY,
    FEASIBILITY_VARIABLES,
    check_drawable,
    plot_feasibility,
)
from vsacli.plots.figures import drawable_figures, omitted_figures, plot_result
from vsacli.plots.files import FORMATS, check_figures, save_figures
from vsacli.plots.simulation import SIMULATION_FIGURES, plot_simulation

__all__ = [
    "COMPARISON",
    "FEASIBILITY",
    "FEASIBILITY_VARIABLES",
    "FORMATS",
    "SIMULATION_FIGURES",
    "check_drawable",
    "check_figures",
    "compare_results",
    "drawable_figures",
    "omitted_figures",
    "plot_feasibility",
    "plot_result",
    "plot_simulation",
    "save_figures",
]
