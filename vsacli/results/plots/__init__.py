"""Figures drawn by Matplotlib, which only this package imports (Figure API, no pyplot, no display)."""

from vsacli.base.errors import StorageError

try:
    import matplotlib.font_manager  # noqa: F401 - Matplotlib creates its cache folder on this import
except OSError as error:
    reason = "Matplotlib has no folder for its files; name one by the environment variable MPLCONFIGDIR"
    raise StorageError("figures", f"cannot be drawn: {reason}") from error

from vsacli.results.plots.arm_figure import arm_figure
from vsacli.results.plots.figures import (
    FORMATS,
    FigureFiles,
    Figures,
    compare_files,
    draw_stored,
    plot_stored,
    save_figures,
)
from vsacli.results.plots.recorded_figure import recorded_figure
from vsacli.results.plots.robot_figures import actuators_figure, stiffness_figure
from vsacli.results.plots.sheets import draw_sheet
from vsacli.results.plots.sizing_figure import MotorLimits, TorqueSpeed, torque_speed_figure
from vsacli.results.plots.study_figures import compared_studies, ranking_figure, study_figures

__all__ = [
    "FORMATS",
    "FigureFiles",
    "Figures",
    "MotorLimits",
    "TorqueSpeed",
    "actuators_figure",
    "arm_figure",
    "compare_files",
    "compared_studies",
    "draw_sheet",
    "draw_stored",
    "plot_stored",
    "ranking_figure",
    "recorded_figure",
    "save_figures",
    "stiffness_figure",
    "study_figures",
    "torque_speed_figure",
]
