"""Reports wrapped to the width of a terminal: lines broken between words, wide tables split into parts."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import itemgetter

from vsacli.base.tables import BETWEEN_CELLS

LEAST_WIDTH = 20
"""Minimum width (columns); on a narrower terminal lines may be too long."""

INDENT = "  "
"""Indent of continuation lines."""

WIDEST_INDENT = 3
"""Inverse of the largest share of the width by which continuation lines are indented below a label."""

UNBREAKABLE_BLANKS = re.compile(
    r"(?<=\d) (?=[A-Za-z%])|(?<=\bN) (?=m\b)| (?=[+-]\d)| (?=[<>] )|(?<=[<>]) | (?=[\d.e+-]+ [<>] )"
)
"""Blanks at which a line is not broken: between a number and its unit, within newton meters, within a
comparison, and before it or a number with a sign, which belong to the joint before."""

COMMAND = re.compile(r"[a-z ,-]+: vsacli ")
"""Beginning of a line that ends with a command."""

QUOTED = re.compile(r"'[^']*'")
"""Argument of a command that a shell would not recognize if a line ended inside."""

CONTINUED = " \\"
"""End of each line of a command but its last, so that the lines can be copied into a shell."""

FIRST_COLUMN = re.compile(r"\s*\S.*?\s{3,}")
"""The first column of a line of a table, up to the second one."""

HARD_BLANK = "\N{NO-BREAK SPACE}"
"""Placeholder for blanks that must not break while a text is wrapped."""


def fitted(text: str, width: int) -> str:
    """Return a report with no line longer than the width, as far as words and cells of tables allow.

    Below the first line, tables are lines whose cells are separated by three or more blanks, as
    `tables.aligned` writes them. A table that is too wide is split into parts, each with the first column.
    Lines that continue a label's line, which ends with a comma, are joined and wrapped again.
    """
    width = max(width, LEAST_WIDTH)
    if all(len(line) <= width for line in text.split("\n")):
        return text
    headline, *lines = _join_continuations(text.split("\n"))
    output_lines = [headline]
    if len(headline) > width:
        output_lines = _wrap_line(UNBREAKABLE_BLANKS.sub(HARD_BLANK, headline), INDENT, width)
    for is_table, group in groupby(zip(lines, _table_mask(lines), strict=True), key=itemgetter(1)):
        group_lines = [line for line, _ in group]
        is_fitting = all(len(line) <= width for line in group_lines)
        if is_table and len(group_lines) > 1 and not is_fitting:
            output_lines += _table_parts(group_lines, width)
        else:
            output_lines += [part for line in group_lines for part in _broken_line(line, width)]
    return "\n".join(output_lines)


def _table_mask(lines: Sequence[str]) -> list[bool]:
    """Return which lines belong to tables: those with several cells, and some between them with one.

    These are lines of a header with the unit of one column, blank in front, and names above groups of rows,
    not wider than the first column.
    """
    in_table = [False]
    for line, below in zip(lines, [*lines[1:], ""], strict=False):
        first_column = FIRST_COLUMN.match(below)
        is_name = (
            bool(first_column)
            and _has_cells(below)
            and len(line) <= len(first_column[0] if first_column else "")
        )
        is_lone_cell = in_table[-1] and bool(line.strip()) and (line.startswith(BETWEEN_CELLS) or is_name)
        in_table.append(_has_cells(line) or is_lone_cell)
    return in_table[1:]


def _has_cells(line: str) -> bool:
    return BETWEEN_CELLS in line.strip()


def _join_continuations(lines: Sequence[str]) -> list[str]:
    """Return the lines, with continuation lines below a label joined to it."""
    joined: list[str] = []
    for line in lines:
        if joined and joined[-1].endswith(",") and line.startswith(INDENT):
            joined[-1] += " " + line.lstrip()
        else:
            joined.append(line)
    return joined


def _broken_line(line: str, width: int) -> list[str]:
    """Return a line broken between words."""
    if len(line) <= width:
        return [line]
    if COMMAND.match(line):
        *parts, last = _wrap_line(
            QUOTED.sub(lambda match: match[0].replace(" ", HARD_BLANK), line),
            _indent(line, width),
            width - len(CONTINUED),
        )
        return [*(part + CONTINUED for part in parts), last]
    return _wrap_line(UNBREAKABLE_BLANKS.sub(HARD_BLANK, line), _indent(line, width), width)


def _wrap_line(line: str, indent: str, width: int) -> list[str]:
    """Return a line, in which some blanks are marked as hard, broken at the others."""
    parts = textwrap.wrap(
        line,
        width,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [part.replace(HARD_BLANK, " ") for part in parts]


def _indent(line: str, width: int) -> str:
    """Return the indent of continuation lines: below the text after a label, if that leaves enough width."""
    label, colon, _ = line.partition(": ")
    indent = " " * len(label + colon)
    if colon and len(indent) * WIDEST_INDENT <= width:
        return indent
    return " " * (len(line) - len(line.lstrip())) + INDENT


def _table_parts(lines: Sequence[str], width: int) -> Iterator[str]:
    """Yield the table in parts that fit, one below the other, each with the first column."""
    first_column, *columns = _columns(lines)
    while columns:
        column_count, free_width = 1, width - len(first_column[0]) - len(BETWEEN_CELLS) - len(columns[0][0])
        while (
            column_count < len(columns)
            and (free_width := free_width - len(BETWEEN_CELLS) - len(columns[column_count][0])) >= 0
        ):
            column_count += 1
        for cells in zip(first_column, *columns[:column_count], strict=True):
            yield BETWEEN_CELLS.join(cells).rstrip()
        columns = columns[column_count:]


def _columns(lines: Sequence[str]) -> list[list[str]]:
    """Return the cells of a table by column; three blanks or more in every line separate columns."""
    longest = max(map(len, lines))
    padded = [line.ljust(longest) for line in lines]
    blank = [all(line[position] == " " for line in padded) for position in range(longest)]
    bounds, start = [], 0
    for is_blank, positions in groupby(range(longest), key=blank.__getitem__):
        span = list(positions)
        if is_blank and len(span) >= len(BETWEEN_CELLS) and span[0] > 0:
            bounds.append((start, span[0]))
            start = span[-1] + 1
    bounds.append((start, longest))
    return [[line[begin:end] for line in padded] for begin, end in bounds]
