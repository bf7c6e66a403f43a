"""Parts of sentences."""

from __future__ import annotations

import pytest

from vsacli.base.texts import counted, distinguish, joined


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


@pytest.mark.parametrize(
    ("value", "bound", "expected"),
    [
        (790.0, 827.71, ("790", "827.8")),  # met by what is printed
        (1300.0, 1234.56, ("1300", "1234")),
        (827.7, 827.7001, ("827.7", "827.7001")),
        (0.29, 0.3, ("0.29", "0.3")),
        (9.0e6, 8570501.0, ("9e+06", "8.57e+06")),
    ],
)
def test_a_bound_to_be_met_is_rounded_away_from_the_value(
    value: float, bound: float, expected: tuple[str, str]
) -> None:
    assert distinguish(value, bound, safely=True) == expected
