"""Tables as aligned text for reports and terminals, and as HTML for notebooks."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import NamedTuple

from vsacli.base.texts import verdict_words

BETWEEN_CELLS = "   "
"""Separator of cells; no other text of a report contains it, so tables are recognized by it."""


def aligned(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield the lines of a table: the first column to the left, the others to the right.

    A cell may have several lines, as a header with the unit below the name of a column.
    """
    lines = [line for row in rows for line in zip_longest(*(c.split("\n") for c in row), fillvalue="")]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        name, *cells = (
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        yield BETWEEN_CELLS.join([name, *cells])


class ReportText(NamedTuple):
    """A report as people read it, in its parts; as a text, these with blank lines between them.

    Attributes:
        headline: the verdict, and what it is about.
        findings: problems and warnings, a line or more each, the most critical first.
        tables: tables, each with its header first; empty ones are not shown.
        lines: further values, a line or more each.
    """

    headline: str
    findings: Sequence[str] = ()
    tables: Sequence[Sequence[tuple[str, ...]]] = ()
    lines: Sequence[str] = ()

    def __str__(self) -> str:
        tables = ("\n".join(line.rstrip() for line in aligned(rows)) for rows in self.tables if rows)
        parts = ("\n".join([self.headline, *self.findings]), *tables, "\n".join(self.lines))
        return "\n\n".join(filter(None, parts))


class TextReport(ABC):
    """A report whose string is its text."""

    @abstractmethod
    def as_text(self) -> ReportText:
        """Return the report in parts."""

    def __str__(self) -> str:
        return str(self.as_text())


def headline(verdict: str, title: str) -> str:
    """Return the first line of a report: the verdict in capitals, then what it is about."""
    return f"{verdict_words(verdict)}  {title}"


def cell(value: float, form: str = ".3g") -> str:
    """Return a number as a cell shows it; a dash where it does not exist."""
    return f"{value:{form}}" if math.isfinite(value) else "-"


def html_table(title: str, rows: Sequence[tuple[str, ...]]) -> str:
    """Return a title and a table as HTML; the first row is the header, and all texts are escaped."""
    from html import escape  # needed only in notebooks

    header, *body = ([escape(text.replace("\n", ", ")) for text in row] for row in rows)
    lines = "".join(_html_row(row, "td") for row in body)
    table = f"<table><thead>{_html_row(header, 'th')}</thead><tbody>{lines}</tbody></table>"
    return f"<p>{escape(title)}</p>{table}"


def _html_row(texts: Sequence[str], cell: str) -> str:
    return "<tr>" + "".join(f"<{cell}>{text}</{cell}>" for text in texts) + "</tr>"
