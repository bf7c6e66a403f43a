"""Options and keys that changed before 0.1: an old one is refused, and the error names the new one."""

from __future__ import annotations

import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli import InputError, inverse_dynamics, load_robot, load_trajectory
from vsacli.cli.main import vsacli as commands
from vsacli.robot.parameters import parameters
from vsacli.studies.sensitivities.tolerances import tolerances_of

OF_COMMANDS = [
    (("check-feasibility", ROBOT, REST_TO_REST, "--near-singular", "0.01"), "--min-margin"),
    (("optimize", ROBOT, REST_TO_REST, "--margin", "1%"), "--min-margin"),
    (("simulate", ROBOT, REST_TO_REST, "--tolerance", "1%"), "--goal-tolerance"),
    (("simulate", ROBOT, REST_TO_REST, "--measure", "positions"), "--feedback"),
    (("invdyn", ROBOT, REST_TO_REST, "--deflections", "root"), "--deflection-solver"),
    (("check-feasibility", ROBOT, REST_TO_REST, "--deflections", "root"), "--deflection-solver"),
    (("size", ROBOT, REST_TO_REST, "--catalogue", "motors.csv"), "--catalog"),
    (("compare", "r.h5", "m.csv", "--begins-at", "0"), "--time-offset"),
]


@pytest.mark.parametrize(("command", "new"), OF_COMMANDS, ids=lambda each: str(each))
def test_an_old_option_is_refused_with_its_successor(vsacli, command, new):
    outcome = vsacli(*command)
    assert outcome.code == 2
    old = next(word for word in reversed(command) if word.startswith("--"))
    assert outcome.err.endswith(f"{old} is now {new}\n")


@pytest.mark.parametrize(
    ("command", "old", "new"),
    [
        (("invdyn", ROBOT, REST_TO_REST, "--deflection-solver"), "integrate", "ode"),
        (("optimize", ROBOT, REST_TO_REST, "--minimize"), "copper", "copper_loss"),
        (("size", ROBOT, REST_TO_REST, "--minimize"), "copper", "copper_loss"),
        (("size", ROBOT, REST_TO_REST, "--minimize"), "utilisation", "utilization"),
    ],
)
def test_an_old_word_of_an_option_is_refused_with_its_successor(vsacli, command, old, new):
    outcome = vsacli(*command, old)
    assert outcome.code == 2
    assert outcome.err.endswith(f"'{old}' is now '{new}'\n")


def test_an_old_word_in_python_is_refused_with_its_successor():
    arm = load_robot(ROBOT)
    with pytest.raises(InputError, match="unknown deflection solver 'integrate'; it is now 'ode'"):
        inverse_dynamics(arm, load_trajectory(REST_TO_REST, arm), deflection_solver="integrate")


@pytest.mark.parametrize("share", ["2%", "2 %", "0.02"])
@pytest.mark.parametrize(
    ("command", "option", "number"),
    [
        ("check-feasibility", "min_margin", 0.02),
        ("optimize", "min_margin", 0.02),
        ("simulate", "perturb", 0.02),
    ],
)
def test_shares_are_read_alike_by_every_command(command, option, number, share):
    (found,) = [each for each in commands.commands[command].params if each.name == option]
    assert found.type.convert(share, found, None) == pytest.approx(number, rel=1e-15)


@pytest.mark.parametrize("share", ["2%", "2 %", "0.02"])
def test_tolerances_of_all_numbers_are_shares(share):
    masses = parameters(load_robot(ROBOT), ("joints.*.link.mass",))
    sizes = [each.size for each in tolerances_of(share, masses)]
    assert sizes == pytest.approx([0.02 * each.value for each in masses])


@pytest.mark.parametrize(
    ("entry", "new"), [("margin: 3 %", "min_margin"), ("minimize: copper", "copper_loss")]
)
def test_an_old_word_of_a_study_is_refused_with_its_successor(vsacli, tmp_path, entry, new):
    study = tmp_path / "study.yaml"
    study.write_text(
        f"format: vsacli-study/1\nname: s\nrobot: arm.yaml\ntrajectory: move.yaml\noptimize: {{{entry}}}\n"
    )
    outcome = vsacli("validate", study)
    assert outcome.code == 2
    assert "study.yaml:5" in outcome.out
    assert f"it is now {new!r}" in outcome.out
