"""`vsacli identify --plan`: plan a motion to record."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import read_robot, read_trajectory
from vsacli.cli.console import EXIT_OF_VERDICT, Exit, Talk, say, tell

USUAL_DURATION = 20.0
"""Default duration of the excitation, s."""

SHOWN_FROM = 1
"""Number of trial motions from which a progress bar is shown; each takes some 50 ms."""


def plan(
    robot_path: str,
    trajectory_paths: Sequence[str],
    *,
    duration: float,
    noise: tuple[float, ...] | None,
    seed: int,
    output: str | None,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Plan an excitation, compare it with the user's trajectory if one is given, and write it."""
    if len(trajectory_paths) > 1:
        raise click.UsageError(
            f"--plan: expected at most one TRAJECTORY to compare with, found {len(trajectory_paths)}"
        )
    from vsacli.studies.identification.excitation import (
        TRIALS,
        USUAL_NOISE,
        ImpossibleError,
        Noise,
        excitation_text,
        plan_excitation,
    )
    from vsacli.studies.identification.excitation.plan import LONGEST, SHORTEST

    if not SHORTEST <= duration <= LONGEST:
        hint = f"must be from {SHORTEST:g} to {LONGEST:g} s, not {duration:g} s"
        raise click.BadParameter(hint, param_hint="--duration")
    sensors = USUAL_NOISE if noise is None else Noise(*noise)
    robot = read_robot(robot_path)
    trajectory = read_trajectory(trajectory_paths[0], robot, None, talk) if trajectory_paths else None
    inputs = [*robot.sources, *(() if trajectory is None else trajectory.sources)]
    with Outputs(overwrite=overwrite, inputs=[source.path for source in inputs]) as outputs:
        file = None if output is None else outputs.file(Path(output))
        try:
            with talk.progress(TRIALS, shown_from=SHOWN_FROM, label="searching") as progress:
                excitation = plan_excitation(
                    robot, trajectory, duration=duration, noise=sensors, seed=seed, progress=progress.update
                )
        except ImpossibleError as error:
            tell(f"{robot.name}: no excitation is feasible: {error}")
            return Exit.VERDICT
        if file is not None:
            with file.opened() as stream:
                stream.write(excitation_text(excitation))
    say(excitation, as_json)
    talk.wrote(outputs)
    if output is None:
        talk.note("the excitation was not written; name a file for it: -o excitation.yaml")
    return EXIT_OF_VERDICT[excitation.verdict]
