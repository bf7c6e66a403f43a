"""Parts of sentences."""

from __future__ import annotations

import pytest

from vsacli.base.texts import counted, joined


@pytest.mark.parametrize(
    ("number", "several", "text"),
    [
        (0, "", "0 runs"),
        (1, "", "1 run"),
        (2, "", "2 runs"),
        (1, "oxen", "1 run"),
        (3, "wide runs", "3 wide runs"),
    ],
)
def test_nouns_have_their_number(number: int, several: str, text: str) -> None:
    assert counted(number, "run", several) == text


@pytest.mark.parametrize(
    ("words", "text"), [(["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_the_last_word_has_a_conjunction(words: list[str], text: str) -> None:
    assert joined(words) == text
