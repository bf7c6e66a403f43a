"""`vsacli check-feasibility`: the report of a run without its result file, and fixes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
from vsacli.base.texts import joined
from vsacli.cli.command_parts import (
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
)
from vsacli.cli.console import EXIT_OF_VERDICT, Exit, Talk, say_text, talk_options
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import YAML_FILE
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import SHARE, Whole

if TYPE_CHECKING:
    from vsacli.studies.search import Fixes


@click.command(
    "check-feasibility",
    epilog=example("vsacli check-feasibility robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --fixes"),
)
@robot_argument
@trajectory_argument
@set_option
@json_option
@stop_option
@click.option(
    "--min-margin",
    type=SHARE,
    help="Minimum relative margin: samples below it are near-singular, and fixes keep it, e.g. 3%.",
    show_default="1%",
)
@deflection_solver_option
@figure_options("--plot", purpose="Save a figure of the attainable range of each stiffness in this folder.")
@click.option("--fixes", "list_fixes", is_flag=True, help="List fixes as well, the smallest change first.")
@click.option(
    "--write-fix",
    "number",
    metavar="N",
    type=Whole("the number of a fix as --fixes lists it, e.g. 1", least=1),
    help="Write fix N of the list to the file of -o; implies --fixes.",
)
@click.option(
    "-o",
    "--output",
    type=YAML_FILE,
    help="Trajectory file for --write-fix. Signals without a formula go to a CSV file next to it, and "
    "a robot whose branch changes to FILE-robot.yaml.",
)
@overwrite_option
@engine_options
@talk_options
def check_feasibility(
    robot: str,
    trajectory: str,
    changes: tuple[str, ...],
    as_json: bool,
    stop_on_infeasible: bool,
    min_margin: float | None,
    deflection_solver: str,
    figures: FigureTarget | None,
    list_fixes: bool,
    number: int | None,
    output: str | None,
    overwrite: bool,
    engine: str,
    threads: int | None,
    talk: Talk,
) -> int:
    """Check whether ROBOT can execute TRAJECTORY, and print the report of invdyn without a result file.

    Exit code 0 if every sample is feasible, regular and within limits, and the recording, if there is one,
    determines that reliably; else 3.

    --fixes lists changes that make the motion executable: a slower motion, another stiffness (a constant or
    a smooth profile), another branch, or several of these, so that every sample keeps --min-margin and all
    limits. The smallest change comes first, and each is confirmed by a run. --write-fix N -o FILE writes the
    trajectory with fix N of the list; then only the list is printed, and the exit code is 0 if that fixes
    every joint.
    """
    _check_fix_options(number, output, changes)
    from vsacli.base.flags import MIN_MARGIN, check_min_margin

    options = () if min_margin is None else ("--min-margin", f"{100 * min_margin:g}%")
    min_margin = MIN_MARGIN if min_margin is None else min_margin
    with naming_option("--min-margin"):
        check_min_margin(min_margin)
    inputs = load_inputs(robot, trajectory, talk, changes)
    from vsacli.analysis.run import Run

    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        if output is not None:
            from vsacli.studies.search import check_fixed_target

            check_fixed_target(output, outputs)
        run = Run(
            *inputs,
            stop_on_infeasible=stop_on_infeasible,
            min_margin=min_margin,
            deflection_solver=deflection_solver,
            engine=engine,
            threads=threads,
            asked=("flags",),
            tell=talk.note,
        )
        if figures is None:
            report = compute(run, talk)
        else:
            from vsacli.cli.drawings import compute_and_draw

            report = compute_and_draw(run, figures, run_stem(robot, trajectory), outputs, talk)
        found = None
        if list_fixes or output is not None:
            from vsacli.studies.search import fixes

            progress = partial(talk.progress, shown_from=0, label="searching")
            found = fixes(*inputs, min_margin, progress=progress)
        written = found is not None and _write_fix(found, number, output, outputs, talk)
    talk.wrote(outputs)
    if found is None or not written or EXIT_OF_VERDICT[report.verdict] == Exit.BUG:
        return show_report(report, as_json, (robot, trajectory), changes, found, options)
    if as_json:
        show_report(report, as_json, (robot, trajectory), changes, found)
    else:
        say_text(str(found))  # the report was read before this fix was chosen
    return Exit.OK if all(cause.fixable for cause in found.causes) else Exit.VERDICT


def _check_fix_options(number: int | None, output: str | None, changes: tuple[str, ...]) -> None:
    """Refuse `--write-fix` without `-o`, the reverse, and both with `--set`."""
    if number is not None and output is None:
        raise click.UsageError(f"--write-fix {number} needs -o FILE, the trajectory file to write")
    if output is not None and number is None:
        raise click.UsageError("-o FILE needs --write-fix N, the number of a fix as --fixes lists it")
    if changes and output is not None:
        raise click.UsageError("--write-fix starts from the files as they are; change them instead of --set")


def _write_fix(found: Fixes, number: int | None, path: str | None, outputs: Outputs, talk: Talk) -> bool:
    """Write the fix with this number, and print the name of the file; return whether there is such a fix."""
    if number is None or path is None:
        return False
    from vsacli.studies.search import write_fixed

    if number <= len(found.fixes):
        write_fixed(found.fixes[number - 1], path, outputs)
        talk.note(f"fix {number} goes to {path}")
        return True
    if not found.needed:
        reason = "nothing needs to change"
    elif not found.fixes:
        reason = "nothing that was tried fixes the task"
    else:
        count = len(found.fixes)
        there = f"are {count} fixes" if count > 1 else "is 1 fix"
        choice = joined(map(str, range(1, count + 1)), "or")
        reason = f"there {there}, no fix {number}; give --write-fix {choice}"
    talk.note(f"{path} is not written: {reason}")
    return False
