"""Contents of the package's source files that several tests examine: each file is parsed and walked once."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import vsacli

PACKAGE = Path(vsacli.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))

TALK = ("print", "sys.stdout", "sys.stderr", "sys.exit", "logging", "warnings.warn")
"""What prints, ends the process, or has others print."""

ENDS_OF_TALK = {name.rpartition(".")[2] for name in TALK}


@dataclass
class Contents:
    """Imports, texts and uses of `TALK` in a source file, each with its line unless it is a text alone."""

    imports: list[tuple[str, int]] = field(default_factory=list)
    """Dotted names, of imports anywhere in the file."""
    talk: list[tuple[str, int]] = field(default_factory=list)
    literals: list[tuple[str, int]] = field(default_factory=list)
    """Strings that are no docstrings; parts of formatted strings are among them."""
    docstrings: list[str] = field(default_factory=list)
    """Of modules, classes and functions, and the texts below constants."""
    formatted: list[str] = field(default_factory=list)
    """Formatted strings; `{}` stands for each value."""


@cache
def parsed(source: Path) -> ast.Module:
    """Return the syntax tree of a source file."""
    return ast.parse(source.read_text(encoding="utf-8"))


@cache
def contents(source: Path) -> Contents:
    """Parse a source file and collect its imports and texts."""
    found = Contents()
    tree = parsed(source)
    docstrings = set()
    for node in ast.walk(tree):  # a statement comes before its expression
        match node:
            case ast.Expr(value=ast.Constant(value=str(text)) as constant):
                found.docstrings.append(text)
                docstrings.add(id(constant))
            case ast.Constant(value=str(text)) if id(node) not in docstrings:
                found.literals.append((text, node.lineno))
            case ast.JoinedStr(values=parts):
                texts = (str(part.value) if isinstance(part, ast.Constant) else "{}" for part in parts)
                found.formatted.append("".join(texts))
            case ast.Name(id=end) | ast.Attribute(attr=end) if end in ENDS_OF_TALK:
                if (name := ast.unparse(node)) in TALK:
                    found.talk.append((name, node.lineno))
            case ast.Import(names=aliases):
                found.imports += ((alias.name, node.lineno) for alias in aliases)
            case ast.ImportFrom(module=module, names=aliases):
                assert node.level == 0, f"{source}:{node.lineno}: relative import"
                names = [""] if module != "vsacli" else [f".{alias.name}" for alias in aliases]
                found.imports += ((f"{module}{name}", node.lineno) for name in names)
    return found
