"""Elements of XML with all digits of their numbers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias
from xml.etree import ElementTree

Element: TypeAlias = ElementTree.Element
Value: TypeAlias = str | bool | float | Iterable[float]


def element(parent: Element, tag: str, /, **attributes: Value) -> Element:
    """A new element in another one."""
    return add(ElementTree.SubElement(parent, tag), **attributes)


def add(to: Element, /, **attributes: Value) -> Element:
    """The element with attributes that are new or replaced."""
    to.attrib.update({name: _text(value) for name, value in attributes.items()})
    return to


def document(root: Element, comment: str) -> str:
    """The file, indented, with a comment at its beginning."""
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {_harmless(comment)} -->\n{text}\n'


def _text(value: Value) -> str:
    """Numbers by the shortest text that reads back bit for bit; zero without a sign."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float | int):
        return repr(float(value) or 0.0).removesuffix(".0")
    return " ".join(map(_text, value))


def _harmless(comment: str) -> str:
    """Without the two hyphens that would end it."""
    while "--" in comment:
        comment = comment.replace("--", "- -")
    return comment
