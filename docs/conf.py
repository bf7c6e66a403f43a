"""How Sphinx makes the site of these pages: `sphinx-build --fail-on-warning --fresh-env docs build/site`.

`docs/site_parts/` has what is particular to it. The pages are plain Markdown and can be read without it.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # where `site_parts` and `python_names` lie

from typing import TYPE_CHECKING, Any

from nbclient import NotebookClient
from pygments.lexers.special import TextLexer

from vsacli.base.version import __version__

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project = "vsacli"
author = "the vsacli contributors"
copyright = author  # noqa: A001 - Sphinx's name
version = release = __version__

root_doc = "index"
exclude_patterns = ["examples"]
extensions = [
    "myst_nb",  # Markdown pages, and those of tutorials, which are executed
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "site_parts.contents",
    "site_parts.api",
    "site_parts.mathml",
    "site_parts.man",
]

myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]

# Cells call `vsacli`, which is next to sphinx-build also where the environment is not active.
os.environ["PATH"] = os.pathsep.join((sysconfig.get_path("scripts"), os.environ["PATH"]))
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120  # seconds a cell; the longest takes about 10 on one core
nb_execution_in_temp = True
# Commands print in pieces, which `nb_merge_streams` would put on lines of their own.
notebook_client: Any = NotebookClient  # whose types know traits only
notebook_client.coalesce_streams = True

autodoc_typehints = "none"  # the docstrings say shapes and units
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
default_role = "code"  # docstrings mark code by single backquotes
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # attributes as a list within their class
napoleon_attr_annotations = False

highlight_language = "text"
smartquotes = False  # primes are derivatives, two hyphens an option

copybutton_prompt_text = "$ "

html_theme = "furo"
html_title = f"vsacli {__version__}"
html_static_path = ["site_parts/style.css"]
html_css_files = ["style.css"]
html_show_sphinx = False


def setup(app: Sphinx) -> None:
    """Show tables as they are: Pygments knows no CSV."""
    app.add_lexer("csv", TextLexer)
