"""`vsacli compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.cli.command_parts import columns_option, example, json_option, overwrite_option, result_line
from vsacli.cli.console import Talk, say, talk_options
from vsacli.cli.file_names import FILE, FOLDER

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs
    from vsacli.studies.measured import Comparison


@click.command(
    "compare",
    short_help="Compare a result with what was measured.",
    epilog=example("vsacli compare result.h5 torques.csv --plot figures"),
)
@click.argument("result", type=FILE)
@click.argument("recording", type=FILE)
@click.option(
    "--begins-at",
    metavar="SECONDS",
    type=float,
    help="When in the recording the result begins, from its first row on; by default found from the signals.",
)
@columns_option
@json_option
@click.option("--plot", "folder", type=FOLDER, help="Save figures of measured and computed signals there.")
@overwrite_option
@talk_options
def compare(
    result: str,
    recording: str,
    begins_at: float | None,
    columns: str | None,
    as_json: bool,
    folder: str | None,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Compare a RESULT, or a simulation, with a RECORDING of the same motion, a CSV file.

    Its column `time` may begin anywhere and have steps of its own. Columns are named as `vsacli export` names
    them, elbow.q, elbow.tau_motor_1, or elbow.tau_motor_shaft_1 for the motor's side of its gear; a unit in
    brackets may follow. Others are left out, unless --columns says what they stand for.

    The report gives, for each signal, the error, the gain and offset of measured over computed values, and
    the lag behind the others.
    """
    from vsacli.base.outputs import Outputs
    from vsacli.results.store.simulation import open_stored
    from vsacli.studies.measured import compare as compared

    with Outputs(overwrite=overwrite, inputs=[result, recording, *filter(None, [columns])]) as outputs:
        with open_stored(result) as stored:
            talk.detail(result_line(stored))
            comparison = compared(stored, recording, begins_at, columns)
        if folder is not None:
            _draw(comparison, folder, outputs)
    say(comparison, as_json)
    talk.wrote(outputs)


def _draw(comparison: Comparison, folder: str, outputs: Outputs) -> None:
    """A figure for each variable that was measured."""
    from vsacli.results.plots import FigureFiles, MeasuredCurve, measured_figure

    curves: dict[str, list[MeasuredCurve]] = {}
    for signal in comparison.signals:
        if signal.samples:
            curve = MeasuredCurve(
                signal.column, signal.unit, signal.rms, signal.time, signal.computed, signal.measured
            )
            curves.setdefault(signal.variable, []).append(curve)
    stems = [Path(path).stem for path in (comparison.result, comparison.recording)]
    files = FigureFiles(curves, folder, "-".join(stems), "png", outputs)
    title = ", ".join(stems)
    files.save(
        {variable: measured_figure(of_it, f"{title}: {variable}") for variable, of_it in curves.items()}
    )
