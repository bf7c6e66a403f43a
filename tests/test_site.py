"""Parts of the site: contents and formulas."""

from __future__ import annotations

import re
from typing import Any

import pytest
from site_parts.contents import with_contents


def test_contents_follow_lists_and_tables() -> None:
    links = "- [One](one.md): the first\n\n| [`two`](more/two.md) | text |\n"
    shown = with_contents(f"# Page\n\n## Some\n\n{links}\n## None\n\n[three](three.md)\n")
    assert "```{toctree}\n:hidden:\n:caption: Some\n\nOne <one>\ntwo <more/two>\n```\n" in shown
    assert shown.count("toctree") == 1


@pytest.fixture
def renderer() -> Any:
    """The module of formulas, which needs the extra `docs`."""
    pytest.importorskip("docutils")
    pytest.importorskip("ziamath")
    return pytest.importorskip("site_parts.mathml")


def compact(mathml: str) -> str:
    return re.sub(r">\s+<", "><", mathml)


def test_primes_are_one_raised_character(renderer: Any) -> None:
    prime = '<mo form="postfix" lspace="0" rspace="0">{}</mo>'
    for character, tex in zip("′″‴⁗", ("q'", "q''", "q'''", "q''''"), strict=True):
        assert f"<mi>q</mi>{prime.format(character)}</math>" in compact(renderer.mathml(tex))
    assert f"<mi>e</mi></msub>{prime.format('″')}" in compact(renderer.mathml(r"\tau_e''"))


def test_functions_have_space_but_not_before_a_bracket(renderer: Any) -> None:
    sine, space = "<mi>sin</mi><mo>&ApplyFunction;</mo>", '<mspace width="0.167em"/>'
    assert f"<mi>d</mi>{space}{sine}{space}<mi>α</mi>" in compact(renderer.mathml(r"d \sin\alpha"))
    assert f'{sine}<mo stretchy="false">(' in compact(renderer.mathml(r"\sin(\alpha)"))


def test_the_font_has_its_license(renderer: Any) -> None:
    assert renderer.FONT.is_file()
    assert "SIL OPEN FONT LICENSE Version 1.1" in renderer.LICENSE.read_text()
