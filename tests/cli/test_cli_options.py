"""Values of options: what is refused, in which words, and options that contradict each other."""

from __future__ import annotations

import re

import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT

from vsacli.cli.main import vsacli as commands
from vsacli.cli.option_types import SHARE, Number, Numbers, Whole, Words

CHECK = ("check-feasibility", ROBOT, REST_TO_REST)
INVDYN = ("invdyn", ROBOT, REST_TO_REST)
OPTIMIZE = ("optimize", ROBOT, REST_TO_REST)
SENSITIVITY = ("sensitivity", ROBOT, REST_TO_REST)
SIMULATE = ("simulate", ROBOT, REST_TO_REST)
LINEARIZED = (*SIMULATE, "--controller", "feedback-linearization")
SIZE = ("size", ROBOT, REST_TO_REST, "--catalog", "motors.csv")
PLAN = ("identify", ROBOT, "--plan")
IMPORT = ("import-urdf", REPOSITORY / "robots" / "desk_arm.urdf", "--tip", "flange")


def refused(vsacli, *command) -> str:
    """The last line of the error of a command line that is refused before anything is written."""
    outcome = vsacli(*command)
    assert (outcome.code, outcome.out) == (2, "")
    return outcome.err.splitlines()[-1].removeprefix("Error: ")


@pytest.mark.parametrize(
    ("kind", "text", "reason"),
    [
        (Number("a time in s"), "now", "'now' is not a number; expected a time in s"),
        (Number("a time in s"), "nan", "must be finite, not nan; expected a time in s"),
        (Number("a rate", positive=True), "0", "must be positive, not 0; expected a rate"),
        (Number("an angle", least=0.0, most=0.1), "0.2", "must be at most 0.1, not 0.2; expected an angle"),
        (Whole("a count", least=2), "1", "must be at least 2, not 1; expected a count"),
        (Whole("a count", least=2), "2.5", "'2.5' is not a whole number; expected a count"),
        (Numbers("one or two", [1, 2]), "1,2,3", "expected one or two, found 3"),
        (Numbers("one for each"), "1,b", "'b' is not a number; expected one for each"),
        (SHARE, "300%", "'300%': expected a share from 0 % to 100 %, e.g. 2% or 0.02"),
        (SHARE, "-0.1", "'-0.1': expected a share from 0 % to 100 %, e.g. 2% or 0.02"),
        (SHARE, "much", "'much': expected a share from 0 % to 100 %, e.g. 2% or 0.02"),
        (Words(["timing", "both"]), "timming", "is not one of 'timing', 'both'; did you mean 'timing'?"),
        (Words(["double", "float"], {"single": "float"}), "single", "did you mean 'float'?"),
        (Words(["png", "pdf"]), "word", "'word' is not one of 'png', 'pdf'"),
    ],
)  # fmt: skip
def test_a_refusal_says_what_is_expected(kind, text, reason):
    with pytest.raises(Exception, match=re.escape(reason) + "$"):
        kind.convert(text, None, None)


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (Number("a time in s"), "1e-3", 1e-3),
        (Whole("a seed", least=0), "1" + 400 * "0", 10**400),
        (Numbers("some"), "1, -2,3e1", (1.0, -2.0, 30.0)),
        (SHARE, " 100 % ", 1.0),
        (Words(["png", "pdf"]), "pdf", "pdf"),
    ],
)
def test_valid_values_are_converted(kind, text, value):
    assert kind.convert(text, None, None) == value


def test_no_option_has_the_numbers_of_click():
    found = {
        each.type.name
        for command in commands.list_commands(None)
        for each in commands.commands[command].params
    }
    assert found.isdisjoint({"float", "float range", "integer", "integer range"})


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ((*INVDYN, "--rate", "100", "--set", "rate=200"), "--rate 100 contradicts --set rate=200; give one"),
        ((*CHECK, "-q", "-v"), "--quiet and --verbose exclude each other; give one"),
        ((*CHECK, "--threads", "2", "--engine", "numpy"), "--threads needs --engine c or auto; NumPy"),
        ((*IMPORT, "--actuator", "elastic", "--spring", "400,2000"), "--spring needs --actuator antag"),
        ((*IMPORT, "--stiffness", "300"), "--stiffness needs --actuator elastic or serial, not"),
        (("examples", "--overwrite"), "--overwrite needs --copy FOLDER"),
        (("validate", ROBOT, "--recompute"), f"--recompute is for results; {ROBOT} is a robot"),
        (("validate", ROBOT, "--recompute", "--json"), "--recompute cannot be used with --json"),
        (("plot", "r.h5", "s.h5", "r.h5"), "r.h5 is given twice; give each result once"),
        ((*PLAN, "--bandwidth", "3"), "--bandwidth cannot be used with --plan; leave one out"),
        ((*PLAN, "a", "b"), "--plan: expected at most one TRAJECTORY to compare with, found 2"),
        ((*SIMULATE, "--integral"), "--integral needs --controller feedback-linearization"),
        ((*SIMULATE, "--stiffness-poles", "-2"), "--stiffness-poles needs --controller feedback"),
        ((*LINEARIZED, "--poles", "p.yaml", "--stiffness-poles", "-2"), "--poles p.yaml holds the poles"),
        ((*SIZE[:3], "--gear", "50"), "--gear needs --catalog FILE"),
        (("export", ROBOT, "--format", "urdf", "--start", "r.h5"), "--start is only for --format mjcf"),
        (("schema",), "Missing argument KIND: robot, trajectory, poles, study or columns"),
        (("schema", "robots"), "Invalid value for 'KIND': 'robots' is not one of 'robot', "),
        (("help",), "No such command 'help'; did you mean --help?"),
        ((*CHECK, "--write-fixed", "f.yaml"), "--write-fixed is now --write-fix N -o FILE"),
    ],
)  # fmt: skip
def test_contradictions_and_missing_options_are_refused(vsacli, command, reason):
    assert refused(vsacli, *command).startswith(reason)


@pytest.mark.parametrize(
    ("command", "option", "value"),
    [
        (CHECK, "--min-margin", "0"),
        (INVDYN, "--variables", "tau_moter"),
        (OPTIMIZE, "--min-margin", "100%"),
        (OPTIMIZE, "--minimize", "copper_loss"),
        (SENSITIVITY, "--parameters", "masses"),
        (SENSITIVITY, "--tolerances", "5"),
        (SIMULATE, "--initial-error", "0.1,0.2"),
        (SIMULATE, "--initial-stiffness-error", "-1e9"),
        (SIMULATE, "--sensor-noise", "-1"),
        (SIMULATE, "--encoder-bits", "99"),
        (SIMULATE, "--rtol", "1"),
        (SIMULATE, "--atol", "1"),
        (SIMULATE, "--feedback", "positions"),
        (SIMULATE, "--goal-tolerance", "300%"),
        (SIMULATE, "--perturb", "100%"),
        (LINEARIZED, "--poles", "20"),
        (LINEARIZED, "--stiffness-poles", "20"),
        (SIZE, "--gear", "elbo=50"),
        (("identify", ROBOT, "r.csv"), "--fit", "spring"),
        (("codegen", ROBOT, "-o", "code"), "--parameters", "masses"),
        (("new", "robot"), "--joints", "RX"),
        (IMPORT, "--spring", "400,-1"),
    ],
)
def test_an_error_names_the_option_whose_value_causes_it(vsacli, command, option, value):
    reason = refused(vsacli, *command, f"{option}={value}")
    assert re.match(f"{option}( spring)?: (?!{option})", reason), reason


def test_a_result_alone_is_recognized(vsacli, feasible_result):
    reason = refused(vsacli, "invdyn", feasible_result)
    hint = f"{feasible_result} is a result: vsacli info {feasible_result} shows its report"
    assert reason == f"Missing argument 'TRAJECTORY'; {hint}"


COMPUTE = f"to compute a result: vsacli invdyn {ROBOT} TRAJECTORY"


@pytest.mark.parametrize(
    ("words", "argument"),
    [
        (("compare", ROBOT, "r.csv"), f"RESULT must be a result or a simulation (HDF5); {COMPUTE}"),
        (("import-urdf", ROBOT), "URDF must be a URDF file"),
        (("study", ROBOT), f"STUDY must be a study file (YAML); {COMPUTE}"),
        (("identify", ROBOT, ROBOT), "RECORDING must be a CSV table; the order is ROBOT RECORDING..."),
        ((*SIZE[:3], "--catalog", ROBOT), "--catalog must be a motor catalog (CSV)"),
        ((*LINEARIZED, "--poles", ROBOT), "--poles must be a poles file (YAML)"),
        (
            ("export", ROBOT, "--format", "mjcf", "--start", ROBOT),
            f"--start must be a result (HDF5); {COMPUTE}",
        ),
    ],
)
def test_every_command_says_what_a_file_of_a_wrong_kind_is(vsacli, words, argument):
    assert refused(vsacli, *words) == f"{ROBOT}: is a robot, but {argument}"


def test_the_hint_repeats_the_margin(vsacli, too_soft):
    for options, repeated in (("--min-margin", "0.03"), " --min-margin 3%"), ((), ""):
        shown = vsacli("check-feasibility", ROBOT, too_soft, *options).out
        assert f"vsacli check-feasibility {ROBOT} {too_soft}{repeated} --fixes\n" in shown


def test_what_a_library_says_of_a_damaged_file_is_shown_if_verbose(vsacli, own_folder, feasible_result):
    (own_folder / "cut.h5").write_bytes(feasible_result.read_bytes()[:9000])
    short = vsacli("plot", "cut.h5")
    assert (short.code, short.err) == (2, "cut.h5: is damaged or truncated; compute it again\n")
    cause, message = vsacli("plot", "cut.h5", "-v").err.splitlines()
    assert f"{message}\n" == short.err
    assert cause.startswith("cause: ")
    assert "truncated file" in cause
