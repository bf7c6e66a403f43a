"""Formulas as MathML, which browsers draw without a script, and their font, which the site holds."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils.nodes import Element, SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.config import Config
    from sphinx.writers.html5 import HTML5Translator

FONT = files("ziamath.fonts") / "STIXTwoMath-Regular.ttf"
LICENSE = Path(__file__).parent / "STIXTwoMath-OFL.txt"

PRIMES = re.compile(r"(?:<mo>'</mo>\s*)+")
PRIME = ("′", "″", "‴", "⁗")
FUNCTION = re.compile(
    r"(?P<operand></m(?:i|n|sub|sup|sqrt|frac)>)?\s*(?P<name><mi>\w{2,}</mi>)\s*<mo>&ApplyFunction;</mo>\s*"
    r"(?P<bracket><mo[^>]*>\()?"
)
SPACE = '<mspace width="0.167em"/>'  # of TeX, next to functions such as sin


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the renderer, which is the only one and so the one that is used."""
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.connect("config-inited", _configure)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _configure(_app: Sphinx, config: Config) -> None:
    config.html_math_renderer = "mathml"
    config.html_static_path += [str(FONT), str(LICENSE)]


def mathml(tex: str, as_block: bool = False) -> str:
    """Return a formula as MathML, with primes and functions as TeX sets them."""
    formula = PRIMES.sub(_prime, tex2mathml(tex, as_block=as_block))
    return FUNCTION.sub(_function, formula)


def _prime(run: re.Match[str]) -> str:
    """Return primes as one character, which is raised in the font and no superscript therefore."""
    character = PRIME[run[0].count("'") - 1]
    return f'<mo form="postfix" lspace="0" rspace="0">{character}</mo>'


def _function(found: re.Match[str]) -> str:
    before = f"{found['operand']}{SPACE}" if found["operand"] else ""
    return f"{before}{found['name']}<mo>&ApplyFunction;</mo>{found['bracket'] or SPACE}"


def _inline(writer: HTML5Translator, node: Element) -> None:
    writer.body.append(mathml(node.astext()))
    raise SkipNode


def _block(writer: HTML5Translator, node: Element) -> None:
    writer.body.append(f'<div class="math">{mathml(node.astext(), as_block=True)}</div>')
    raise SkipNode
