"""`vsacli sensitivity`."""

from __future__ import annotations

import json

import click

from vsacli.cli.command_parts import example, json_option, load_inputs, robot_argument, trajectory_argument
from vsacli.cli.console import Talk, say, talk_options


@click.command(
    "sensitivity",
    short_help="Say which numbers of a robot matter most.",
    epilog=example("vsacli sensitivity robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --tolerances 2%"),
)
@robot_argument
@trajectory_argument
@click.option(
    "--parameters",
    "patterns",
    metavar="GLOB",
    multiple=True,
    help="Only numbers whose paths fit, e.g. 'joints.*.actuator.spring.*'; may be given several times.",
)
@click.option(
    "--tolerances",
    metavar="SHARE|FILE",
    help="How uncertain the numbers are: 5%, or a YAML file such as 'joints.*.link.mass: {normal: 2 %}'.",
)
@click.option(
    "--monte-carlo",
    "runs",
    metavar="RUNS",
    type=click.IntRange(min=2),
    help="Compute so many robots drawn from the tolerances as well.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of these draws.")
@json_option
@talk_options
def sensitivity(
    robot: str,
    trajectory: str,
    patterns: tuple[str, ...],
    tolerances: str | None,
    runs: int | None,
    seed: int,
    as_json: bool,
    talk: Talk,
) -> None:
    """Say how much motor torques, margins and energy of TRAJECTORY depend on each number of ROBOT.

    The table begins with the number of which a change of 1 % (1 mm, 1 degree) moves a motor torque most.
    With --tolerances it says how far torques and margins may be off.
    """
    from vsacli.studies.sensitivities import sensitivity as analysed

    if runs is not None and tolerances is None:
        raise click.UsageError("--monte-carlo draws from tolerances: give --tolerances, e.g. 2%")
    inputs = load_inputs(robot, trajectory, talk)
    with talk.progress(inputs.trajectory.samples + (runs or 0), shown_from=20_000) as progress:
        found = analysed(
            inputs.robot,
            inputs.trajectory,
            patterns,
            tolerances,
            runs=runs or 0,
            seed=seed,
            progress=progress.update,
        )
    say(json.dumps(found.as_json(), indent=1) if as_json else str(found))
