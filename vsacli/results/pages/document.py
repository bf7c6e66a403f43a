"""One HTML file: the template of the project around texts, numbers and scripts, closed to the network."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from vsacli.base.tables import ReportText
from vsacli.results.pages.library import Library
from vsacli.results.pages.packing import Packed, as_script

TEMPLATE, STYLE = "page.html", "page.css"

SCRIPTS = ("marks.js", "figures.js", "charts.js", "robot.js", "scatter.js", "page.js")
"""The project's own, in the order in which they run."""

LARGEST_SHOWN = 200_000
"""Letters of an input up to which a page shows all of it; tables of samples are longer."""


class RemedyText(NamedTuple):
    """What would mend a run that failed, as a page says it.

    Attributes:
        lines: a sentence or more each.
        command: that the last line announces; empty if there is none.
    """

    lines: Sequence[str]
    command: str


class Facts(NamedTuple):
    """What a page says of a file in words.

    Attributes:
        title: what was run.
        label: short, to tell it from the others on the page.
        verdict: as in the report; empty without one.
        tone: "good", "fair" or "bad".
        report: what the command printed that made it.
        provenance: pairs of a word and what it says.
        inputs: the files that were read.
        remedy: what would mend it; None if it needs none, or none was looked for.
        table: what the report has beside the table in it; header first, empty if there is nothing.
    """

    title: str
    label: str
    verdict: str
    tone: str
    report: ReportText
    provenance: Sequence[tuple[str, str]]
    inputs: Sequence[InputText]
    remedy: RemedyText | None = None
    table: Sequence[tuple[str, ...]] = ()


class InputText(NamedTuple):
    """A file that was read.

    Attributes:
        path: of it.
        sha256: of its content, in hex.
        content: what it held; None if a page does not show it.
        instead: what is said then.
    """

    path: str
    sha256: str
    content: str | None
    instead: str


def rendered(
    library: Library, title: str, facts: Sequence[Facts], data: Mapping[str, Any], packed: Packed
) -> str:
    """The page.

    Args:
        library: that draws its plots.
        title: of the page.
        facts: what is said of each file.
        data: JSON values for the scripts.
        packed: arrays for the scripts.
    """
    import jinja2  # what bokeh brings along

    folder = files(__package__)
    scripts = [*library.scripts, *((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    template = environment.from_string((folder / TEMPLATE).read_text(encoding="utf-8"))
    return template.render(
        title=title,
        facts=facts,
        data=as_script({**data, "library": library.name}),
        arrays=packed.texts,
        style=(folder / STYLE).read_text(encoding="utf-8"),
        scripts=scripts,
        allowed=" ".join(map(_hash, scripts)),
    )


def _hash(script: str) -> str:
    """What names a script in a Content Security Policy: no other one runs, wherever it came from."""
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
