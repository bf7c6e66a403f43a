"""Parsing of XML to a tree with line numbers; bounded, and without document types, so without entities."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from vsacli.documents.source import Problems, is_table
from vsacli.documents.tree import quoted

MAX_LEVELS = 100
MAX_ELEMENTS = 100_000


@dataclass(frozen=True)
class Element:
    """An element with its attributes, its children, and the text outside of its children."""

    tag: str
    line: int
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Text of the element, without surrounding whitespace."""
        return "".join(self.texts).strip()

    def with_descendants(self) -> Iterator[Element]:
        """Yield the element and all its descendants."""
        yield self
        for child in self.children:
            yield from child.with_descendants()

    def children_with_tag(self, tag: str) -> Iterator[Element]:
        """Return the children with a tag."""
        return (child for child in self.children if child.tag == tag)


_YAML = re.compile(r"(\s*(#.*)?\n)*[\w.-]+\s*:(\s|$)")
"""Beginning of a YAML file: comments, then a key."""


def parse_xml(text: str, problems: Problems, expected: str) -> Element:
    """Parse a document; `expected` is its format in words, for messages.

    Raises:
        InputError: the text is a table or YAML, the syntax is broken, there is a document type declaration,
            or a limit is exceeded.
    """
    if not text.lstrip().startswith("<"):
        content = "a CSV table" if is_table(problems.file) else "a YAML file" if _YAML.match(text) else ""
        if content:
            problems.fail(0, f"is {content}, expected {expected} (XML)")
    builder = _XmlTreeBuilder(problems)
    try:
        builder.parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        problems.fail(error.lineno, f"not valid XML at column {error.offset + 1}: {reason}")
    return builder.root


class _XmlTreeBuilder:
    """A builder of the tree from the events of the parser; `root` is its result."""

    root: Element

    def __init__(self, problems: Problems) -> None:
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._refuse_doctype
        self._problems = problems
        self._open: list[Element] = []
        self._elements = 0

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        element = Element(tag, line, attributes)
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            self._problems.fail(line, f"more than {MAX_ELEMENTS:,} elements")
        if len(self._open) == MAX_LEVELS:
            self._problems.fail(line, f"nested more than {MAX_LEVELS} levels deep")
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _end(self, _tag: str) -> None:
        self._open.pop()

    def _text(self, text: str) -> None:
        self._open[-1].texts.append(text)

    def _refuse_doctype(self, name: str, *_: object) -> None:
        reason = "document type declarations and entities are not read; remove it"
        self._problems.fail(self.parser.CurrentLineNumber, f"found <!DOCTYPE {quoted(name)}>: {reason}")
