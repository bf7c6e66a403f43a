"""Figures of stored results: the only package that imports matplotlib (Figure API, no pyplot, no display)."""

from vsacli.plots.comparison import COMPARISON, compare_files
from vsacli.plots.drawings import drawable_figures, omitted_figures
from vsacli.plots.feasibility import (
    FEASIBILITY,
    FEASIBILITY_VARIABLES,
    check_drawable,
    plot_feasibility,
)
from vsacli.plots.figures import drawings_of, plot_stored
from vsacli.plots.files import FORMATS, check_figures, save_figures
from vsacli.plots.result import RESULT_DRAWINGS
from vsacli.plots.simulation import simulation_drawings

__all__ = [
    "COMPARISON",
    "FEASIBILITY",
    "FEASIBILITY_VARIABLES",
    "FORMATS",
    "RESULT_DRAWINGS",
    "check_drawable",
    "check_figures",
    "compare_files",
    "drawable_figures",
    "drawings_of",
    "omitted_figures",
    "plot_feasibility",
    "plot_stored",
    "save_figures",
    "simulation_drawings",
]
