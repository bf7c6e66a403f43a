"""Proposals for mistyped words."""

from __future__ import annotations

import pytest

from vsacli import InputError
from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.variables import select_variables

ROBOTS = ["awas_1r", "cam_1r", "vsa_3r", "vsa_cubebot", "vsa_ii"]
KEYS = ["vary", "variables", "robot", "stiffness_min", "stiffness_max", "start", "stop"]


@pytest.mark.parametrize(
    ("word", "valid", "clause"),
    [
        ("vsa", ROBOTS, "; did you mean 'vsa_3r', 'vsa_cubebot' or 'vsa_ii'?"),
        ("cam", ROBOTS, "; did you mean 'cam_1r'?"),
        ("vsa_4r", ROBOTS, "; did you mean 'vsa_3r'?"),
        ("puma", ROBOTS, f"; valid: {', '.join(ROBOTS)}"),
        ("var", KEYS, "; did you mean 'vary' or 'variables'?"),
        ("robt", KEYS, "; did you mean 'robot'?"),
        ("stiff", KEYS, "; did you mean 'stiffness_min' or 'stiffness_max'?"),
        ("sta", KEYS, "; did you mean 'start'?"),
        ("zzz", KEYS, f"; valid: {', '.join(KEYS)}"),
    ],
)
def test_words_with_this_beginning_come_before_similar_ones(word: str, valid: list[str], clause: str) -> None:
    assert did_you_mean(word, valid) == clause


def test_of_many_words_with_one_beginning_the_most_similar_is_proposed() -> None:
    assert nearest("tau", ["tau_e", "tau_motor", "tau_damper", "tau_transmission"]) == "tau_e"


def test_a_valid_word_is_its_own_nearest_though_others_begin_with_it() -> None:
    assert nearest("k", ["k_c", "k", "kind"]) == "k"


@pytest.mark.parametrize(("name", "near"), [("foo", "; valid: time, q, dq"), ("thta_std", "'theta_std'")])
def test_standard_deviations_are_proposed_only_for_one(name: str, near: str) -> None:
    with pytest.raises(InputError) as caught:
        select_variables([name])
    assert near in str(caught.value)
    assert ("_std" in str(caught.value)) == ("_std" in near)
