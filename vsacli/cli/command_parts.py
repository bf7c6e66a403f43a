"""Parts shared by commands: arguments and options, loading of inputs, runs, and the printed report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import wraps
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from vsacli.base.errors import InputError
from vsacli.base.storage import STANDARD
from vsacli.cli.console import EXIT_OF_VERDICT, Exit, Talk, say_json, say_text
from vsacli.cli.file_names import FILE
from vsacli.cli.input_errors import naming_changes, naming_kind
from vsacli.cli.option_types import SEED, Whole, Words

if TYPE_CHECKING:
    from vsacli.analysis.report import Report
    from vsacli.analysis.run import Run
    from vsacli.documents.reading import Changes
    from vsacli.results.store.reader import StoredResult
    from vsacli.results.store.writer import ResultWriter
    from vsacli.robot.model import Robot
    from vsacli.studies.search import Fixes
    from vsacli.trajectory.trajectory import Trajectory


def words_of(example: str) -> Callable[..., tuple[str, ...] | None]:
    """Return a click callback that splits a text such as the example at its commas."""

    def words(_context: click.Context, _parameter: click.Parameter, text: str | None) -> Any:
        if text is None:
            return None
        names = tuple(name.strip() for name in text.split(",") if name.strip())
        if not names:
            raise click.BadParameter(f"expected names separated by commas, e.g. {example}")
        return names

    return words


def variables_option(default: str, further: str = "") -> Callable[[Any], Any]:
    """Return the option `--variables`; its help gives `default` as its default, and a `further` clause."""
    return click.option(
        "--variables",
        metavar="NAMES",
        callback=words_of("tau_motor,flags"),
        help=f"Write only these variables, separated by commas, e.g. tau_motor,flags{further}.",
        show_default=default,
    )


def example(*commands: str) -> str:
    """Return the epilog of a help text: command lines that work."""
    return "\n  ".join(["\b\nExample:", *commands])


robot_argument = click.argument("robot", type=FILE)
trajectory_argument = click.argument("trajectory", type=FILE)
json_option = click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
overwrite_option = click.option("--overwrite", is_flag=True, help="Replace output files that exist.")
deflection_solver_option = click.option(
    "--deflection-solver",
    type=Words(["root", "ode"]),
    default="root",
    show_default=True,
    help="Method for the deflections: solve for the root at each sample, or integrate an ODE from the "
    "first sample, which drifts.",
)
columns_option = click.option(
    "--columns",
    type=FILE,
    help="YAML file that maps the columns of the recording to signals, and lists columns to ignore; "
    "`vsacli info RECORDING --field mapping` prints one to begin with.",
)
stop_option = click.option("--stop-on-infeasible", is_flag=True, help="Stop at the first infeasible sample.")


set_option = click.option(
    "--set",
    "changes",
    metavar="PATH=VALUE",
    multiple=True,
    help="Override a value of the robot or the trajectory, e.g. joints.*.link.mass=2.5 or duration=3; "
    "may be repeated.",
)


def seed_option(use: str) -> Callable[[Any], Any]:
    """Return the option `--seed` of a command that draws random numbers for a `use`."""
    return click.option(
        "--seed",
        metavar="N",
        type=SEED,
        default=0,
        show_default=True,
        help=f"Seed of the random {use}.",
    )


engine_option = click.option(
    "--engine",
    type=Words(["numpy", "c", "auto"]),
    default="auto",
    show_default=True,
    help="Backend of the computation: NumPy, or compiled C; auto chooses the faster one.",
)


def engine_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options `--engine` and `--threads`, and refuse threads of NumPy."""

    @wraps(command)
    def checked(*args: Any, engine: str, threads: int | None, **kwargs: Any) -> Any:
        if threads is not None and engine == "numpy":
            raise click.UsageError("--threads needs --engine c or auto; NumPy uses one thread")
        return command(*args, engine=engine, threads=threads, **kwargs)

    threads_option = click.option(
        "--threads",
        type=Whole("a number of threads, e.g. 4", least=1),
        metavar="N",
        help="Number of threads of the compiled code.",
        show_default="number of CPU cores",
    )
    return engine_option(threads_option(checked))


class Inputs(NamedTuple):
    """The inputs of a computation: robot and trajectory."""

    robot: Robot
    trajectory: Trajectory

    @property
    def files(self) -> list[str]:
        """Paths of all files that were read."""
        return [source.path for source in (*self.robot.sources, *self.trajectory.sources)]


def load_inputs(
    robot_path: str,
    trajectory_path: str,
    talk: Talk,
    changes: tuple[str, ...] = (),
    other_options: Mapping[str, str] = MappingProxyType({}),
) -> Inputs:
    """Read and check both files, with the changes of `--set`.

    Args:
        robot_path: argument ROBOT.
        trajectory_path: argument TRAJECTORY.
        talk: prints details and progress.
        changes: changes, as `--set` gives them.
        other_options: other options from which changes were made, by path; see `naming_changes`.

    Raises:
        InputError: with every problem of the robot, or else of the trajectory; or a change that cannot be
            made.
    """
    if robot_path == trajectory_path == STANDARD:
        reason = "ROBOT and TRAJECTORY are both '-', but standard input can be read only once"
        raise InputError.one(f"{reason}; give a file name for one of them")
    with naming_changes(other_options):
        robot_changes, trajectory_changes = _divide_changes(changes)
        robot = read_robot(robot_path, robot_changes)
        trajectory = read_trajectory(trajectory_path, robot, trajectory_changes, talk)
    talk.detail(
        f"{robot.name}: {len(robot.joints)} joints; {trajectory.name}: {trajectory.samples} samples over "
        f"{trajectory.duration:g} s"
    )
    return Inputs(robot, trajectory)


def read_robot(path: str, changes: Changes | None = None, *, argument: str = "ROBOT") -> Robot:
    """Read the robot file of an argument, ROBOT if nothing else is said.

    Raises:
        InputError: every problem of the file; or what it is, if it is no robot.
    """
    from vsacli.robot.file import load_robot

    with naming_kind(argument, path, ("robot",)):
        return load_robot(path, changes or {})


def read_trajectory(path: str, robot: Robot, changes: Changes | None, talk: Talk) -> Trajectory:
    """Read the trajectory file of an argument TRAJECTORY, with a progress bar over fits.

    Raises:
        InputError: every problem of the file; or what it is, if it is no trajectory.
    """
    from vsacli.trajectory.file import load_trajectory

    with naming_kind("TRAJECTORY", path, ("trajectory", "table")):
        return load_trajectory(path, robot, changes or {}, progress=talk.fitting)


def _divide_changes(changes: tuple[str, ...]) -> tuple[Changes, Changes]:
    """Return the changes that concern the robot, and those that concern the trajectory."""
    if not changes:
        return {}, {}
    from vsacli.documents.reading import read_changes
    from vsacli.trajectory.changes import divide_changes_by_file

    return divide_changes_by_file(read_changes(changes))


def compute(run: Run, talk: Talk, writer: ResultWriter | None = None) -> Report:
    """Run block by block; a writer receives each block when it is computed, and the report at the end."""
    talk.detail(run.choice.reason)
    with writer or nullcontext(), talk.progress(run.trajectory.samples) as progress:
        for block in run:
            if writer is not None:
                writer.write(block)
            progress.update(len(block.time))
            del block  # else it stays in memory while the next one is computed
        report = run.report()
        if writer is not None:
            writer.finish(report.as_json())
    return report


def run_stem(robot_path: str, trajectory_path: str) -> str:
    """Return the default beginning of the names of output files."""
    stems = ("stdin" if path == STANDARD else Path(path).stem for path in (robot_path, trajectory_path))
    return "-".join(stems)


def result_line(result: StoredResult) -> str:
    """Return a summary of a result file on one line, for `--verbose`."""
    names = f"{result.robot_name}, {result.trajectory_name}"
    return f"{result.path}: {names}, {result.samples} samples, {result.verdict}"


MOST_CHANGES = 3
"""Options `--set` that a command in a report repeats at most."""

FIXABLE = ("infeasible", "singular", "over_limit")
"""Verdicts for which fixes are searched."""


def show_report(
    report: Report,
    as_json: bool,
    files: tuple[str, str],
    changes: Sequence[str],
    fixes: Fixes | None = None,
    options: Sequence[str] = (),
) -> Exit:
    """Print the report, with fixes if there are any; the exit code follows from the verdict.

    Without fixes, the report says which command lists them.

    Args:
        report: the report.
        as_json: whether to print it as JSON.
        files: paths of robot and trajectory.
        changes: changes to these, as `--set` gave them.
        fixes: fixes, if they were searched.
        options: further options that the search for fixes needs.
    """
    if as_json:
        extra = {} if fixes is None else {"fixes": fixes.as_json()}
        say_json({**report.as_json(), **extra})
    else:
        hint = _hint(report, files, changes, options) if fixes is None else ""
        texts = [report.as_text(hint), *([] if fixes is None else [fixes])]
        say_text("\n\n".join(map(str, texts)), report.verdict)
    return EXIT_OF_VERDICT[report.verdict]


def _hint(report: Report, files: tuple[str, str], changes: Sequence[str], options: Sequence[str]) -> str:
    """Return how to list fixes of a motion that cannot be executed; empty if it can."""
    if report.verdict not in FIXABLE or STANDARD in files:
        return ""  # standard input has been read, and cannot be read again
    repeated_changes = changes if len(changes) <= MOST_CHANGES else ()
    arguments = [
        *files,
        *(word for change in repeated_changes for word in ("--set", change)),
        *options,
        "--fixes",
    ]
    other_changes = "" if repeated_changes == changes else ", with the same --set options"
    return f"to list fixes{other_changes}: vsacli check-feasibility {shlex.join(arguments)}"
