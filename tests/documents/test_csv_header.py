"""Headers of tables that may have none."""

from __future__ import annotations

from pathlib import Path

import pytest

from vsacli.documents.csv_file import read_header


@pytest.mark.parametrize(
    ("first", "numbered", "line"),
    [("time", (1,), 1), ("0.5", (1,), 0), ("0.5,q", (2,), 1), ("t,0.5", (2,), 0), ("t,0.5", (), 1)],
)
def test_a_line_of_numbers_in_their_columns_is_a_row(
    tmp_path: Path, first: str, numbered: tuple[int, ...], line: int
) -> None:
    (tmp_path / "log.csv").write_text(f"{first}\n1\n")
    assert read_header(tmp_path / "log.csv", numbered).line == line
