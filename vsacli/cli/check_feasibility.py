"""`vsacli check-feasibility`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from vsacli.cli.console import Talk, talk_options
from vsacli.cli.options import (
    example,
    json_option,
    overwrite_option,
    robot_argument,
    stop_option,
    trajectory_argument,
)
from vsacli.cli.running import load_inputs, refuse_input_as_output, show_report

if TYPE_CHECKING:
    from vsacli.robot import Robot
    from vsacli.suggest import Suggestions


@click.command(
    "check-feasibility",
    short_help="Say whether a robot can execute a trajectory.",
    epilog=example("vsacli check-feasibility robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --suggest"),
)
@robot_argument
@trajectory_argument
@json_option
@stop_option
@click.option(
    "--near-singular",
    metavar="MARGIN",
    type=float,
    help="Relative margin below which a step is near-singular; by default 0.01.",
)
@click.option("--suggest", "advise", is_flag=True, help="Also say what smallest change would mend it.")
@click.option(
    "--write-fixed",
    "fixed",
    metavar="FILE",
    help="Write the suggested stiffness profile as FILE.yaml, with a CSV beside it; implies --suggest.",
)
@overwrite_option
@talk_options
def check_feasibility(
    robot: str,
    trajectory: str,
    as_json: bool,
    stop_on_infeasible: bool,
    near_singular: float | None,
    advise: bool,
    fixed: str | None,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Say whether ROBOT can execute TRAJECTORY, without computing a result file.

    The same computation as invdyn, and the same report. Exit code 0 if every step is feasible, regular and
    within limits, else 3.

    --suggest looks for the smallest slow-down, the smallest constant offset of the stiffness, and the nearest
    smooth stiffness profile with which every step keeps the near-singular margin and all limits. Each is
    confirmed on all steps.
    """
    inputs = load_inputs(robot, trajectory, talk)
    from vsacli.feasibility import NEAR_SINGULAR
    from vsacli.pipeline import Run
    from vsacli.suggest import check_fixed_target, fixed_paths, suggest

    margin = NEAR_SINGULAR if near_singular is None else near_singular
    run = Run(*inputs, stop_on_infeasible=stop_on_infeasible, near_singular=margin)
    if fixed is not None:
        check_fixed_target(fixed, overwrite=overwrite)
        for path in fixed_paths(fixed):
            refuse_input_as_output(path, (source.path for part in inputs for source in part.sources))
    with talk.progress(run.trajectory.samples) as progress:
        for block in run:
            progress.update(len(block.time))
    report = run.report()
    suggestions = suggest(*inputs, margin) if advise or fixed is not None else None
    if suggestions is not None and fixed is not None:
        _write_fixed(suggestions, inputs[0], fixed, overwrite, talk)
    return show_report(report, as_json, suggestions)


def _write_fixed(suggestions: Suggestions, robot: Robot, path: str, overwrite: bool, talk: Talk) -> None:
    """Write the suggested profile, if there is one, and say what was written."""
    from vsacli.suggest import StiffnessProfile, write_fixed

    profile = suggestions.stiffness_profile
    if isinstance(profile, StiffnessProfile):
        written = write_fixed(profile.trajectory, robot.joint_names, path, overwrite=overwrite)
        talk.note(f"wrote {' and '.join(map(str, written))}")
    else:
        reason = "nothing needs to change" if profile is None else "no stiffness profile mends the task"
        talk.note(f"{path} is not written: {reason}")
