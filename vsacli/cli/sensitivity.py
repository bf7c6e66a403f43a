"""`vsacli sensitivity`: derivatives by robot parameters, tolerances and Monte Carlo runs."""

from __future__ import annotations

import shlex
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
from vsacli.base.texts import counted
from vsacli.cli.command_parts import (
    Inputs,
    example,
    json_option,
    load_inputs,
    overwrite_option,
    robot_argument,
    run_stem,
    seed_option,
    set_option,
    trajectory_argument,
)
from vsacli.cli.console import Exit, Talk, say, talk_options
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import FILE, HDF5_FILE
from vsacli.cli.input_errors import naming_kind, naming_option
from vsacli.cli.option_types import SHARE, Whole
from vsacli.results.charts.ranking import Ranking

if TYPE_CHECKING:
    from vsacli.base.outputs import Staged
    from vsacli.results.store.derived_files import SensitivityWriter
    from vsacli.robot.model import Robot
    from vsacli.studies.sensitivities import Sensitivity, SensitivityRun

RANKING, BAND = "ranking", "band"
"""Names of the figures."""

SHOWN_FROM = 20_000
"""Number of samples from which a progress bar is shown; each costs some twenty times that of a run."""


def _share_or_file(context: click.Context, parameter: click.Parameter, text: str | None) -> str | None:
    """Refuse a share beyond 100 %, as a click callback."""
    if text is not None and text.rstrip().endswith("%"):
        SHARE.convert(text, parameter, context)
    return text


@click.command(
    "sensitivity",
    epilog=example("vsacli sensitivity robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --tolerances 2%"),
)
@robot_argument
@trajectory_argument
@set_option
@click.option(
    "--parameters",
    "patterns",
    metavar="GLOB",
    multiple=True,
    help="Include only parameters whose paths match this pattern, e.g. 'joints.*.actuator.spring.*'; "
    "may be repeated.",
)
@click.option(
    "--tolerances",
    metavar="SHARE|FILE",
    type=FILE,
    callback=_share_or_file,
    help="Uncertainty of the parameters: a share for all, e.g. 5%, or a YAML file with lines such as "
    "'joints.*.link.mass: {normal: 2 %}'.",
)
@click.option(
    "--monte-carlo",
    "runs",
    metavar="N",
    type=Whole("a number of robots, at least 2, e.g. 1000", least=2),
    help="Number of robots, at least 2, drawn at random from the tolerances and computed as well.",
)
@seed_option("draws of --monte-carlo")
@click.option("-o", "--output", type=HDF5_FILE, help="Write the derivatives over time to this HDF5 file.")
@figure_options("--plot", purpose="Save figures of the ranking and of the tolerance bands in this folder.")
@json_option
@overwrite_option
@talk_options
def sensitivity(
    robot: str,
    trajectory: str,
    changes: tuple[str, ...],
    patterns: tuple[str, ...],
    tolerances: str | None,
    runs: int | None,
    seed: int,
    output: str | None,
    figures: FigureTarget | None,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> Exit:
    """Rank the parameters of ROBOT by their effect on motor torques, margins and energy of TRAJECTORY.

    The table begins with the parameter of which a change of 1 % (1 mm, 1 degree) changes a motor torque most.
    With --tolerances the report also gives the resulting uncertainty of torques and margins. Exit code 3 if
    samples are infeasible or singular, which are left out.
    """
    if runs is not None and tolerances is None:
        raise click.UsageError("--monte-carlo draws from tolerances: give --tolerances, e.g. 2%")
    inputs = load_inputs(robot, trajectory, talk, changes)
    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        file = None if output is None else outputs.file(Path(output))
        analysis = _analyze(inputs, patterns, tolerances, runs or 0, seed, file, talk)
        if figures is not None:
            _draw_figures(analysis, inputs.robot, tolerances, figures, run_stem(robot, trajectory), outputs)
    say(analysis, as_json)
    talk.wrote(outputs)
    return Exit.VERDICT if analysis.left_out else Exit.OK


def _analyze(
    inputs: Inputs,
    patterns: tuple[str, ...],
    tolerances: str | None,
    runs: int,
    seed: int,
    file: Staged | None,
    talk: Talk,
) -> Sensitivity:
    """Run the analysis; write the derivatives block by block if there is a file for them."""
    from vsacli.robot.parameters import parameters
    from vsacli.studies.sensitivities import SensitivityRun, analyzed

    with naming_option("--parameters"):
        parameters(inputs.robot, patterns)
    run = SensitivityRun(*inputs, patterns)
    with ExitStack() as stack:
        writer = None if file is None else stack.enter_context(_writer(file, run))
        steps = inputs.trajectory.samples + runs
        progress = stack.enter_context(talk.progress(steps, shown_from=SHOWN_FROM))
        stack.enter_context(naming_option("--tolerances"))  # all else has been checked
        stack.enter_context(naming_kind("--tolerances", tolerances, ("tolerances",)))
        analysis = analyzed(
            run,
            tolerances,
            runs=runs,
            seed=seed,
            progress=progress.update,
            keep=unheard if writer is None else writer.write,
        )
        if writer is not None:
            writer.finish({**analysis.as_json(), "complete": True})
    return analysis


def unheard(_: object) -> None:
    """Discard derivatives that are not stored."""


def _writer(file: Staged, run: SensitivityRun) -> SensitivityWriter:
    from vsacli.results.store.derived_files import ParameterValue, SensitivityWriter

    parameters = [
        ParameterValue(str(parameter), parameter.value, parameter.unit) for parameter in run.parameters
    ]
    provenance = {"command_line": shlex.join(["vsacli", *sys.argv[1:]])}
    return SensitivityWriter(file, run.robot, run.trajectory, parameters, run.slopes, provenance=provenance)


def _draw_figures(
    analysis: Sensitivity,
    robot: Robot,
    tolerances: str | None,
    target: FigureTarget,
    stem: str,
    outputs: Outputs,
) -> None:
    """Draw the ranking, and the bands of motor torques if tolerances are given."""
    from vsacli.results.charts.optimum import MotorTorqueCurve, band_sheet
    from vsacli.results.plots import ranking_figure

    names = [RANKING] if analysis.curves is None else [RANKING, BAND]
    files = target.files(names, stem, outputs)
    files.save({RANKING: ranking_figure(Ranking.of(analysis.as_json(), robot.joint_names))})
    if analysis.curves is not None and tolerances is not None:
        time, values, deviation = analysis.curves
        torques = [
            MotorTorqueCurve(
                joint.name, joint.type, motor, values[:, index, motor - 1], deviation[:, index, motor - 1]
            )
            for index, joint in enumerate(robot.joints)
            for motor in range(1, joint.actuator.motor_count + 1)
        ]
        parameters = counted(len(analysis.parameters), "parameter")
        title = f"sensitivity of {analysis.robot}, {analysis.trajectory}: {parameters}, tolerances "
        files.save({BAND: band_sheet(time, torques, title + Path(tolerances).name)})
