"""Manual pages of all commands, from the same texts as their help: `vsacli.1`, `vsacli-invdyn.1`, ..."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click_man.core import generate_man_page

from vsacli.base.version import __version__
from vsacli.cli.main import vsacli

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages beside the site once that is made."""
    app.connect("build-finished", _write_beside)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_pages(folder: Path) -> None:
    """Write a page for each command."""
    folder.mkdir(parents=True, exist_ok=True)
    for context in contexts(click.Context(vsacli, info_name="vsacli")):
        path = folder / f"{context.command_path.replace(' ', '-')}.1"
        path.write_text(
            f"{generate_man_page(context, version=__version__)}{_epilog(context)}", encoding="utf-8"
        )


def contexts(parent: click.Context) -> Iterator[click.Context]:
    """A group, and every command in it or in a group of it."""
    yield parent
    if isinstance(parent.command, click.Group):
        for name, command in parent.command.commands.items():
            yield from contexts(click.Context(command, info_name=name, parent=parent))


def _epilog(context: click.Context) -> str:
    """What the help ends with, which click-man leaves out: paragraphs, each a title with lines."""
    paragraphs = (context.command.epilog or "").replace("\b\n", "").split("\n\n")
    return "".join(_section(*paragraph.split("\n")) for paragraph in paragraphs if paragraph)


def _section(title: str, *lines: str) -> str:
    return f".SH {title.rstrip(':').upper()}\n" + "".join(map(_line, lines))


def _line(line: str) -> str:
    """A command as it is, or a word with its meaning, between which the help has a gap."""
    word, gap, meaning = line.strip().replace("\\", r"\e").replace("-", r"\-").partition("  ")
    return f".TP\n\\fB{word}\\fP\n{meaning.strip()}\n" if gap else f".nf\n{word}\n.fi\n"


def _write_beside(app: Sphinx, failure: Exception | None) -> None:
    if failure is None:
        write_pages(Path(app.outdir).parent / "man")
