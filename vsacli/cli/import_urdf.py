"""`vsacli import-urdf`: a robot file from a URDF, all of it or the part before chosen tips."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.errors import InputError, InvalidRecordError
from vsacli.base.outputs import Outputs
from vsacli.base.texts import joined
from vsacli.cli.command_parts import example, overwrite_option
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FILE, YAML_FILE
from vsacli.cli.input_errors import naming_kind, naming_option
from vsacli.cli.option_types import Number, Numbers, Words
from vsacli.files.device_actuators import DEVICES, OF_DEVICE, check_drives

if TYPE_CHECKING:
    from vsacli.robot.urdf import Conversion


class _DrivesType(Words):
    """A kind of actuator or a device for every joint, or `JOINT=DEVICE` for one."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """See `click.ParamType.convert`."""
        joint, equals, word = value.rpartition("=")
        if joint and word in ACTUATORS:
            self.fail(f"placeholders have one kind; expected {joint}=DEVICE, found {value!r}", param, ctx)
        return f"{joint}{equals}{super().convert(word.lower().replace('-', '_'), param, ctx)}"


def _check_placeholders(
    actuator: str, motor_inertia: float | None, stiffness: float | None, spring: tuple[float, float] | None
) -> None:
    """Refuse constants that the chosen kind of actuator does not have.

    Raises:
        click.UsageError: with the option, and the one that has an effect.
    """
    for option, value, kinds in (
        ("--spring", spring, ("antagonistic",)),
        ("--stiffness", stiffness, ("elastic", "serial")),
        ("--motor-inertia", motor_inertia, tuple(ACTUATORS)),
    ):
        if value is not None and actuator not in kinds:
            hint = "; for antagonistic joints give --spring" if actuator == "antagonistic" else ""
            raise click.UsageError(f"{option} needs --actuator {joined(kinds, 'or')}, not {actuator}{hint}")


def _held_positions(
    _context: click.Context, _parameter: click.Parameter, assignments: tuple[str, ...]
) -> dict[str, str]:
    positions = {}
    for assignment in assignments:
        joint, equals, value = assignment.rpartition("=")
        if not equals:
            raise click.BadParameter(f"expected JOINT=VALUE, e.g. finger=0.02, found {assignment!r}")
        if joint in positions:
            raise click.BadParameter(f"{joint!r} is held twice")
        positions[joint] = value
    return positions


@click.command(
    "import-urdf",
    epilog=example("vsacli import-urdf robots/desk_arm.urdf --tip flange -o desk_arm.yaml"),
)
@click.argument("urdf", type=FILE)
@click.option(
    "--base", metavar="LINK", help="Link that is fixed to the ground.", show_default="the root link"
)
@click.option(
    "--tip",
    metavar="LINK",
    multiple=True,
    help="Link of an end effector: only joints between the base and it move; may be repeated.",
    show_default="the end of each branch, so that all joints move",
)
@click.option("--srdf", type=FILE, help="SRDF file with a group that names base and tips.")
@click.option(
    "--group", metavar="NAME", help="Name of the group in the SRDF file.", show_default="the only group"
)
@click.option(
    "-o",
    "--output",
    type=YAML_FILE,
    help="Robot file to write.",
    show_default="URDF.yaml in the current folder",
)
@click.option(
    "--actuator",
    metavar="KIND|DEVICE|JOINT=DEVICE",
    type=_DrivesType([*ACTUATORS, *DEVICES]),
    multiple=True,
    show_default="antagonistic",
    help="Actuator of every joint, or of one; may be repeated. KIND, of a placeholder: "
    f"{', '.join(ACTUATORS)}. DEVICE: one of docs/devices.md, {', '.join(DEVICES)}.",
)
@click.option(
    "--motor-inertia",
    metavar="KG_M2",
    type=Number("an inertia in kg m^2 (kg), e.g. 0.1", positive=True),
    help="Placeholder: inertia of each motor in kg m^2 (kg), joint side of the gear.",
    show_default="half the inertia that the joint carries",
)
@click.option(
    "--stiffness",
    metavar="NM/RAD",
    type=Number("a stiffness in N m/rad (N/m), e.g. 300", positive=True),
    help="Placeholder: stiffness of elastic joints in N m/rad (N/m), and middle of the attainable "
    "range of serial ones.",
    show_default="from the load that the joint carries",
)
@click.option(
    "--spring",
    metavar="K,KC",
    type=Numbers("two coefficients k and k_c, e.g. 400,2000", [2]),
    help="Placeholder: coefficients of the cubic springs of antagonistic joints, in N m/rad and N m/rad^3.",
    show_default="from the load that the joint carries",
)
@click.option(
    "--hold",
    metavar="JOINT=VALUE",
    multiple=True,
    callback=_held_positions,
    help="Position of a joint that is held, in rad or m, or with a unit as in elbow='30 deg'; may be "
    "repeated.",
    show_default="0 for joints outside the path to a --tip",
)
@click.option(
    "--snap",
    metavar="RAD",
    type=Number("an angle in rad, e.g. 1e-4", least=0.0, most=0.1),
    default=1e-4,
    show_default=True,
    help="Largest angle, at most 0.1, by which an axis is turned to be parallel to the one before if their "
    "common normal is far away.",
)
@overwrite_option
@talk_options
def import_urdf(
    urdf: str,
    base: str | None,
    tip: tuple[str, ...],
    srdf: str | None,
    group: str | None,
    output: str | None,
    actuator: tuple[str, ...],
    motor_inertia: float | None,
    stiffness: float | None,
    spring: tuple[float, float] | None,
    hold: dict[str, str],
    snap: float,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Convert a URDF to a robot file with standard Denavit-Hartenberg rows.

    All joints below the base move, or only those between the base and each --tip. Links behind fixed or held
    joints are merged with their parent links. The command prints the rows, the elements that were
    ignored or changed, and the largest deviation from the kinematics of the URDF. A URDF does not describe
    motors and springs: the robot file has placeholders, marked as such, which are sized to the load of each
    joint, or those of the devices named by --actuator.
    """
    from vsacli.files.examples import tables_named_in
    from vsacli.robot import urdf as conversions

    if srdf is None and group is not None:
        raise click.UsageError("--group needs --srdf FILE")
    if srdf is not None and (base or tip):
        raise click.UsageError("--srdf names base and tips; leave out --base and --tip")
    words = dict(word.rpartition("=")[::2] for word in actuator)
    word = words.pop("", "antagonistic")
    _check_placeholders(word, motor_inertia, stiffness, spring)
    path = Path(f"{Path(urdf).stem}.yaml" if output is None else output)
    placeholders = conversions.Placeholders(
        word if word in ACTUATORS else "antagonistic", motor_inertia, stiffness, spring
    )
    with Outputs(overwrite=overwrite, inputs=[urdf, *filter(None, [srdf])]) as outputs:
        with naming_kind("URDF", urdf, ("urdf",)):
            file = outputs.file(path)
            with naming_option("--spring", InvalidRecordError):  # constants from the load are valid
                conversion = conversions.import_urdf(urdf, base, tip, placeholders, snap, hold, srdf, group)
        with naming_option("--actuator"):
            conversion = _with_devices(conversion, word, words)
        text = conversions.converted_robot_text(conversion)
        file.write_text(text)
        for table in tables_named_in(text):
            outputs.file(path.parent / table.name).write_bytes(table.read_bytes())
    click.echo(str(conversion))
    talk.wrote(outputs)


def _with_devices(conversion: Conversion, every: str, devices: dict[str, str]) -> Conversion:
    """Return the conversion with the actuators of devices.

    Args:
        conversion: converted robot with placeholders.
        every: device of every other joint; or the kind of their placeholders.
        devices: device of some joints by name.

    Raises:
        InputError: there is no such joint, or a device does not drive it.
    """
    from vsacli.base.did_you_mean import did_you_mean
    from vsacli.files.examples import examples

    robot = conversion.robot
    for unknown in devices.keys() - {*robot.joint_names}:
        raise InputError.one(f"the robot has no joint {unknown!r}{did_you_mean(unknown, robot.joint_names)}")
    bundled = {
        word: examples([DEVICES[word]])[0].robot.joints[-1]
        for word in {every, *devices.values()} & {*DEVICES}
    }
    joints, words = [], {}
    for joint in robot.joints:
        if (word := devices.get(joint.name, every)) in DEVICES:
            words[joint.name] = word
            with naming_option(joint.name):
                check_drives(word, joint.type)
        joints.append(replace(joint, **{key: getattr(bundled.get(word, joint), key) for key in OF_DEVICE}))
    return replace(conversion, robot=replace(robot, joints=tuple(joints)), devices=words)
