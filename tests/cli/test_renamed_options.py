"""Options and keys that changed before 0.1: an old one is refused, and the error names the new one."""

from __future__ import annotations

import pytest
from samples.command_line import REST_TO_REST, ROBOT

OF_COMMANDS = [
    (("check-feasibility", ROBOT, REST_TO_REST, "--near-singular", "0.01"), "--min-margin"),
    (("optimize", ROBOT, REST_TO_REST, "--margin", "1%"), "--min-margin"),
]


@pytest.mark.parametrize(("command", "new"), OF_COMMANDS, ids=lambda each: str(each))
def test_an_old_option_is_refused_with_its_successor(vsacli, command, new):
    outcome = vsacli(*command)
    assert outcome.code == 2
    old = next(word for word in reversed(command) if word.startswith("--"))
    assert f"{old} is now {new}." in outcome.err


def test_an_old_key_of_a_study_is_refused_with_its_successor(vsacli, tmp_path):
    study = tmp_path / "study.yaml"
    study.write_text(
        "format: vsacli-study/1\nname: s\nrobot: arm.yaml\ntrajectory: move.yaml\noptimize: {margin: 3 %}\n"
    )
    outcome = vsacli("validate", study)
    assert outcome.code == 2
    assert "study.yaml:5" in outcome.out
    assert "it is now 'min_margin'" in outcome.out
