"""Values in the text of a YAML file are changed, and nothing else."""

from __future__ import annotations

import pytest

from vsacli import InputError
from vsacli.documents.edited import edited, texts_at

TEXT = """\
# A robot of mine
joints:
  - name: base                    # the first
    actuator:
      type: antagonistic          # two motors
      spring: {type: table, file: left.csv}
  - name: elbow
    actuator: {type: antagonistic, branch: positive}    # in one line
  - {name: tip, actuator: &same {type: antagonistic}}
  - {name: hand, actuator: *same}
"""


def changed_lines(path: str, value: str) -> list[str]:
    """The lines of the edited text that are not in the text."""
    return [line for line in edited(TEXT, {path: value}).splitlines() if line not in TEXT.splitlines()]


@pytest.mark.parametrize(
    ("path", "value", "lines"),
    [
        (
            "joints.1.actuator.branch",
            "negative",
            ["    actuator: {type: antagonistic, branch: negative}    # in one line"],
        ),
        ("joints.0.actuator.branch", "negative", ["      branch: negative"]),
        (
            "joints.2.actuator.branch",
            "negative",
            ["  - {name: tip, actuator: &same {branch: negative, type: antagonistic}}"],
        ),
        (
            "joints.0.actuator.spring.file",
            "../my springs/left.csv",
            ['      spring: {type: table, file: "../my springs/left.csv"}'],
        ),
        ("joints.1.name", "wrist", ["  - name: wrist"]),
    ],
)
def test_one_value_changes(path: str, value: str, lines: list[str]) -> None:
    assert changed_lines(path, value) == lines


def test_several_values_at_once() -> None:
    again = edited(TEXT, {"joints.1.actuator.branch": "negative", "joints.0.name": "foot"})
    assert again == TEXT.replace("name: base", "name: foot").replace("branch: positive", "branch: negative")


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("joints.3.actuator.branch", "'actuator' is an alias, which others share"),
        ("joints.7.actuator.branch", "there is no '7'"),
        ("joints.0.name.branch", "there is no 'branch'"),
    ],
)
def test_what_cannot_be_changed(path: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        edited(TEXT, {path: "negative"})


def test_texts_under_a_key_are_found() -> None:
    assert list(texts_at(TEXT, "file")) == [("joints.0.actuator.spring.file", "left.csv")]
    assert [path for path, _ in texts_at(TEXT, "branch")] == ["joints.1.actuator.branch"]
