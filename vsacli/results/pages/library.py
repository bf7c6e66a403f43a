"""The plotting library that a page carries inside: BokehJS, as the Python package `bokeh` brings it."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import NamedTuple

from vsacli.base.errors import InputError

SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")
"""The library itself, and its functions for JavaScript; not its widgets, tables, WebGL and MathJax."""


class Library(NamedTuple):
    """A library for a page.

    Attributes:
        name: with its version.
        scripts: what a page runs, in this order.
    """

    name: str
    scripts: tuple[str, ...]


def plotting_library() -> Library:
    """What is installed; found by its files, since to import Bokeh takes a second.

    Raises:
        InputError: it is not installed.
    """
    try:
        installed = distribution("bokeh")
    except PackageNotFoundError:
        reason = "pages need the package bokeh, which is not installed; pip install bokeh gets it"
        raise InputError.one(reason) from None
    folder = Path(str(installed.locate_file("bokeh/server/static/js")))
    scripts = (folder / name for name in SCRIPTS)
    return Library(f"Bokeh {installed.version}", tuple(each.read_text(encoding="utf-8") for each in scripts))
