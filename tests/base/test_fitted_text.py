"""Reports on narrow terminals: nothing is lost, no line is too long, tables stay tables."""

from __future__ import annotations

import shlex
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsacli.base.fitted_text import LEAST_WIDTH, fitted
from vsacli.base.tables import aligned

ROWS = [
    ("joint", "peak tau_e", "stiffness", "margin"),
    ("base", "0.945 N m", "700-850", "-14.29 %"),
    ("shoulder", "32.7 N m", "-", "3.60 %"),
]
TABLE = "\n".join(aligned(ROWS))
HEADLINE = "INFEASIBLE  vsa-3r, rest-to-rest: 4001 samples, 4 s; 3 of 3 joints infeasible"


def test_what_fits_is_left_alone() -> None:
    text = f"{HEADLINE}\n{TABLE}\nstart: a 1 rad,\n       b 2 rad"
    assert fitted(text, len(HEADLINE)) == text


def test_a_wide_table_follows_in_parts_with_its_first_column() -> None:
    assert fitted(f"title\n{TABLE}", 33).splitlines() == [
        "title",
        "joint      peak tau_e   stiffness",
        "base        0.945 N m     700-850",
        "shoulder     32.7 N m           -",
        "joint        margin",
        "base       -14.29 %",
        "shoulder     3.60 %",
    ]


def test_the_first_line_goes_on_with_a_small_indent() -> None:
    assert fitted(HEADLINE, 69).splitlines() == [
        "INFEASIBLE  vsa-3r, rest-to-rest: 4001 samples, 4 s; 3 of 3 joints",
        "  infeasible",
    ]


def test_a_command_can_be_copied_into_a_shell() -> None:
    command = "vsacli check-feasibility arm.yaml move.yaml --set 'name=my own arm' --fixes"
    label, *lines = fitted(f"title\nto list fixes: {command}", 50).splitlines()
    assert (label, max(map(len, lines)) <= 50, len(lines)) == ("title", True, 3)
    assert "'name=my own arm'" in lines[1]
    typed = "\n".join(lines).removeprefix("to list fixes: ")
    shell = subprocess.run(["sh", "-c", f"printf '%s|' {typed}"], capture_output=True, text=True, check=True)
    assert shell.stdout.split("|")[:-1] == shlex.split(command)


def test_a_comparison_stays_with_its_joint() -> None:
    text = "title\nalso beyond the velocity limit (rad/s): base 4 > 3, elbow -5 < -3"
    assert fitted(text, 56).splitlines()[1:] == [
        "also beyond the velocity limit (rad/s): base 4 > 3,",
        "  elbow -5 < -3",
    ]


def test_sentences_go_on_below_their_label_and_keep_numbers_with_their_units() -> None:
    text = "title\nelbow: stiffness 790 N m/rad at t = 4.000 s is below the 800 it needs"
    assert fitted(text, 29).splitlines() == [
        "title",
        "elbow: stiffness 790 N m/rad",
        "       at t = 4.000 s is",
        "       below the 800 it needs",
    ]


def test_lists_below_a_label_are_broken_anew() -> None:
    text = "title\nmotor positions: base +1 rad, shoulder +2 rad,\n                 elbow +3 rad"
    assert fitted(text, 45).splitlines() == [
        "title",
        "motor positions: base +1 rad,",
        "  shoulder +2 rad, elbow +3 rad",
    ]


def test_indented_lines_stay_indented() -> None:
    assert fitted("title\n  spring: cubic, k 400 N m/rad, k_c 2000 N m", 30).splitlines()[1:] == [
        "  spring: cubic, k",
        "          400 N m/rad, k_c",
        "          2000 N m",
    ]


@pytest.mark.parametrize("width", [1, 10, LEAST_WIDTH])
def test_words_are_not_cut(width: int) -> None:
    path = "/a/very/long/path/that/is/wider/than/the/terminal.yaml"
    assert path in fitted(f"title\nwrote {path} and more", width)


WORD = st.text("abcxyz0123456789.,:%()-/", min_size=1, max_size=12)


@pytest.mark.slow
@given(
    st.lists(st.lists(WORD, min_size=1, max_size=30).map(" ".join), min_size=1, max_size=5),
    st.integers(20, 100),
)
def test_words_keep_their_order(lines: list[str], width: int) -> None:
    text = "\n".join(lines)
    shown = fitted(text, width)
    assert shown.split() == text.split()
    longest = max(len(line) for line in shown.splitlines())
    assert longest <= width or longest <= max(len(line) for line in text.splitlines())


@given(
    st.integers(1, 8).flatmap(lambda columns: st.lists(st.tuples(*[WORD] * columns), min_size=2, max_size=5)),
    st.integers(20, 100),
)
def test_cells_of_tables_keep_their_rows(rows: list[tuple[str, ...]], width: int) -> None:
    shown = fitted("\n".join(["title", *aligned(rows)]), width).splitlines()[1:]
    parts = [shown[first : first + len(rows)] for first in range(0, len(shown), len(rows))]
    for row, *of_parts in zip(rows, *parts, strict=True):
        cells = [cell for part in of_parts for cell in part.split()[1:]]
        assert [row[0], *cells] == list(row)
