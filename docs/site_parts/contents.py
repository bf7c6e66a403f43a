"""The lists of links on the page `index` are the contents of the site: what it does not list, it lacks."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SECTION = re.compile(r"^## (?P<title>.+)\n(?P<text>(?:(?!## ).*\n?)*)", re.MULTILINE)
ENTRY = re.compile(r"^- \[(?P<title>[^\]]+)\]\((?P<page>[\w/-]+)\.md\)", re.MULTILINE)
CONTENTS = "```{{toctree}}\n:hidden:\n:caption: {title}\n\n{pages}\n```\n"


def setup(app: Sphinx) -> dict[str, Any]:
    """Make contents of the lists when the page is read."""
    app.connect("source-read", _add_contents)
    return {"parallel_read_safe": True}


def with_contents(text: str) -> str:
    """The page `index`, behind each section with a list the contents that follow from it."""
    return SECTION.sub(_contents, text)


def _contents(section: re.Match[str]) -> str:
    pages = [f"{title} <{page}>" for title, page in ENTRY.findall(section["text"])]
    if not pages:
        return section[0]
    contents = CONTENTS.format(title=section["title"], pages="\n".join(pages))
    return f"{section[0].rstrip()}\n\n{contents}\n"


def _add_contents(_app: Sphinx, page: str, source: list[str]) -> None:
    if page == "index":
        source[0] = with_contents(source[0])
