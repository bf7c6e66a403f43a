"""`vsacli new`: commented robot, trajectory and study files as a starting point."""

from __future__ import annotations

import itertools
import os
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click
from click.shell_completion import CompletionItem
from click.types import StringParamType

from vsacli.actuators.kinds import ACTUATORS, kind_and_mechanism, mechanisms_of
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.storage import STANDARD
from vsacli.base.texts import counted
from vsacli.cli.command_parts import (
    example,
    load_inputs,
    overwrite_option,
    read_robot,
    robot_argument,
    trajectory_argument,
)
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FILE, YAML_FILE
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import Numbers
from vsacli.files.device_actuators import DEVICES

_output_option = click.option(
    "-o", "--output", type=YAML_FILE, help="File to write.", show_default="standard output"
)


@click.group(
    "new",
    epilog=example("vsacli new robot --joints RR"),
)
def new() -> None:
    """Create a commented robot, trajectory or study file as a starting point."""


class _JointOption(NamedTuple):
    """A joint as given by `--joint`."""

    name: str
    actuator: str


class _ActuatorType(StringParamType):
    """`KIND`, `KIND:MECHANISM` or a device, with shell completion."""

    name = "actuator"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        if (device := value.lower().replace("-", "_")) in DEVICES:
            return device
        try:
            kind_and_mechanism(value)
        except InputError as error:
            from vsacli.base.did_you_mean import did_you_mean  # loaded for error messages only

            devices = did_you_mean(device, DEVICES)
            self.fail(f"{error}{devices if 'did you mean' in devices else ''}", param, ctx)
        return value

    def shell_complete(
        self, _context: click.Context, _parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete names of kinds, mechanisms and devices."""
        with_mechanism = (f"{kind}:{mechanism}" for kind in ACTUATORS for mechanism in mechanisms_of(kind))
        names = (*ACTUATORS, *MECHANISMS, *with_mechanism, *DEVICES)
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]


class _JointType(_ActuatorType):
    """`NAME:KIND`, `NAME:KIND:MECHANISM` or `NAME:DEVICE`."""

    name = "joint"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        if isinstance(value, _JointOption):
            return value
        name, colon, actuator = value.partition(":")
        if not (name and colon and actuator):
            expected = "expected NAME:KIND, NAME:KIND:MECHANISM or NAME:DEVICE, e.g. elbow:serial:lever"
            self.fail(f"{expected}, found {value!r}", param, ctx)
        from vsacli.documents.fields import Text
        from vsacli.documents.record_checks import fault_of

        if fault := fault_of(Text(identifier=True), name):
            self.fail(f"the name {fault}", param, ctx)
        return _JointOption(name, super().convert(actuator, param, ctx))

    def shell_complete(
        self, context: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the actuator behind the name."""
        name, colon, actuator = incomplete.partition(":")
        completions = super().shell_complete(context, parameter, actuator) if colon else []
        return [CompletionItem(f"{name}:{completion.value}") for completion in completions]


@new.command(
    "robot",
    short_help="Write a robot file with given joints.",
    epilog=example(
        "vsacli new robot --joints RRP -o arm.yaml",
        "vsacli new robot --joint base:rigid --joint elbow:serial:lever -o mixed.yaml",
        "vsacli new robot --joint mcp:qbmove --length 0.07 --mass 0.03 -o finger.yaml",
    ),
)
@click.option(
    "--joints",
    metavar="LETTERS",
    help="Types of the joints from the base to the tip, a letter for each: R (revolute) or P (prismatic), "
    "e.g. RRP. Their names are those of --joint.",
    show_default="R for each --joint",
)
@click.option(
    "--actuator",
    metavar="KIND[:MECHANISM]|DEVICE",
    type=_ActuatorType(),
    help="Actuator of every joint, as in --joint.",
    show_default="antagonistic",
)
@click.option(
    "--joint",
    "chosen",
    metavar="NAME:KIND[:MECHANISM]|NAME:DEVICE",
    type=_JointType(),
    multiple=True,
    help="Name and actuator of one joint, from the base to the tip; may be repeated. "
    f"KIND: {', '.join(ACTUATORS)}. MECHANISM: of serial actuators {', '.join(MECHANISMS)}; of antagonistic "
    "and elastic ones a spring law such as cubic, sinh or table (docs/springs.md). DEVICE: one of "
    f"docs/devices.md, {', '.join(DEVICES)}.",
)
@click.option(
    "--length",
    "lengths",
    metavar="METERS",
    type=Numbers("lengths in m, one for all links or one for each, e.g. 0.045,0.03", positive=True),
    help="Length of all links, or of each, separated by commas, in m. Axes are then parallel and horizontal, "
    "and actuators fit the load.",
    show_default="0.3, shorter towards the tip",
)
@click.option(
    "--mass",
    "masses",
    metavar="KG",
    type=Numbers("masses in kg, one for all links or one for each, e.g. 0.025,0.015", positive=True),
    help="Mass of all links, or of each, separated by commas, in kg; with the effects of --length.",
    show_default="2, lighter towards the tip; with --length that of similar links",
)
@_output_option
@overwrite_option
@talk_options
def robot(
    joints: str | None,
    actuator: str | None,
    chosen: tuple[_JointOption, ...],
    lengths: tuple[float, ...] | None,
    masses: tuple[float, ...] | None,
    output: str | None,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Write a robot file with these joints, to be edited.

    Give --joints for joints with equal actuators, or --joint once for each joint of a mixed arm. These
    are revolute, unless --joints has a letter for each as well.

    The file is complete and can be used as it is; tables that it refers to are written next to it. Each key
    has a comment where it occurs first, also on where to find its value, and optional keys are commented
    out. Reports mark its springs and motors as placeholders until the key `placeholder` is removed.
    """
    from vsacli.files.examples import tables_named_in
    from vsacli.files.robot_template import LinkSizes, load_template, robot_template

    letters = _letters(joints, actuator, chosen)
    for option, sizes in {"--length": lengths, "--mass": masses}.items():
        if sizes is not None and len(sizes) not in (1, len(letters)):
            counts_text = f"{counted(len(letters), 'joint')}, but {counted(len(sizes), 'value')}"
            raise click.UsageError(f"{option}: {counts_text}; give one value for all links or one for each")
    with naming_option("--joint" if joints is None else "--joints"):
        text = robot_template(
            letters,
            [joint_option.actuator for joint_option in chosen] or actuator or "antagonistic",
            [joint_option.name for joint_option in chosen],
            sizes=LinkSizes(lengths or (), masses or ()),
        )
    _write_template(text, output, overwrite, talk, tables=tables_named_in(text))
    if lengths or masses:  # the first warning is about these, others about what was computed from them
        located = (problem for problem in load_template(text).located_warnings if problem.line)
        for problem in itertools.islice(located, 1):
            talk.note(f"warning: {problem._replace(file=_quoted_path(output, 'arm.yaml'))}")
    talk.note(f"next: vsacli new trajectory --robot {_quoted_path(output, 'arm.yaml')} -o move.yaml")


def _letters(joints: str | None, actuator: str | None, chosen: Sequence[_JointOption]) -> str:
    """Return the letter of each joint.

    Raises:
        click.UsageError: options are missing, or contradict each other.
    """
    if not chosen:
        if joints is None:
            raise click.UsageError("give --joints, e.g. --joints RRP, or --joint for each joint")
        return joints
    if actuator is not None:
        raise click.UsageError(
            "--actuator is that of every joint, but --joint names one for each joint; leave out one of both"
        )
    names = Counter(joint_option.name for joint_option in chosen)
    if repeated_names := [name for name, count in names.items() if count > 1]:
        raise click.UsageError(
            f"--joint: the name {repeated_names[0]!r} is given twice; each joint has its own"
        )
    if joints is not None and len(joints) != len(chosen):
        letters, times_text = counted(len(joints), "letter"), counted(len(chosen), "time")
        raise click.UsageError(
            f"--joints has {letters}, but --joint is given {times_text}; give a letter for each --joint, or "
            "leave out --joints if all are revolute"
        )
    return joints or "R" * len(chosen)


@new.command(
    "trajectory",
    short_help="Write a trajectory file for a robot.",
    epilog=example("vsacli new trajectory --robot robots/rp_2.yaml -o move.yaml"),
)
@click.option(
    "--robot",
    "robot_path",
    type=FILE,
    help="Robot that will execute the trajectory.",
    show_default="a new robot with revolute joints",
)
@_output_option
@overwrite_option
@talk_options
def trajectory(robot_path: str | None, output: str | None, overwrite: bool, talk: Talk) -> None:
    """Write a trajectory file, to be edited: a motion from rest to rest with continuous motor torques.

    Its values suit the joints, limits and springs of the robot; without --robot, those of a new robot with
    revolute joints.
    """
    from vsacli.files.templates import trajectory_template

    robot = None if robot_path is None else read_robot(robot_path, argument="--robot")
    inputs = () if robot is None else [source.path for source in robot.sources]
    _write_template(trajectory_template(robot), output, overwrite, talk, inputs)
    talk.note(
        f"next: vsacli invdyn {_quoted_path(robot_path, 'arm.yaml')} {_quoted_path(output, 'move.yaml')}"
    )


@new.command(
    "study",
    short_help="Write a study file for a robot and a trajectory.",
    epilog=example("vsacli new study robots/vsa_3r.yaml trajectories/rest_to_rest.yaml -o study.yaml"),
)
@robot_argument
@trajectory_argument
@_output_option
@overwrite_option
@talk_options
def study(robot: str, trajectory: str, output: str | None, overwrite: bool, talk: Talk) -> None:
    """Write a study file, to be edited: many runs of ROBOT and TRAJECTORY with varied values.

    It varies the first stiffness of the springs by 20 % either way, and the duration if the trajectory gives
    it. Paths in the file are relative to its folder.
    """
    from vsacli.files.study_template import study_template

    inputs = load_inputs(robot, trajectory, talk)
    folder = Path(output).parent if output not in (None, STANDARD) else Path()
    paths = (Path(os.path.relpath(path, folder)).as_posix() for path in (robot, trajectory))
    _write_template(
        study_template(inputs.robot, inputs.trajectory, *paths), output, overwrite, talk, inputs.files
    )
    talk.note(f"next: vsacli study {_quoted_path(output, 'study.yaml')}")


def _quoted_path(path: str | None, default: str) -> str:
    """Return a path as a word of a shell command; the usual one for a standard stream."""
    return shlex.quote(default if path is None or path == STANDARD else path)


def _write_template(
    text: str,
    output: str | None,
    overwrite: bool,
    talk: Talk,
    inputs: Iterable[str] = (),
    tables: Iterable[Path] = (),
) -> None:
    """Write the text, and copies of these tables next to the file; standard output gets the text alone."""
    if output is None or output == STANDARD:
        click.echo(text, nl=False)
        return
    with Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        outputs.file(output).write_text(text)
        for table in tables:
            outputs.file(Path(output).parent / table.name).write_bytes(table.read_bytes())
    talk.wrote(outputs)
