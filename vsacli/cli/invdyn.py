"""`vsacli invdyn`: compute a result file, its report and its figures."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.cli.command_parts import (
    Inputs,
    compute,
    deflection_solver_option,
    engine_options,
    example,
    json_option,
    load_inputs,
    overwrite_option,
    robot_argument,
    run_stem,
    set_option,
    show_report,
    stop_option,
    trajectory_argument,
    variables_option,
)
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FOLDER, HDF5_FILE

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs
    from vsacli.results.plots import FigureFiles


@click.command(
    "invdyn",
    short_help="Compute the motor torques that execute a trajectory.",
    epilog=example("vsacli invdyn robots/vsa_3r.yaml trajectories/rest_to_rest.yaml -o result.h5"),
)
@robot_argument
@trajectory_argument
@set_option
@click.option(
    "--rate",
    metavar="HZ",
    type=float,
    help="Sampling rate of the trajectory, or of its recording if that has no time column; same as "
    "--set rate=HZ.",
)
@click.option(
    "-o",
    "--output",
    type=HDF5_FILE,
    help="Result file to write.",
    show_default="ROBOT-TRAJECTORY.h5 in the current folder",
)
@variables_option("all")
@click.option(
    "--store-precision",
    "precision",
    type=click.Choice(["double", "single"]),
    default="double",
    show_default=True,
    help="Storage precision; single (7 digits) halves the file. Computation is always in double precision.",
)
@click.option(
    "--plot",
    "plot_folder",
    type=FOLDER,
    help="Save the figures of `vsacli plot` in this folder as well, as PNG.",
)
@deflection_solver_option
@json_option
@overwrite_option
@stop_option
@engine_options
@talk_options
def invdyn(
    robot: str,
    trajectory: str,
    changes: tuple[str, ...],
    rate: float | None,
    output: str | None,
    variables: tuple[str, ...] | None,
    precision: str,
    plot_folder: str | None,
    deflection_solver: str,
    as_json: bool,
    overwrite: bool,
    stop_on_infeasible: bool,
    engine: str,
    threads: int | None,
    talk: Talk,
) -> int:
    """Compute the motor torques with which ROBOT executes TRAJECTORY.

    Writes an HDF5 file with all computed variables and prints a report: the samples that are infeasible,
    singular or over a limit, and by how much.
    """
    path = Path(f"{run_stem(robot, trajectory)}.h5" if output is None else output)
    if rate is not None:
        changes = (*changes, f"rate={rate!r}")
    inputs = load_inputs(robot, trajectory, talk, changes, {} if rate is None else {"rate": "--rate"})
    from vsacli.analysis.joint_report import JUDGED
    from vsacli.analysis.run import Run
    from vsacli.base.outputs import Outputs
    from vsacli.results.store.writer import ResultWriter

    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        file = outputs.file(path)
        figures = (
            None if plot_folder is None else _figures(inputs, plot_folder, path.stem, variables, outputs)
        )
        run = Run(
            *inputs,
            stop_on_infeasible=stop_on_infeasible,
            deflection_solver=deflection_solver,
            engine=engine,
            threads=threads,
            asked=(JUDGED,) if variables is None else variables,
            tell=talk.note,
        )
        provenance = {"command_line": shlex.join(["vsacli", *sys.argv[1:]]), **run.provenance}
        writer = ResultWriter(file, *inputs, variables, provenance=provenance, precision=precision)
        report = compute(run, talk, writer)
        if figures is not None:
            from vsacli.cli.plot import draw_staged, recording_figure

            draw_staged(file, figures, talk)
            if inputs.trajectory.estimates:
                figures.save(recording_figure(inputs.robot, inputs.trajectory.estimates.values(), path))
    code = show_report(report, as_json, (robot, trajectory), changes)
    talk.wrote(outputs)
    return code


def _figures(
    inputs: Inputs, folder: str, stem: str, variables: tuple[str, ...] | None, outputs: Outputs
) -> FigureFiles:
    """Stage the figures that the stored variables suffice for, and the figure of a recording."""
    from vsacli.base.variables import VARIABLES
    from vsacli.cli.plot import RECORDING
    from vsacli.results.charts.figures import drawable_figures, result_drawings
    from vsacli.results.plots import FigureFiles

    stored = VARIABLES if variables is None else variables
    drawn = drawable_figures(result_drawings(inputs.robot.has), stored)
    if inputs.trajectory.estimates:
        drawn.append(RECORDING)
    return FigureFiles(drawn, folder, stem, "png", outputs)
