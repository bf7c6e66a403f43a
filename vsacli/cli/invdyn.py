"""`vsacli invdyn`: compute a result file, its report and its figures."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
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
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import HDF5_FILE
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import RATE, Words

if TYPE_CHECKING:
    from vsacli.results.plots import FigureFiles


@click.command(
    "invdyn",
    epilog=example("vsacli invdyn robots/vsa_3r.yaml trajectories/rest_to_rest.yaml -o result.h5"),
)
@robot_argument
@trajectory_argument
@set_option
@click.option(
    "--rate",
    metavar="HZ",
    type=RATE,
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
@variables_option("all", "; all,tip_compliance adds the compliance of tools")
@click.option(
    "--store-precision",
    "precision",
    type=Words(["double", "single"], {"float": "single"}),
    default="double",
    show_default=True,
    help="Storage precision; single (7 digits) halves the file. Computation is always in double precision.",
)
@figure_options("--plot", purpose="Save the figures of `vsacli plot` in this folder as well.")
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
    figures: FigureTarget | None,
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
        _check_one_rate(rate, changes)
        changes = (*changes, f"rate={rate!r}")
    inputs = load_inputs(robot, trajectory, talk, changes, {} if rate is None else {"rate": "--rate"})
    from vsacli.analysis.joint_report import JUDGED
    from vsacli.analysis.run import Run
    from vsacli.base.variables import ALL, select_variables
    from vsacli.results.store.writer import ResultWriter

    requested = () if variables is None else [name for name in variables if name != ALL]
    with naming_option("--variables"):
        select_variables(requested)
    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        file = outputs.file(path)
        figure_files = (
            None if figures is None else _staged_figures(inputs, figures, path.stem, variables, outputs)
        )
        run = Run(
            *inputs,
            stop_on_infeasible=stop_on_infeasible,
            deflection_solver=deflection_solver,
            engine=engine,
            threads=threads,
            asked=(*((JUDGED,) if variables is None or ALL in variables else ()), *requested),
            tell=talk.note,
        )
        provenance = {"command_line": shlex.join(["vsacli", *sys.argv[1:]]), **run.provenance}
        writer = ResultWriter(file, *inputs, variables, provenance=provenance, precision=precision)
        report = compute(run, talk, writer)
        if figure_files is not None:
            from vsacli.cli.drawings import draw_staged

            draw_staged(file, figure_files, talk)
            if inputs.trajectory.estimates:
                from vsacli.cli.plot_recording import recording_figure

                figure_files.save(recording_figure(inputs.robot, inputs.trajectory.estimates.values(), path))
    limits: list[str] = []
    if report.tools:
        from vsacli.analysis.tool_stiffness import limits_for_fixes

        limits = [
            argument
            for limit in limits_for_fixes(inputs.robot, report.tools)
            for argument in ("--set", limit)
        ]
    code = show_report(report, as_json, (robot, trajectory), changes, options=limits)
    talk.wrote(outputs)
    return code


def _check_one_rate(rate: float, changes: tuple[str, ...]) -> None:
    """Refuse `--rate` next to a change of the rate.

    Raises:
        click.UsageError: the change of `--set` is there.
    """
    for change in changes:
        if change.partition("=")[0].strip() == "rate":
            raise click.UsageError(f"--rate {rate:g} contradicts --set {change}; give one")


def _staged_figures(
    inputs: Inputs, target: FigureTarget, stem: str, variables: tuple[str, ...] | None, outputs: Outputs
) -> FigureFiles:
    """Stage the figures that the stored variables suffice for, and the figure of a recording."""
    from vsacli.base.variables import ALL, ON_REQUEST, VARIABLES
    from vsacli.cli.drawings import RECORDING
    from vsacli.results.charts.figures import drawable_figures, result_drawings
    from vsacli.robot.compliance import coupled_joints

    stored_names = {ALL} if variables is None else {*variables}
    if ALL in stored_names:
        stored_names |= {name for name in VARIABLES if name not in ON_REQUEST}
    tools_yield = any(coupled_joints(inputs.robot, tool) for tool in range(len(inputs.robot.end_effectors)))
    names = drawable_figures(result_drawings(inputs.robot.has_variable, tools_yield), stored_names)
    if inputs.trajectory.estimates:
        names.append(RECORDING)
    return target.files(names, stem, outputs)
