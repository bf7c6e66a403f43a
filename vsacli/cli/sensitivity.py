"""`vsacli sensitivity`: derivatives by robot parameters, tolerances and Monte Carlo runs."""

from __future__ import annotations

import shlex
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

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
from vsacli.cli.console import Talk, say, talk_options
from vsacli.cli.file_names import FILE, FOLDER, HDF5_FILE
from vsacli.cli.input_errors import naming_kind

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs, Staged
    from vsacli.results.store.derived_files import SensitivityWriter
    from vsacli.robot.model import Robot
    from vsacli.studies.sensitivities import Sensitivity, SensitivityRun

SHOWN_FROM = 20_000
"""Number of samples from which a progress bar is shown; each costs some twenty times that of a run."""


@click.command(
    "sensitivity",
    short_help="Rank robot parameters by their effect on a motion.",
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
    help="Uncertainty of the parameters: a share for all, e.g. 5%, or a YAML file with lines such as "
    "'joints.*.link.mass: {normal: 2 %}'.",
)
@click.option(
    "--monte-carlo",
    "runs",
    metavar="N",
    type=click.IntRange(min=2),
    help="Number of robots drawn at random from the tolerances and computed as well.",
)
@seed_option("draws of --monte-carlo")
@click.option("-o", "--output", type=HDF5_FILE, help="Write the derivatives over time to this HDF5 file.")
@click.option(
    "--plot",
    "folder",
    type=FOLDER,
    help="Save figures of the ranking and of the tolerance bands in this folder.",
)
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
    folder: str | None,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Rank the parameters of ROBOT by their effect on motor torques, margins and energy of TRAJECTORY.

    The table begins with the parameter of which a change of 1 % (1 mm, 1 degree) changes a motor torque most.
    With --tolerances the report also gives the resulting uncertainty of torques and margins.
    """
    if runs is not None and tolerances is None:
        raise click.UsageError("--monte-carlo draws from tolerances: give --tolerances, e.g. 2%")
    from vsacli.base.outputs import Outputs

    inputs = load_inputs(robot, trajectory, talk, changes)
    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        file = None if output is None else outputs.file(Path(output))
        with naming_kind("--tolerances", tolerances, ("tolerances",)):
            found = _analyzed(inputs, patterns, tolerances, runs or 0, seed, file, talk)
        if folder is not None:
            _draw(found, inputs.robot, folder, run_stem(robot, trajectory), outputs)
    say(found, as_json)
    talk.wrote(outputs)


def _analyzed(
    inputs: Inputs,
    patterns: tuple[str, ...],
    tolerances: str | None,
    runs: int,
    seed: int,
    file: Staged | None,
    talk: Talk,
) -> Sensitivity:
    """Run the analysis; write the derivatives block by block if there is a file for them."""
    from vsacli.studies.sensitivities import SensitivityRun, analyzed

    run = SensitivityRun(*inputs, patterns)
    with ExitStack() as stack:
        writer = None if file is None else stack.enter_context(_writer(file, run))
        steps = inputs.trajectory.samples + runs
        progress = stack.enter_context(talk.progress(steps, shown_from=SHOWN_FROM))
        found = analyzed(
            run,
            tolerances,
            runs=runs,
            seed=seed,
            progress=progress.update,
            keep=unheard if writer is None else writer.write,
        )
        if writer is not None:
            writer.finish({**found.as_json(), "complete": True})
    return found


def unheard(_: object) -> None:
    """Discard derivatives that are not stored."""


def _writer(file: Staged, run: SensitivityRun) -> SensitivityWriter:
    from vsacli.results.store.derived_files import Number, SensitivityWriter

    numbers = [Number(str(each), each.value, each.unit) for each in run.parameters]
    provenance = {"command_line": shlex.join(["vsacli", *sys.argv[1:]])}
    return SensitivityWriter(file, run.robot, run.trajectory, numbers, run.slopes, provenance=provenance)


def _draw(found: Sensitivity, robot: Robot, folder: str, stem: str, outputs: Outputs) -> None:
    """Draw the ranking, and the bands of motor torques if tolerances are given."""
    from vsacli.results.charts.optimum import Torque, band_sheet
    from vsacli.results.plots import Bar, FigureFiles, ranking_figure

    title = f"{found.robot}, {found.trajectory}"
    bars = [Bar(f"{each.words} of {each.path}", each.share, each.most[0]) for each in found.top if each.most]
    names = ["ranking"] if found.curves is None else ["ranking", "band"]
    files = FigureFiles(names, folder, stem, "png", outputs)
    files.save({"ranking": ranking_figure(bars, title)})
    if found.curves is not None:
        time, values, deviation = found.curves
        torques = [
            Torque(joint.name, joint.type, motor, values[:, index, motor - 1], deviation[:, index, motor - 1])
            for index, joint in enumerate(robot.joints)
            for motor in range(1, joint.actuator.motor_count + 1)
        ]
        files.save({"band": band_sheet(time, torques, title)})
