"""Figures of stored results: the only package that imports matplotlib (Figure API, no pyplot, no display)."""

from vsacli.plots.comparison import COMPARISON, compare_results
from vsacli.plots.figures import drawable_figures, omitted_figures, plot_result
from vsacli.plots.files import FORMATS, check_figures, save_figures

__all__ = [
    "COMPARISON",
    "FORMATS",
    "check_figures",
    "compare_results",
    "drawable_figures",
    "omitted_figures",
    "plot_result",
    "save_figures",
]
