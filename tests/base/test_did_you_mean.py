"""Proposals for a mistyped word."""

from __future__ import annotations

import pytest

from vsacli.base.did_you_mean import did_you_mean

KEYS = ("vary", "variables", "robot", "stiffness_min", "stiffness_max", "start", "stop")


@pytest.mark.parametrize(
    ("word", "clause"),
    [
        ("var", "; did you mean 'vary' or 'variables'?"),
        ("robt", "; did you mean 'robot'?"),
        ("stiff", "; did you mean 'stiffness_min' or 'stiffness_max'?"),
        ("zzz", "; valid: vary, variables, robot, stiffness_min, stiffness_max, start, stop"),
        ("sta", "; did you mean 'start'?"),
    ],
    ids=["similar and beginning", "similar", "two beginnings", "nothing similar", "beginning"],
)
def test_similar_words_and_those_with_the_same_beginning(word: str, clause: str) -> None:
    assert did_you_mean(word, KEYS) == clause
