"""`vsacli import-urdf`: a robot file from a serial chain of a URDF."""

from __future__ import annotations

from pathlib import Path

import click

from vsacli.actuators.kinds import ACTUATORS
from vsacli.cli.command_parts import example, overwrite_option
from vsacli.cli.console import Talk, talk_options
from vsacli.cli.file_names import FILE, YAML_FILE


def _spring(
    _context: click.Context, _parameter: click.Parameter, written: str | None
) -> tuple[float, float] | None:
    if written is None:
        return None
    try:
        k, k_c = (float(word) for word in written.split(","))
    except ValueError:
        raise click.BadParameter("expected two numbers, k and k_c, e.g. 400,2000") from None
    return k, k_c


def _hold(_context: click.Context, _parameter: click.Parameter, written: tuple[str, ...]) -> dict[str, str]:
    positions = {}
    for word in written:
        joint, equals, value = word.rpartition("=")
        if not equals:
            raise click.BadParameter(f"expected JOINT=VALUE, e.g. finger=0.02, found {word!r}")
        if joint in positions:
            raise click.BadParameter(f"{joint!r} is held twice")
        positions[joint] = value
    return positions


@click.command(
    "import-urdf",
    short_help="Convert a serial chain of a URDF to a robot file.",
    epilog=example("vsacli import-urdf robots/desk_arm.urdf --tip flange -o desk_arm.yaml"),
)
@click.argument("urdf", type=FILE)
@click.option("--base", metavar="LINK", help="Link that stands still; by default the root.")
@click.option("--tip", metavar="LINK", help="Link of the end effector; needed if there is a choice.")
@click.option("--srdf", type=FILE, help="SRDF file, a group of which says base and tip.")
@click.option("--group", metavar="NAME", help="Which group of it; the only one by default.")
@click.option("-o", "--output", type=YAML_FILE, help="Robot file; by default URDF.yaml in this folder.")
@click.option(
    "--actuator",
    type=click.Choice(tuple(ACTUATORS)),
    default="antagonistic",
    show_default=True,
    help="Placeholder: what drives every joint.",
)
@click.option(
    "--motor-inertia",
    metavar="KG_M2",
    type=float,
    help="Placeholder: of each motor, joint side of its gear; by default half of what the joint carries.",
)
@click.option(
    "--stiffness",
    metavar="NM/RAD",
    type=float,
    help="Placeholder: of elastic joints, and in the middle of what serial ones reach; by default as stiff "
    "as what the joint carries asks for.",
)
@click.option(
    "--spring",
    metavar="K,KC",
    callback=_spring,
    help="Placeholder: cubic springs of antagonistic joints; by default likewise.",
)
@click.option(
    "--hold",
    metavar="JOINT=VALUE",
    multiple=True,
    callback=_hold,
    help="Where a joint beside the chain stands, in rad or m, or as in elbow='30 deg'; by default at zero. "
    "May be repeated.",
)
@click.option(
    "--snap",
    metavar="RAD",
    type=click.FloatRange(0, 0.1),
    default=1e-4,
    show_default=True,
    help="Make axes closer to parallel so, if their common normal is far away.",
)
@overwrite_option
@talk_options
def import_urdf(
    urdf: str,
    base: str | None,
    tip: str | None,
    srdf: str | None,
    group: str | None,
    output: str | None,
    actuator: str,
    motor_inertia: float | None,
    stiffness: float | None,
    spring: tuple[float, float] | None,
    hold: dict[str, str],
    snap: float,
    overwrite: bool,
    talk: Talk,
) -> None:
    """Make a robot file with standard Denavit-Hartenberg rows from a serial chain of a URDF.

    Links behind fixed joints, and side branches, which stand still, are lumped with the link they hang on.
    Prints the rows, what was left out or changed, and how far the kinematics deviate from the URDF's. A URDF
    says nothing about motors and springs: these are placeholders, marked in the file and sized to what each
    joint carries.
    """
    from vsacli.base.outputs import Outputs
    from vsacli.robot import urdf as conversions

    if srdf is None and group is not None:
        raise click.UsageError("--group is one of a file that --srdf names")
    if srdf is not None and (base or tip):
        raise click.UsageError("--srdf says base and tip; leave out --base and --tip")
    path = Path(f"{Path(urdf).stem}.yaml" if output is None else output)
    placeholders = conversions.Placeholders(actuator, motor_inertia, stiffness, spring)
    with Outputs(overwrite=overwrite, inputs=[urdf, *filter(None, [srdf])]) as outputs:
        file = outputs.file(path)
        conversion = conversions.import_urdf(urdf, base, tip, placeholders, snap, hold, srdf, group)
        file.write_text(conversions.robot_text(conversion))
    click.echo(str(conversion))
    talk.wrote(outputs)
