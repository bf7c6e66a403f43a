"""`vsacli size`: requirements on motors, gears and springs, and motors chosen from a catalog."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
    example,
    json_option,
    overwrite_option,
    read_robot,
    read_trajectory,
    robot_argument,
    run_stem,
)
from vsacli.cli.console import EXIT_OF_VERDICT, Talk, say, talk_options
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import FILE, YAML_FILE
from vsacli.cli.input_errors import naming_kind, naming_option
from vsacli.cli.option_types import Words

if TYPE_CHECKING:
    from vsacli.results.plots import TorqueSpeed
    from vsacli.studies.sizing import MotorSizing, Sizing


@click.command(
    "size",
    epilog=example("vsacli size robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --catalog motors.csv"),
)
@robot_argument
@click.argument("trajectories", nargs=-1, required=True, metavar="TRAJECTORY...", type=FILE)
@click.option(
    "--catalog",
    type=FILE,
    help="CSV file of motors to choose from.",
    show_default="the robot's own motors",
)
@click.option(
    "--gear",
    "gears",
    metavar="[JOINT=]RATIOS",
    multiple=True,
    help="Gear ratios to consider, e.g. 50,80,100 or 30..160, or for one joint slide=500..3000; may "
    "be repeated.",
    show_default="any",
)
@click.option(
    "--minimize",
    type=Words(["copper_loss", "utilization", "mass"]),
    help="Objective of the choice: copper loss of the windings, utilization (largest share of a "
    "limit), or mass.",
    show_default="copper_loss if the catalog permits, else utilization",
)
@click.option("-o", "--output", type=YAML_FILE, help="Write the robot file with the chosen motors.")
@figure_options("--plot", purpose="Save a figure of torque over speed in this folder.")
@json_option
@overwrite_option
@talk_options
def size(
    robot: str,
    trajectories: tuple[str, ...],
    catalog: str | None,
    gears: tuple[str, ...],
    minimize: str | None,
    output: str | None,
    figures: FigureTarget | None,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Compute the torque, speed and power that TRAJECTORIES require of ROBOT, and select its motors.

    Peaks are the largest of all trajectories. Root mean squares are over all trajectories, one after the
    other, as a cycle that repeats. Motors are compared with their limits of peak and continuous torque or
    current, speed and voltage.

    Exit code 3 if no choice meets the requirements of a motor, or if infeasible samples were ignored.
    """
    if catalog is None:
        for option, value in {"--output": output, "--gear": gears, "--minimize": minimize}.items():
            if value:
                raise click.UsageError(f"{option} needs --catalog FILE, the motors to choose from")
    from vsacli.studies.sizing import size_drives, sized_text
    from vsacli.studies.sizing.ratios import gears_of_joints

    robot_model = read_robot(robot)
    motions = [read_trajectory(path, robot_model, None, talk) for path in trajectories]
    with naming_option("--gear"):
        gears_of_joints(gears, robot_model.joint_names)
    sources = [*robot_model.sources, *(source for motion in motions for source in motion.sources)]
    inputs = [*(source.path for source in sources), *([] if catalog is None else [catalog])]
    with Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        if output is not None:
            outputs.check(output)
        samples = sum(motion.samples for motion in motions)
        kind = naming_kind("--catalog", catalog, ("motor catalog",))
        with kind, talk.progress(samples) as progress:
            sizing = size_drives(robot_model, motions, catalog, gears, minimize, progress=progress.update)
        if output is not None and sizing.lacking:
            talk.note(f"{output} is not written: there is no motor for {sizing.lacking[0].name}")
        elif output is not None:
            outputs.file(output).write_text(sized_text(robot_model, sizing, Path(output).parent))
        if figures is not None:
            _draw_torque_speed(sizing, figures, run_stem(robot, trajectories[0]), outputs, talk)
    say(sizing, as_json)
    talk.wrote(outputs)
    return EXIT_OF_VERDICT[sizing.verdict]


def _draw_torque_speed(sizing: Sizing, target: FigureTarget, stem: str, outputs: Outputs, talk: Talk) -> None:
    """Draw torque over speed for every motor with feasible samples."""
    motors = [_torque_speed(motor) for motor in sizing.motors if motor.points is not None]
    if not motors:
        talk.note("nothing is drawn: no sample is feasible")
        return
    from vsacli.results.plots import torque_speed_figure

    files = target.files(["torque-speed"], stem, outputs)
    files.save({"torque-speed": torque_speed_figure(motors, f"sizing of motors: {sizing.title}")})


def _torque_speed(motor: MotorSizing) -> TorqueSpeed:
    from vsacli.results.plots import MotorLimits, TorqueSpeed

    points, shaft = motor.points, motor.shaft
    assert points is not None, "as of every motor of which something is known"
    assert shaft is not None, "likewise"
    runs = {
        name: (points.velocities[motor.demand.run == index], points.torques[motor.demand.run == index])
        for index, name in enumerate(motor.demand.trajectories)
    }
    constants = {name: getattr(shaft, name) for name in MotorLimits._fields}
    rms = points.rms_velocity, points.rms_torque
    name = f"{motor.joint}, motor {motor.motor}"
    return TorqueSpeed(name, motor.drive, *motor.units, MotorLimits(**constants), runs, rms)
