"""One HTML file from a template with texts, numbers and scripts, without access to the network.

A page contains BokehJS, which draws its plots, from the Python package `bokeh`. Each file has its
`PageTexts`: its report, its provenance, and its inputs.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from vsacli.base.errors import InputError
from vsacli.base.tables import ReportText
from vsacli.base.texts import for_terminal, one_line
from vsacli.documents.source import Source
from vsacli.results.pages.packing import Packed, as_script
from vsacli.results.store.inputs import StoredInput

TEMPLATE, STYLE = "page.html", "page.css"

SCRIPTS = ("marks.js", "figures.js", "charts.js", "kinematics.js", "robot.js", "scatter.js", "page.js")
"""Scripts of pages with plots, in the order in which they run."""

LIBRARY_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")
"""BokehJS and its API for scripts, without widgets, tables, WebGL and MathJax."""

LARGEST_SHOWN = 200_000
"""Maximum number of characters of an input that a page shows; tables of samples are longer."""

FAIR = ("over_limit", "unreliable", "off_target", "unidentifiable")
"""Verdicts on complete runs with findings."""

TOO_LONG = "too long for a page"


class ScriptLibrary(NamedTuple):
    """A script library for a page.

    Attributes:
        name: name and version.
        scripts: scripts in the order in which a page runs them.
    """

    name: str
    scripts: tuple[str, ...]


def plotting_library() -> ScriptLibrary:
    """Return the installed library; its files are read directly, since importing Bokeh takes a second.

    Raises:
        InputError: Bokeh is not installed.
    """
    try:
        installed = distribution("bokeh")
    except PackageNotFoundError:
        reason = "pages need the package bokeh, which is not installed; pip install bokeh gets it"
        raise InputError.one(reason) from None
    folder = Path(str(installed.locate_file("bokeh/server/static/js")))
    scripts = (folder / name for name in LIBRARY_SCRIPTS)
    return ScriptLibrary(
        f"Bokeh {installed.version}", tuple(path.read_text(encoding="utf-8") for path in scripts)
    )


class FixText(NamedTuple):
    """The fixes of a failed run.

    Attributes:
        lines: text in lines.
        command: command announced by the last line; empty if there is none.
    """

    lines: Sequence[str]
    command: str


class PageTexts(NamedTuple):
    """The texts of a page about one file.

    Attributes:
        title: robot and trajectory.
        label: short name that distinguishes the file from others on the page.
        verdict: verdict of the report; empty without one.
        tone: "good", "fair" or "bad".
        report: report as printed by the command that made the file.
        provenance: pairs of a name and its value.
        inputs: input files.
        fix: fixes; None if none are needed, or none were searched.
    """

    title: str
    label: str
    verdict: str
    tone: str
    report: ReportText
    provenance: Sequence[tuple[str, str]]
    inputs: Sequence[InputText]
    fix: FixText | None = None


class InputText(NamedTuple):
    """An input file.

    Attributes:
        path: path of the file.
        sha256: digest of the content, hexadecimal.
        content: text of the file; None if the page does not show it.
        instead: sentence in place of the content.
    """

    path: str
    sha256: str
    content: str | None
    instead: str


def render_page(
    library: ScriptLibrary, title: str, texts: Sequence[PageTexts], data: Mapping[str, Any], packed: Packed
) -> str:
    """Return the page as HTML.

    Args:
        library: library that draws the plots.
        title: title of the page.
        texts: texts on each file.
        data: JSON values for the scripts.
        packed: arrays for the scripts.
    """
    scripts = [*library.scripts, *map(package_file, SCRIPTS)]
    page_data = {**data, "library": library.name}
    return fill_template(TEMPLATE, scripts, page_data, title=title, texts=texts, arrays=packed.texts)


def fill_template(template: str, scripts: Sequence[str], data: Mapping[str, Any], **values: Any) -> str:
    """Return a template of this package filled with values, every text escaped.

    Args:
        template: name of the template.
        scripts: scripts of the page, in the order in which they run; the page allows no others.
        data: JSON values for the scripts.
        values: further values, by their names in the template; `style` is the style sheet.
    """
    import jinja2  # a dependency of bokeh

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(package_file),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template(template).render(
        style=package_file(STYLE),
        scripts=scripts,
        allowed=" ".join(map(_policy_hash, scripts)),
        data=as_script(data),
        **values,
    )


def package_file(name: str) -> str:
    """Return a file of this package: a template, a style sheet or a script."""
    return (files(__package__) / name).read_text(encoding="utf-8")


def _policy_hash(script: str) -> str:
    """Return the hash of a script for the Content Security Policy, which blocks all other scripts."""
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def tone_of(verdict: str) -> str:
    """Return the tone of a verdict for `PageTexts`."""
    return "good" if verdict == "ok" else "fair" if verdict in FAIR else "bad"


def provenance_rows(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the provenance of a file as pairs of a name and its value, without inputs."""
    rows = []
    for name, value in provenance.items():
        if name != "inputs" and value not in ("", {}):
            rows.append((name.replace("_", " "), _value_text(value)))
    changes_by_path = {
        record["path"]: record["changes"] for record in provenance["inputs"] if "changes" in record
    }
    return rows + [("--set", f"{path}: {_value_text(changes)}") for path, changes in changes_by_path.items()]


def _value_text(value: Any) -> str:
    """Return a value of the provenance as text; of a mapping without keys that have no value."""
    if isinstance(value, Mapping):
        return ", ".join(
            f"{name} = {_value_text(entry)}" for name, entry in value.items() if entry is not None
        )
    return value if isinstance(value, str) else json.dumps(value)


def input_text(file: StoredInput) -> InputText:
    """Return a stored input as a page shows it."""
    text = None if file.content is None else file.content.decode("utf-8", "backslashreplace")
    instead = f"{TOO_LONG}; vsacli info --extract gets it from the file"
    return InputText(one_line(file.path), file.sha256, _printable_lines(text), instead)


def source_text(file: Source) -> InputText:
    """Return an input file as a page shows it."""
    return InputText(one_line(file.path), file.sha256, _printable_lines(file.text), TOO_LONG)


def _printable_lines(text: str | None) -> str | None:
    """Return a text in printable lines; None if it is too long for a page."""
    if text is None or len(text) > LARGEST_SHOWN:
        return None
    return "\n".join(map(one_line, text.splitlines()))


def printable(report: ReportText) -> ReportText:
    """Return a report whose texts name files or columns, with nothing in it that a page would not show."""
    tables = [[tuple(map(for_terminal, row)) for row in table] for table in report.tables]
    findings, lines = (list(map(for_terminal, texts)) for texts in (report.findings, report.lines))
    return ReportText(one_line(report.headline), findings, tables, lines)
