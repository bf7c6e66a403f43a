"""Proposals for mistyped words."""

from __future__ import annotations

import pytest

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import InputError
from vsacli.base.variables import select_variables

ROBOTS = ["awas_1r", "cam_1r", "vsa_3r", "vsa_cubebot", "vsa_ii"]


@pytest.mark.parametrize(
    ("word", "clause"),
    [
        ("vsa", "; did you mean 'vsa_3r', 'vsa_cubebot' or 'vsa_ii'?"),
        ("cam", "; did you mean 'cam_1r'?"),
        ("vsa_4r", "; did you mean 'vsa_3r'?"),
        ("puma", f"; valid: {', '.join(ROBOTS)}"),
    ],
)
def test_words_with_this_beginning_come_before_similar_ones(word: str, clause: str) -> None:
    assert did_you_mean(word, ROBOTS) == clause


def test_of_many_words_with_one_beginning_the_most_similar_is_proposed() -> None:
    assert nearest("tau", ["tau_e", "tau_motor", "tau_damper", "tau_transmission"]) == "tau_e"


@pytest.mark.parametrize(("name", "near"), [("foo", "; valid: time, q, dq"), ("thta_std", "'theta_std'")])
def test_standard_deviations_are_proposed_only_for_one(name: str, near: str) -> None:
    with pytest.raises(InputError) as caught:
        select_variables([name])
    assert near in str(caught.value)
    assert ("_std" in str(caught.value)) == ("_std" in near)
