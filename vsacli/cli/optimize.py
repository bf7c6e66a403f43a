"""`vsacli optimize`: the best stiffness or timing of a trajectory."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
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
from vsacli.cli.file_names import YAML_FILE
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import SHARE, Words

if TYPE_CHECKING:
    from vsacli.robot.model import Robot


@click.command(
    "optimize",
    epilog=example(
        "vsacli optimize robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --minimize torque -o best.yaml"
    ),
)
@robot_argument
@trajectory_argument
@set_option
@click.option(
    "--minimize",
    type=Words(["torque", "energy", "copper_loss", "peak", "time"]),
    default="torque",
    show_default=True,
    help="Objective: rms of the motor torques, positive motor work, copper loss of the windings, peak "
    "motor torque, or duration.",
)
@click.option(
    "--vary",
    type=Words(["stiffness", "timing", "both"]),
    help="Decision variables: stiffness profile, timing, or both.",
    show_default="stiffness; timing for --minimize time",
)
@click.option(
    "--min-margin",
    type=SHARE,
    help="Minimum relative margin of every sample to the ends of its attainable stiffness range, e.g. 3%.",
    show_default="1%",
)
@click.option(
    "-o",
    "--output",
    type=YAML_FILE,
    help="Write the best trajectory, which is only reported otherwise; signals without a formula go to a CSV "
    "file next to it.",
)
@figure_options("--plot", purpose="Save figures of stiffness, torques and timing in this folder.")
@seed_option("initial guesses")
@json_option
@overwrite_option
@talk_options
def optimize(
    robot: str,
    trajectory: str,
    changes: tuple[str, ...],
    minimize: str,
    vary: str | None,
    min_margin: float | None,
    output: str | None,
    figures: FigureTarget | None,
    seed: int,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> Exit:
    """Optimize the stiffness or the timing with which ROBOT executes TRAJECTORY.

    The duration stays as commanded unless --minimize time is given. Every sample keeps the minimum margin and
    all limits. The result is a local optimum; the report gives the number of initial guesses that led to it.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy reads it when it is imported, which comes next
    from vsacli.base.flags import MIN_MARGIN, check_min_margin

    min_margin = MIN_MARGIN if min_margin is None else min_margin
    with naming_option("--min-margin"):
        check_min_margin(min_margin)
    inputs = load_inputs(robot, trajectory, talk, changes)
    from vsacli.studies.search import Fix, check_fixed_target, searches, write_fixed
    from vsacli.studies.search import optimize as optimized

    vary = vary or ("timing" if minimize == "time" else "stiffness")
    _check_objective(inputs.robot, minimize, vary)
    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        if output is not None:
            check_fixed_target(output, outputs)
        paths = {}
        if figures is not None:
            from vsacli.cli.optimize_plots import CHANGE, PACE

            names = (CHANGE,) if vary == "stiffness" else (CHANGE, PACE)
            paths = figures.paths(names, run_stem(robot, trajectory))
        for path in paths.values():
            outputs.folder(path.parent)
            outputs.check(path)
        steps = searches(inputs.robot, minimize, vary)
        with talk.progress(steps, shown_from=0, label="searching") as progress:
            optimum = optimized(
                *inputs,
                minimize,
                vary,
                min_margin=min_margin,
                seed=seed,
                progress=progress.update,
            )
        if output is not None and optimum.trajectory is not None:
            write_fixed(Fix(0.0, inputs.robot, optimum.trajectory), output, outputs)
        elif output is not None:
            talk.note(f"{output} is not written: nothing feasible was found")
        elif optimum.trajectory is not None:
            talk.note("the best trajectory is not written; give -o FILE to keep it")
        if paths and optimum.trajectory is not None:
            from vsacli.cli.optimize_plots import optimum_sheets
            from vsacli.results.plots import FigureFiles

            sheets = optimum_sheets(optimum, optimum.trajectory, inputs.trajectory)
            FigureFiles({name: paths[name] for name in sheets}, outputs).save(sheets)
    talk.wrote(outputs)
    say(optimum, as_json)
    return Exit.OK if optimum.possible else Exit.VERDICT


def _check_objective(robot: Robot, minimize: str, vary: str) -> None:
    """Refuse an objective that the robot has no parameters for, or decision variables that it does not have.

    Raises:
        InputError: with the option.
    """
    from vsacli.studies.search.cheapest_stiffness import (
        check_timing_varies,
        checked_criterion,
        varied_joints,
    )

    with naming_option("--vary"):
        varied = varied_joints(robot, vary)
    with naming_option("--minimize"):
        if minimize == "time":
            check_timing_varies(vary)
        else:
            checked_criterion(robot, minimize, varied if vary == "stiffness" else range(len(robot.joints)))
