"""`vsacli simulate`: integrate the full dynamics under a controller."""

from __future__ import annotations

import json
import shlex
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
    Inputs,
    engine_option,
    example,
    json_option,
    load_inputs,
    overwrite_option,
    robot_argument,
    run_stem,
    set_option,
    trajectory_argument,
)
from vsacli.cli.console import Exit, Talk, say, talk_options
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import FILE, HDF5_FILE
from vsacli.cli.input_errors import naming_kind, naming_option
from vsacli.cli.option_types import SEED, SENSOR_NOISE, SHARE, Number, Numbers, Whole, Words

if TYPE_CHECKING:
    from vsacli.base.variables import Variable
    from vsacli.control.gains import Gains
    from vsacli.control.simulation import InitialError, Sensors, SimulationRun
    from vsacli.control.simulation.simulation_report import SimulationReport
    from vsacli.results.plots import FigureFiles
    from vsacli.results.store.derived_files import SimulationWriter
    from vsacli.robot.model import Robot

PROGRESS_STEPS = 1000
FEEDBACK_LINEARIZATION = "feedback-linearization"

_UNREAD_SENSORS = (
    "--sensor-noise and --encoder-bits affect the stored measurements only; with --feedback positions the "
    "controller uses them"
)


class Options(NamedTuple):
    """Options of the simulation, as on the command line."""

    controller: str
    poles: str | None
    stiffness_poles: str | None
    integral: bool
    initial_error: tuple[float, ...]
    initial_stiffness_error: tuple[float, ...]
    perturb: float
    sensor_noise: tuple[float, ...] | None
    encoder_bits: int | None
    seed: int
    feedback: Any
    goal_tolerance: str
    rtol: float
    atol: float
    budget: int | None


@click.command(
    "simulate",
    epilog=example("vsacli simulate robots/vsa_3r.yaml trajectories/rest_to_rest.yaml --goal-tolerance 2%"),
)
@robot_argument
@trajectory_argument
@set_option
@click.option(
    "--controller",
    type=Words(["feedforward", FEEDBACK_LINEARIZATION]),
    default="feedforward",
    show_default=True,
    help="Controller that computes the motor torques.",
)
@click.option(
    "--poles",
    metavar="POLES",
    type=FILE,
    help="Poles of the position error in 1/s, e.g. -20,-21,-10+5j,-10-5j, one number for all, or a "
    "YAML file with the poles of each joint.",
    show_default="-20",
)
@click.option(
    "--stiffness-poles",
    metavar="POLES",
    type=FILE,
    help="Poles of the stiffness error in 1/s, in the form of --poles.",
    show_default="-20",
)
@click.option(
    "--integral", is_flag=True, help="Add integral action, which requires one more pole for each error."
)
@click.option(
    "--initial-error",
    metavar="RAD",
    default="0",
    type=Numbers("a value in rad (m), or one for each joint, e.g. 0.01,0,-0.02"),
    help="Initial position error in rad (m): one value for all joints, or one for each, separated by commas.",
    show_default=True,
)
@click.option(
    "--initial-stiffness-error",
    metavar="NM/RAD",
    default="0",
    type=Numbers("a value in N m/rad (N/m), or one for each joint, e.g. 10,0,-20"),
    help="Initial stiffness error in N m/rad (N/m), in the form of --initial-error.",
    show_default=True,
)
@click.option(
    "--perturb",
    type=SHARE,
    default=0.0,
    help="Largest relative error of each parameter of the controller's model, e.g. 5%.",
    show_default="0%",
)
@click.option(
    "--sensor-noise",
    metavar="RAD[,NM]",
    type=SENSOR_NOISE,
    help="Standard deviation of measured positions in rad and of measured motor torques in N m, e.g. "
    "2e-5,0.5; adds q_measured, theta_measured and tau_motor_measured to the result. The controller uses "
    "measured positions only with --feedback positions.",
)
@click.option(
    "--encoder-bits",
    metavar="N",
    type=Whole("a number of bits, e.g. 16", least=1),
    help="Resolution of the encoders: 2^N steps per turn of the joint or of the motor shaft; adds "
    "q_measured and theta_measured to the result. The controller uses them only with --feedback positions.",
)
@click.option(
    "--seed",
    metavar="N",
    type=SEED,
    default=0,
    show_default=True,
    help="Seed of the random model errors and sensor noise.",
)
@click.option(
    "--feedback",
    type=Words(["state", "positions"]),
    default="state",
    show_default=True,
    help="Feedback of the controller: the full state, or sampled positions with filtered differences "
    "as velocities.",
)
@click.option(
    "--goal-tolerance",
    metavar="SHARE|RAD",
    default="1%",
    show_default=True,
    help="Largest position error at the end: a share of the range of each joint, plus 1e-3 rad (m), "
    "or a number in rad (m).",
)
@click.option(
    "--rtol",
    type=Number("a relative tolerance, e.g. 1e-9", positive=True),
    default=1e-9,
    show_default=True,
    help="Relative tolerance of the integrator.",
)
@click.option(
    "--atol",
    type=Number("an absolute tolerance in rad (m), e.g. 1e-10", positive=True),
    default=1e-10,
    show_default=True,
    help="Absolute tolerance of the integrator.",
)
@click.option(
    "--budget",
    metavar="N",
    type=Whole("a number of evaluations, e.g. 200000", least=1),
    help="Maximum number of evaluations of the equations of motion; a run that needs more ends incomplete.",
    show_default="200000, or 100 per sample if larger",
)
@click.option(
    "-o",
    "--output",
    type=HDF5_FILE,
    help="Simulation file to write.",
    show_default="ROBOT-TRAJECTORY-simulation.h5 in the current folder",
)
@figure_options("--plot", purpose="Save the figures of `vsacli plot` in this folder as well.")
@json_option
@overwrite_option
@engine_option
@talk_options
def simulate(
    robot: str,
    trajectory: str,
    changes: tuple[str, ...],
    output: str | None,
    figures: FigureTarget | None,
    as_json: bool,
    overwrite: bool,
    engine: str,
    talk: Talk,
    **choices: Any,
) -> int:
    """Simulate the full dynamics of ROBOT while a controller makes it follow TRAJECTORY.

    Writes an HDF5 file with simulated and commanded motion, and prints a report of the errors. Motor torques
    saturate at max_torque. A run ends early where a decoupling matrix becomes singular or a spring leaves the
    range of its law.
    """
    path = Path(f"{run_stem(robot, trajectory)}-simulation.h5" if output is None else output)
    inputs = load_inputs(robot, trajectory, talk, changes)
    simulation = _prepare_simulation(inputs, Options(**choices))
    gains: Gains | None = simulation.keywords["gains"]
    if gains is not None:  # the result stores the poles file as one of its inputs
        robot_with_gains = replace(inputs.robot, sources=(*inputs.robot.sources, *gains.sources))
        inputs = inputs._replace(robot=robot_with_gains)
    from vsacli.results.store.derived_files import SimulationWriter

    has_sensors = simulation.keywords["sensors"] is not None
    if has_sensors and choices["feedback"] == "state":
        talk.note(_UNREAD_SENSORS)
    with Outputs(overwrite=overwrite, inputs=inputs.files) as outputs:
        file = outputs.file(path)
        figure_files = figures and _staged_figures(inputs.robot, figures, path.stem, outputs)
        run = simulation(engine=engine, tell=talk.note)
        provenance = {
            "command_line": shlex.join(["vsacli", *sys.argv[1:]]),
            "options": json.dumps(choices),
            **run.provenance,
        }
        writer = SimulationWriter(file, *inputs, sensed=has_sensors, provenance=provenance)
        report = _run(run, talk, writer)
        if figure_files is not None:
            from vsacli.cli.drawings import draw_staged

            draw_staged(file, figure_files, talk)
    say(report, as_json)
    talk.wrote(outputs)
    return Exit.OK if report.verdict == "ok" else Exit.VERDICT


def _staged_figures(robot: Robot, target: FigureTarget, stem: str, outputs: Outputs) -> FigureFiles:
    from vsacli.results.charts.figures import simulation_drawings

    def drawn(variable: Variable) -> bool:
        return robot.has_variable(variable) and any(
            any(joint.has_columns(variable)) for joint in robot.joints
        )

    return target.files(simulation_drawings(drawn), stem, outputs)


def _prepare_simulation(inputs: Inputs, options: Options) -> partial[SimulationRun]:
    from vsacli.control.simulation import (
        GoalTolerance,
        SimulationRun,
        Tolerances,
        check_feedback,
        perturbed,
    )

    gains = _gains(inputs.robot, options)
    with naming_option("--feedback"):
        check_feedback(options.feedback, gains)
    with naming_option("--perturb"):
        model = perturbed(inputs.robot, options.perturb, options.seed)
    with naming_option("--goal-tolerance"):
        goal_tolerance = GoalTolerance.from_text(options.goal_tolerance)
    with naming_option("--rtol"):
        Tolerances(options.rtol)
    with naming_option("--atol"):
        tolerances = Tolerances(options.rtol, options.atol)
    return partial(
        SimulationRun,
        *inputs,
        gains=gains,
        model=model,
        initial_error=_initial_error(inputs, options),
        feedback=options.feedback,
        sensors=_sensors(options),
        goal_tolerance=goal_tolerance,
        tolerances=tolerances,
        budget=options.budget,
    )


def _initial_error(inputs: Inputs, options: Options) -> InitialError:
    """Return the error of the initial state, after a check that the robot can start there."""
    from vsacli.control.simulation import InitialError
    from vsacli.control.simulation.start import start_state

    position_error = InitialError(options.initial_error)
    error = replace(position_error, stiffness=options.initial_stiffness_error)
    errors_by_option = {
        "--initial-error": (options.initial_error, position_error),
        "--initial-stiffness-error": (options.initial_stiffness_error, error),
    }
    for option, (values, state) in errors_by_option.items():
        if values != (0.0,):
            with naming_option(option):
                start_state(*inputs, state)
    return error


def _sensors(options: Options) -> Sensors | None:
    from vsacli.control.simulation import Sensors

    if options.sensor_noise is None and options.encoder_bits is None:
        return None
    position, torque, *_ = (*(options.sensor_noise or ()), 0.0, 0.0)
    with naming_option("--sensor-noise"):
        Sensors(position, torque)
    with naming_option("--encoder-bits"):
        return Sensors(position, torque, options.encoder_bits, options.seed)


def _gains(robot: Robot, options: Options) -> Gains | None:
    """Return the gains of feedback linearization; None for another controller."""
    from vsacli.control.poles import DEFAULT, gains_from_text, load_gains

    poles, stiffness_poles, integral = options.poles, options.stiffness_poles, options.integral
    if options.controller != FEEDBACK_LINEARIZATION:
        for option, value in {
            "poles": poles,
            "stiffness-poles": stiffness_poles,
            "integral": integral,
        }.items():
            if value:
                raise click.UsageError(f"--{option} needs --controller {FEEDBACK_LINEARIZATION}")
        return None
    if poles is not None and poles.endswith((".yaml", ".yml")):
        if stiffness_poles is not None:
            raise click.UsageError(
                f"--poles {poles} holds the poles of both errors; leave out --stiffness-poles"
            )
        with naming_kind("--poles", poles, ("poles",)):
            return load_gains(poles, robot, integral=integral)
    with naming_option("--poles"):
        gains = gains_from_text(robot, poles or DEFAULT, DEFAULT, integral=integral)
    if stiffness_poles is None:
        return gains
    with naming_option("--stiffness-poles"):
        return gains_from_text(robot, poles or DEFAULT, stiffness_poles, integral=integral)


def _run(run: SimulationRun, talk: Talk, writer: SimulationWriter) -> SimulationReport:
    """Simulate and write block by block, with a progress bar over simulated time."""
    first, last = run.trajectory.times.span
    with writer, talk.progress(PROGRESS_STEPS, shown_from=0) as bar:

        def progress(time: float) -> None:
            bar.update(int(PROGRESS_STEPS * (time - first) / (last - first)) - bar.pos)

        run.progress = progress
        for block in run:
            writer.write(block)
            del block  # else it stays in memory while the next one is computed
        talk.detail(_computed_by(**run.provenance))
        report = run.report()
        writer.finish(report.as_json(), run.provenance)
    return report


def _computed_by(engine: str, compiler: str, **_further: str) -> str:
    """Return a clause about the backend that evaluated the equations of motion."""
    return f"C code computed, compiled by {compiler}" if engine == "c" else "NumPy and Python computed"
