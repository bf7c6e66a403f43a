"""Tables as aligned text for reports and terminals, and as HTML for notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

BETWEEN_CELLS = "   "
"""Separator of cells; no other text of a report contains it, so tables are recognized by it."""


def aligned(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield the lines of a table: the first column aligned left, the others right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        name, *cells = (
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield BETWEEN_CELLS.join([name, *cells])


class ReportText(NamedTuple):
    """A report in its parts; as a string, its lines without a final newline.

    Attributes:
        headline: robot and trajectory of the run, and the verdict.
        rows: rows of a table, header first; empty if there is no table.
        lines: further findings, one or more lines each.
    """

    headline: str
    rows: Sequence[tuple[str, ...]]
    lines: Sequence[str]

    def __str__(self) -> str:
        table = aligned(self.rows) if self.rows else ()
        return "\n".join([self.headline, *table, *self.lines])


def html_table(title: str, rows: Sequence[tuple[str, ...]]) -> str:
    """Return a title and a table as HTML; the first row is the header, and all texts are escaped."""
    header, *body = rows
    lines = "".join(_html_row(row, "td") for row in body)
    table = f"<table><thead>{_html_row(header, 'th')}</thead><tbody>{lines}</tbody></table>"
    return f"<p>{escape(title)}</p>{table}"


def _html_row(row: tuple[str, ...], cell: str) -> str:
    return "<tr>" + "".join(f"<{cell}>{escape(text)}</{cell}>" for text in row) + "</tr>"
