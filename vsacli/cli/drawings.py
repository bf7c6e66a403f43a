"""Figures of a stored result or simulation, for `vsacli plot` and for the command that has written it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.base.outputs import Outputs, Staged
from vsacli.base.storage import temporary_folder
from vsacli.base.version import __version__
from vsacli.cli.command_parts import compute
from vsacli.cli.console import Talk
from vsacli.cli.figure_options import FigureTarget
from vsacli.results.charts.figures import (
    FEASIBILITY,
    FEASIBILITY_VARIABLES,
    check_drawable,
    drawings_of,
    feasibility,
    omitted_figures,
)
from vsacli.results.charts.stored import StoredCharts
from vsacli.results.plots import FigureFiles, draw_stored
from vsacli.results.store.reader import StoredResult, open_stored
from vsacli.results.store.writer import ResultWriter

if TYPE_CHECKING:
    from vsacli.analysis.report import Report
    from vsacli.analysis.run import Run

RECORDING = "recording"
"""Name of the figure of recorded signals, with their splines and the noise found in them."""


def draw_staged(file: Staged, figures: FigureFiles, talk: Talk) -> None:
    """Draw the figures of a file that this command has written."""
    with open_stored(file.temporary) as stored:
        draw_stored_figures(stored, file.path, figures, talk)


def draw_stored_figures(
    stored: StoredResult,
    path: Path,
    figures: FigureFiles,
    talk: Talk,
    variables: tuple[str, ...] | None = None,
) -> None:
    """Draw the figures of an open file; report figures for which variables are missing."""
    if variables is None:
        for reason in omitted_figures(drawings_of(stored), stored.variables).values():
            talk.note(f"{path}: {reason}")
    for name, figure in draw_stored(stored, variables):
        figures.save({name: figure})
        del figure  # else it stays in memory while the next one is drawn


def has_recording(stored: StoredResult, talk: Talk) -> bool:
    """Return whether the recording behind a result can be drawn; print a note if it exists but cannot."""
    if stored.kind != "result" or not stored.report_json.get("fits"):
        return False
    inputs, made_by = stored.inputs(), stored.provenance()["generated_by"]
    if not inputs or any(stored_input.content is None for stored_input in inputs):
        reason = "the result does not hold it"
    elif made_by != (this_version := f"vsacli {__version__}"):
        reason = f"the result was computed by {made_by}, and this is {this_version}"
    else:
        return True
    talk.note(f"{stored.path}: no figure of its recording: {reason}")
    return False


def compute_and_draw(run: Run, target: FigureTarget, stem: str, outputs: Outputs, talk: Talk) -> Report:
    """Compute, and draw the figure from a temporary result file."""
    check_drawable([joint.actuator_type for joint in run.robot.joints])
    figures = target.files([FEASIBILITY], stem, outputs)
    with temporary_folder() as folder:
        file = Staged.unnamed(folder / "result.h5")
        report = compute(run, talk, ResultWriter(file, run.robot, run.trajectory, FEASIBILITY_VARIABLES))
        with StoredResult.open(file.temporary) as result:
            figures.save({FEASIBILITY: feasibility(StoredCharts([result]))})
    return report
