"""Values in the text of a YAML file are changed, and nothing else."""

from __future__ import annotations

import pytest

from vsacli.base.errors import InputError
from vsacli.documents.edited import edited, texts_at

TEXT = """\
# A robot of mine
joints:
  - name: base                    # the first
    actuator:
      type: antagonistic          # two motors
      spring: {type: table, file: left.csv}
  - name: elbow
    actuator: {type: antagonistic, preload: positive}    # in one line
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
            "joints.1.actuator.preload",
            "negative",
            ["    actuator: {type: antagonistic, preload: negative}    # in one line"],
        ),
        ("joints.0.actuator.preload", "negative", ["      preload: negative"]),
        (
            "joints.2.actuator.preload",
            "negative",
            ["  - {name: tip, actuator: &same {preload: negative, type: antagonistic}}"],
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
    again = edited(TEXT, {"joints.1.actuator.preload": "negative", "joints.0.name": "foot"})
    assert again == TEXT.replace("name: base", "name: foot").replace("preload: positive", "preload: negative")


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("joints.3.actuator.preload", "'actuator' is an alias, which others share"),
        ("joints.7.actuator.preload", "there is no '7'"),
        ("joints.0.name.preload", "there is no 'preload'"),
    ],
)
def test_what_cannot_be_changed(path: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        edited(TEXT, {path: "negative"})


def test_texts_under_a_key_are_found() -> None:
    assert list(texts_at(TEXT, "file")) == [("joints.0.actuator.spring.file", "left.csv")]
    assert [path for path, _ in texts_at(TEXT, "preload")] == ["joints.1.actuator.preload"]
