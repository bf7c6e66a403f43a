"""`vsacli compare`: a result compared with a recording of the same motion, or with another result."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
    columns_option,
    example,
    json_option,
    overwrite_option,
    result_line,
)
from vsacli.cli.console import Exit, Talk, say, talk_options
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import FILE
from vsacli.cli.input_errors import file_kind_or_none, naming_kind
from vsacli.cli.option_types import TIME


@click.command(
    "compare",
    epilog=example("vsacli compare result.h5 torques.csv --plot figures", "vsacli compare soft.h5 stiff.h5"),
)
@click.argument("result", type=FILE)
@click.argument("recording", type=FILE)
@click.option(
    "--time-offset",
    metavar="SECONDS",
    type=TIME,
    help="Time in the recording at which the result begins; positive if the recording starts earlier.",
    show_default="estimated from the signals",
)
@columns_option
@json_option
@figure_options("--plot", purpose="Save figures of measured and computed signals in this folder.", pages=True)
@overwrite_option
@talk_options
def compare(
    result: str,
    recording: str,
    time_offset: float | None,
    columns: str | None,
    as_json: bool,
    figures: FigureTarget | None,
    overwrite: bool,
    talk: Talk,
) -> Exit:
    """Compare RESULT, the file of a result or a simulation, with RECORDING, a CSV file of the same motion.

    RECORDING may be another result, or for a simulation another simulation: the report then has the rms and
    peaks of each signal in both, their difference at equal times, and the number of samples with each flag;
    --json has all variables. Figures of both on the same axes are drawn by `vsacli plot RESULT RESULT`.

    The column `time` of the recording may start at any time and have its own sampling rate. Columns have the
    names of `vsacli export`: elbow.q, elbow.tau_motor_1, or elbow.tau_motor_shaft_1 for the motor side of the
    gear; a unit in brackets may follow. Other columns are ignored unless --columns maps them.

    A sensor reading such as q_measured is preferred to q. Commands such as q_ref are ignored. For each
    signal, the report gives the error, gain and offset of measured over computed values, and the lag relative
    to the other signals, each with its standard error. Exit code 3 if it begins with a warning, for example
    that the recording does not fit the result.
    """
    if file_kind_or_none(recording) in ("result", "simulation"):
        for_recordings = {"--time-offset": time_offset, "--columns": columns, "--plot": figures}
        return _compare_results(result, recording, for_recordings, as_json)
    from vsacli.cli.compare_plots import comparison_page, draw_comparison
    from vsacli.results.pages.document import input_text
    from vsacli.results.store.reader import open_stored
    from vsacli.studies.measured import compare as compared

    with Outputs(overwrite=overwrite, inputs=[result, recording, *filter(None, [columns])]) as outputs:
        stem = f"{Path(result).stem}-{Path(recording).stem}"
        page = figures and figures.page(f"{stem}-comparison", outputs)
        with naming_kind("RESULT", result, ("result", "simulation")), open_stored(result) as stored:
            talk.detail(result_line(stored))
            with (
                naming_kind("RECORDING", recording, ("table", "result")),
                naming_kind("--columns", columns, ("columns",)),
            ):
                comparison = compared(stored, recording, time_offset, columns)
            if page is not None:
                page.write_text(
                    comparison_page(
                        comparison, [input_text(stored_input) for stored_input in stored.inputs()]
                    )
                )
        if page is None and figures is not None:
            draw_comparison(comparison, stem, figures, outputs)
    say(comparison, as_json)
    talk.wrote(outputs)
    return Exit.VERDICT if comparison.warnings else Exit.OK


def _compare_results(
    result: str, other_result: str, for_recordings: Mapping[str, object], as_json: bool
) -> Exit:
    """Compare two results.

    Raises:
        click.UsageError: an option is given that is for recordings.
    """
    if option := next((name for name, content in for_recordings.items() if content is not None), None):
        drawing_hint = f"to draw both, run vsacli plot {result} {other_result}"
        raise click.UsageError(f"{option} is for recordings, but {other_result} is a result; {drawing_hint}")
    from vsacli.results.store.reader import open_stored
    from vsacli.studies.measured import compare_results

    kinds = naming_kind("RESULT", result, ("result", "simulation"))
    with kinds, open_stored(result) as first, open_stored(other_result) as second:
        say(compare_results(first, second), as_json)
    return Exit.OK
