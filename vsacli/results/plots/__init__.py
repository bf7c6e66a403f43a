"""Figures of stored results: the only package that imports matplotlib (Figure API, no pyplot, no display)."""

from vsacli.base.errors import StorageError

try:
    import matplotlib.font_manager  # noqa: F401 - where Matplotlib looks for a folder to keep what it finds
except OSError as error:
    reason = "Matplotlib has no folder for its files; name one by the environment variable MPLCONFIGDIR"
    raise StorageError("figures", f"cannot be drawn: {reason}") from error

from vsacli.results.plots.comparison import COMPARISON, compare_files, comparison_names
from vsacli.results.plots.corridor_figure import (
    FEASIBILITY,
    FEASIBILITY_VARIABLES,
    check_drawable,
    plot_feasibility,
)
from vsacli.results.plots.drawings import drawable_figures, omitted_figures
from vsacli.results.plots.figures import (
    RESULT_DRAWINGS,
    chosen_figures,
    draw_stored,
    drawings_of,
    plot_stored,
    result_drawings,
)
from vsacli.results.plots.files import FORMATS, FigureFiles, save_figures
from vsacli.results.plots.measured_figure import measured_figure
from vsacli.results.plots.optimum_figures import JointChange, Moved, change_figure, pace_figure
from vsacli.results.plots.recorded_figure import recorded_figure
from vsacli.results.plots.sensitivity_figures import Bar, Torque, band_figure, ranking_figure
from vsacli.results.plots.simulation_figures import simulation_drawings
from vsacli.results.plots.sizing_figure import Bounds, TorqueSpeed, torque_speed_figure
from vsacli.results.plots.study_figures import compared_studies, study_figures

__all__ = [
    "COMPARISON",
    "FEASIBILITY",
    "FEASIBILITY_VARIABLES",
    "FORMATS",
    "RESULT_DRAWINGS",
    "Bar",
    "Bounds",
    "FigureFiles",
    "JointChange",
    "Moved",
    "Torque",
    "TorqueSpeed",
    "band_figure",
    "change_figure",
    "check_drawable",
    "chosen_figures",
    "compare_files",
    "compared_studies",
    "comparison_names",
    "draw_stored",
    "drawable_figures",
    "drawings_of",
    "measured_figure",
    "omitted_figures",
    "pace_figure",
    "plot_feasibility",
    "plot_stored",
    "ranking_figure",
    "recorded_figure",
    "result_drawings",
    "save_figures",
    "simulation_drawings",
    "study_figures",
    "torque_speed_figure",
]
