"""The contents of the site are the links with which lists and table rows of `PAGES` begin."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

PAGES = ("index", "cli", "file-formats")
"""The first page, and pages of the reference that have pages below them."""

SECTION = re.compile(r"^## (?P<title>.+)\n(?P<text>(?:(?!## ).*\n?)*)", re.MULTILINE)
ENTRY = re.compile(r"^(?:-|\|) \[`?(?P<title>[^\]`]+)`?\]\((?P<page>[\w/-]+)\.md\)", re.MULTILINE)
CONTENTS = "```{{toctree}}\n:hidden:\n:caption: {title}\n\n{pages}\n```\n"


def setup(app: Sphinx) -> dict[str, Any]:
    """Make contents of the lists when the page is read."""
    app.connect("source-read", _add_contents)
    return {"parallel_read_safe": True}


def with_contents(text: str) -> str:
    """Return a page with the contents that follow from its links behind each section."""
    return SECTION.sub(_contents, text)


def _contents(section: re.Match[str]) -> str:
    pages = [f"{title} <{page}>" for title, page in ENTRY.findall(section["text"])]
    if not pages:
        return section[0]
    contents = CONTENTS.format(title=section["title"], pages="\n".join(pages))
    return f"{section[0].rstrip()}\n\n{contents}\n"


def _add_contents(_app: Sphinx, page: str, source: list[str]) -> None:
    if page in PAGES:
        source[0] = with_contents(source[0])
