"""The line of an identification that counts its parameters."""

from __future__ import annotations

import math

import pytest

from vsacli.studies.identification.identification_text import Number, agreement_counts

AGREES = Number("k", "N m/rad", before=400.0, value=400.1, standard_error=1.0)
DIFFERS = Number("k", "N m/rad", before=400.0, value=500.0, standard_error=1.0)
UNKNOWN = Number("k", "N m/rad", before=400.0, value=400.0, standard_error=math.nan)


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ([AGREES], "1 parameter: 1 agrees"),
        ([DIFFERS], "1 parameter: 1 differs by more than"),
        ([AGREES, AGREES, DIFFERS, DIFFERS, UNKNOWN], "5 parameters: 2 agree, 2 differ by more than"),
        ([UNKNOWN, UNKNOWN], "2 parameters: 2 unidentifiable"),
    ],
)
def test_verbs_have_the_number_of_their_parameters(numbers: list[Number], text: str) -> None:
    assert agreement_counts(numbers).startswith(text)
