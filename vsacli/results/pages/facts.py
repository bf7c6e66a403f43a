"""What a page says of a file in words: how it was made, and what it was made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from vsacli.base.tables import ReportText
from vsacli.base.texts import for_terminal, one_line
from vsacli.documents.source import Source
from vsacli.results.pages.document import LARGEST_SHOWN, InputText
from vsacli.results.store.inputs import StoredInput

FAIR = ("over_limit", "doubtful", "strayed", "untold")
"""Verdicts on what was computed all the same."""

TOO_LONG = "too long for a page"


def tone_of(verdict: str) -> str:
    """How a verdict looks, as of `Facts`."""
    return "good" if verdict == "ok" else "fair" if verdict in FAIR else "bad"


def provenance_rows(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Pairs of a word and what it says of how a file was made; inputs are left out."""
    rows = []
    for name, value in provenance.items():
        if name != "inputs" and value not in ("", {}):
            text = value if isinstance(value, str) else json.dumps(value)
            rows.append((name.replace("_", " "), text))
    changed = {each["path"]: each["changes"] for each in provenance["inputs"] if "changes" in each}
    return rows + [(f"--set of {path}", json.dumps(changes)) for path, changes in changed.items()]


def input_text(file: StoredInput) -> InputText:
    """An input as a page shows it."""
    text = None if file.content is None else file.content.decode("utf-8", "backslashreplace")
    instead = f"{TOO_LONG}; vsacli info --extract gets it from the file"
    return InputText(one_line(file.path), file.sha256, _shown(text), instead)


def source_text(file: Source) -> InputText:
    """A file as it was read, as a page shows it."""
    return InputText(one_line(file.path), file.sha256, _shown(file.text), TOO_LONG)


def _shown(text: str | None) -> str | None:
    """What a page shows of a text: all of it, or nothing."""
    if text is None or len(text) > LARGEST_SHOWN:
        return None
    return "\n".join(map(one_line, text.splitlines()))


def printable(report: ReportText) -> ReportText:
    """A report whose texts name files or columns, with nothing in it that a page would not show."""
    rows = [tuple(map(one_line, row)) for row in report.rows]
    return ReportText(one_line(report.headline), rows, list(map(for_terminal, report.lines)))
