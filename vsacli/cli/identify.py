"""`vsacli identify`: robot parameters from recordings; `--plan` is in `identify_plan`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from vsacli.base.outputs import Outputs
from vsacli.cli.command_parts import (
    columns_option,
    example,
    json_option,
    overwrite_option,
    read_robot,
    robot_argument,
    words_of,
)
from vsacli.cli.console import EXIT_OF_VERDICT, Talk, say, talk_options
from vsacli.cli.figure_options import FigureTarget, figure_options
from vsacli.cli.file_names import FILE, YAML_FILE
from vsacli.cli.identify_plan import USUAL_DURATION, plan
from vsacli.cli.input_errors import naming_kind, naming_option
from vsacli.cli.option_types import SEED, SENSOR_NOISE, TIME, Number


@click.command(
    "identify",
    epilog=example("vsacli identify robots/vsa_3r.yaml record.csv -o fitted.yaml --plot figures"),
)
@robot_argument
@click.argument("recordings", type=FILE, nargs=-1, metavar="RECORDING...")
@click.option(
    "--fit",
    metavar="NAMES",
    callback=words_of("springs,motors"),
    help="Parameters to identify: springs, motors, friction, links, or paths such as "
    "'joints.*.actuator.spring.k', separated by commas.",
    show_default="all",
)
@click.option(
    "--bandwidth",
    metavar="HZ",
    type=Number("a frequency in Hz, e.g. 10", positive=True),
    help="Bandwidth of the filter that is applied to all signals.",
    show_default="1.5 times the bandwidth of the motion",
)
@columns_option
@click.option(
    "--plan",
    "planned",
    is_flag=True,
    help="Plan a trajectory to record instead, within all limits, and compare it with TRAJECTORY if given.",
)
@click.option(
    "--duration",
    metavar="SECONDS",
    type=TIME,
    help="Duration of the planned trajectory.",
    show_default=f"{USUAL_DURATION:g}",
)
@click.option(
    "--sensor-noise",
    metavar="RAD[,NM]",
    type=SENSOR_NOISE,
    help="With --plan: standard deviation of measured positions in rad and of measured motor torques "
    "in N m, from which standard errors are predicted.",
    show_default="2e-5 and 0.5% of the peak torque of each motor",
)
@click.option(
    "--seed",
    metavar="N",
    type=SEED,
    help="With --plan: seed of the random search.",
    show_default="0",
)
@click.option(
    "-o",
    "--output",
    type=YAML_FILE,
    help="Write the robot file with the identified parameters; with --plan, the trajectory.",
)
@figure_options(
    "--plot", purpose="Save figures of measured and predicted torques in this folder.", pages=True
)
@json_option
@overwrite_option
@talk_options
def identify(
    robot: str,
    recordings: tuple[str, ...],
    fit: tuple[str, ...] | None,
    bandwidth: float | None,
    columns: str | None,
    planned: bool,
    duration: float | None,
    sensor_noise: tuple[float, ...] | None,
    seed: int | None,
    output: str | None,
    figures: FigureTarget | None,
    as_json: bool,
    overwrite: bool,
    talk: Talk,
) -> int:
    """Identify springs, motors, friction and links of ROBOT from RECORDINGs of its motion, CSV files.

    Columns have the names of `vsacli export`: elbow.q, elbow.theta_1, elbow.tau_motor_1, or
    elbow.tau_motor_shaft_1 and elbow.current_1 if the robot file has gear ratio and torque constant. A unit
    in brackets may follow. Cells may be empty where a column has no sample. --columns maps other names.

    The report gives each parameter with its standard error, the parameters that are unidentifiable, and the
    residuals of the equations compared with the noise, also on parts of the recordings that the fit did not
    use.

    With --plan, the command plans the motion and stiffness to record, so that the parameters are
    identifiable, within all limits of ROBOT and from rest to rest. A TRAJECTORY after ROBOT is then compared
    with the plan.
    """
    if planned:
        _check_options(
            {"--fit": fit, "--bandwidth": bandwidth, "--columns": columns, "--plot": figures},
            "cannot be used with --plan; leave one out",
        )
        return plan(
            robot,
            recordings,
            duration=USUAL_DURATION if duration is None else duration,
            noise=sensor_noise,
            seed=seed or 0,
            output=output,
            as_json=as_json,
            overwrite=overwrite,
            talk=talk,
        )
    _check_options({"--duration": duration, "--sensor-noise": sensor_noise, "--seed": seed}, "needs --plan")
    if not recordings:
        raise click.UsageError("Missing argument 'RECORDING...'; to plan a motion to record, give --plan")
    from vsacli.cli.identify_plots import draw_figures, identification_page
    from vsacli.studies.identification import WORDS, fitted_text
    from vsacli.studies.identification import identify as identified
    from vsacli.studies.identification.motor_equations import check_fit

    loaded = read_robot(robot)
    inputs = [*(source.path for source in loaded.sources), *recordings, *filter(None, [columns])]
    with Outputs(overwrite=overwrite, inputs=inputs) as outputs:
        file = None if output is None else outputs.file(Path(output))
        page = figures and figures.page(f"{Path(robot).stem}-identification", outputs)
        with naming_option("--fit"):
            check_fit(loaded, fit or WORDS, WORDS)
        with (
            naming_kind("RECORDING", recordings, ("table",)),
            naming_kind("--columns", columns, ("columns",)),
        ):
            progress = partial(talk.progress, shown_from=0, label="identifying")
            identification = identified(
                loaded, recordings, fit or WORDS, bandwidth, columns, progress=progress
            )
        if file is not None:
            file.write_text(fitted_text(loaded, identification, Path(output or "").parent))
        if page is not None:
            page.write_text(identification_page(identification, columns))
        elif figures is not None:
            draw_figures(identification, robot, figures, outputs)
    say(identification, as_json, identification.as_text(verbose=talk.verbose))
    talk.wrote(outputs)
    return EXIT_OF_VERDICT[identification.verdict]


def _check_options(option_values: dict[str, object], reason: str) -> None:
    """Refuse options that do not apply."""
    for option, value in option_values.items():
        if value is not None:
            raise click.UsageError(f"{option} {reason}")
