"""`vsacli identify`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.cli.command_parts import example, json_option, overwrite_option, robot_argument, words_of
from vsacli.cli.console import EXIT_OF_VERDICT, Talk, say, talk_options

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs
    from vsacli.studies.identification import Identification


@click.command(
    "identify",
    short_help="Find the numbers of a robot from records.",
    epilog=example("vsacli identify robots/vsa_3r.yaml record.csv -o fitted.yaml --plot figures"),
)
@robot_argument
@click.argument("recordings", nargs=-1, required=True, metavar="RECORDING...")
@click.option(
    "--fit",
    metavar="WORDS",
    callback=words_of("springs,motors"),
    help="What to find, of springs, motors, friction, links; or paths such as "
    "'joints.*.actuator.spring.k'. All by default.",
)
@click.option(
    "--bandwidth",
    metavar="HZ",
    type=click.FloatRange(min=0, min_open=True),
    help="Of the filter that all signals pass; by default half as much again as the motion has.",
)
@click.option("-o", "--output", metavar="FILE", help="Write the robot file with the numbers found.")
@click.option(
    "--plot", "folder", metavar="FOLDER", help="Save figures of measured and predicted torques there."
)
@json_option
@overwrite_option
@talk_options
def identify(
    robot: str,
    recordings: tuple[str, ...],
    fit: tuple[str, ...] | None,
    bandwidth: float | None,
    output: str | None,
    folder: str | None,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Find springs, motors, friction and links of ROBOT from RECORDINGs of its motion, CSV files.

    Columns are named as `vsacli export` names them: elbow.q, elbow.theta_1, elbow.tau_motor_1, or
    elbow.tau_motor_shaft_1 and elbow.current_1 where the robot file has gear ratio and torque constant; a
    unit in brackets may follow, and cells may be empty where a column has no sample.

    The report gives each number with its standard error, what cannot be told apart, and what the equations
    leave beside the noise, on parts of the records, too, that the fit did not see.
    """
    from vsacli.base.outputs import Outputs
    from vsacli.robot.file import load_robot
    from vsacli.studies.identification import WORDS, fitted_text
    from vsacli.studies.identification import identify as identified

    loaded = load_robot(robot)
    inputs = [*(source.path for source in loaded.sources), *recordings]
    with Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        file = None if output is None else outputs.file(Path(output))
        found = identified(loaded, recordings, fit or WORDS, bandwidth)
        if file is not None:
            with file.opened() as stream:
                stream.write(fitted_text(loaded, found, Path(output or "").parent))
        if folder is not None:
            _draw(found, robot, folder, outputs)
    say(json.dumps(found.as_json(), indent=1) if as_json else str(found))
    talk.wrote(outputs)
    return EXIT_OF_VERDICT[found.verdict]


def _draw(found: Identification, robot: str, folder: str, outputs: Outputs) -> None:
    """A figure for each record."""
    from vsacli.results.plots import FigureFiles, MeasuredCurve, measured_figure

    records = list(dict.fromkeys(each.record for each in found.torques))
    names = {record: f"{number}-{Path(record).stem}" for number, record in enumerate(records, 1)}
    files = FigureFiles(names.values(), folder, Path(robot).stem, "png", outputs)
    files.save(
        {
            names[record]: measured_figure(
                [
                    MeasuredCurve(
                        each.group, each.unit, each.residual, each.time, each.predicted, each.measured
                    )
                    for each in found.torques
                    if each.record == record
                ],
                f"{found.robot}, {Path(record).stem}: predicted by the numbers found, filtered",
            )
            for record in records
        }
    )
