"""`vsacli invdyn`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from vsacli.cli.command_parts import (
    compute,
    deflections_option,
    engine_options,
    example,
    hdf5_name,
    json_option,
    load_inputs,
    overwrite_option,
    refuse_input_as_output,
    robot_argument,
    run_stem,
    show_report,
    stop_option,
    trajectory_argument,
    variables_option,
)
from vsacli.cli.console import Talk, talk_options


@click.command(
    "invdyn",
    short_help="Compute the motor torques that execute a trajectory.",
    epilog=example("vsacli invdyn robots/vsa_3r.yaml trajectories/rest_to_rest.yaml -o result.h5"),
)
@robot_argument
@trajectory_argument
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    callback=hdf5_name,
    help="Result file; by default ROBOT-TRAJECTORY.h5 in this folder.",
)
@variables_option("all")
@click.option(
    "--plot", "plot_folder", metavar="FOLDER", help="Also draw the figures of `vsacli plot` there, as png."
)
@deflections_option
@json_option
@overwrite_option
@stop_option
@engine_options
@talk_options
def invdyn(
    robot: str,
    trajectory: str,
    output: str | None,
    variables: tuple[str, ...] | None,
    plot_folder: str | None,
    deflections: str,
    as_json: bool,
    overwrite: bool,
    stop_on_infeasible: bool,
    engine: str,
    threads: int | None,
    talk: Talk,
) -> int:
    """Compute the motor torques with which ROBOT executes TRAJECTORY.

    Writes an HDF5 file with everything that was computed and prints a report: which steps are infeasible,
    singular or over a limit, and by how much.
    """
    path = Path(f"{run_stem(robot, trajectory)}.h5" if output is None else output)
    inputs = load_inputs(robot, trajectory, talk)
    refuse_input_as_output(path, inputs.files)
    from vsacli.analysis.run import Run
    from vsacli.base.atomic_files import check_target
    from vsacli.base.variables import VARIABLES
    from vsacli.results.store.writer import ResultWriter

    if plot_folder is not None:
        from vsacli.results.plots import RESULT_DRAWINGS, check_figures, drawable_figures

        drawn = drawable_figures(RESULT_DRAWINGS, VARIABLES if variables is None else variables)
        check_figures(drawn, plot_folder, path.stem, overwrite=overwrite)
    writer = ResultWriter(
        path, *inputs, variables, overwrite=overwrite, command_line=shlex.join(["vsacli", *sys.argv[1:]])
    )
    check_target(path, overwrite=overwrite)
    run = Run(
        *inputs,
        stop_on_infeasible=stop_on_infeasible,
        deflections=deflections,
        engine=engine,
        threads=threads,
    )
    report = compute(run, talk, writer)
    code = show_report(report, as_json)
    talk.note(f"wrote {path}")
    if plot_folder is not None:
        from vsacli.cli.plot import draw_file

        draw_file(path, Path(plot_folder), "png", overwrite, talk)
    return code
