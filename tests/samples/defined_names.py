"""Names that the package defines, counted: defined in several modules, and without content."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from samples.sources import PACKAGE, SOURCES, parsed

EMPTY_WORDS = frozenset(
    (
        "each",
        "found",
        "given",
        "here",
        "known",
        "made",
        "others",
        "own",
        "said",
        "there",
        "thing",
        "told",
        "way",
    )
)
"""Words that, as a whole name, say nothing about the quantity or the deed."""

COUNTED = [source for source in SOURCES if source.relative_to(PACKAGE).parts[0] != "cli"]
"""Modules whose names count; a command and the function that it calls may share a name."""


def _classes(node: ast.AST) -> Iterator[str]:
    return (each.name for each in ast.walk(node) if isinstance(each, ast.ClassDef))


def _functions(node: ast.AST) -> Iterator[str]:
    """Yield the names of functions that are neither methods nor inside another function."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            yield child.name
        elif not isinstance(child, ast.ClassDef):
            yield from _functions(child)


def defined_twice(kind: type[ast.ClassDef] | type[ast.FunctionDef]) -> dict[str, list[Path]]:
    """Return the names of classes or functions that several modules define, private or not."""
    homes = defaultdict(set)
    for source in COUNTED:
        names = _classes(parsed(source)) if kind is ast.ClassDef else _functions(parsed(source))
        for name in names:
            homes[name.strip("_")].add(source)
    return {name: sorted(modules) for name, modules in homes.items() if len(modules) > 1}


def _given_names(tree: ast.Module) -> Iterator[str]:
    """Yield the names of functions, classes, parameters, variables and attributes that a module defines."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name


def share_of_empty_words() -> float:
    """Return the share of names, each counted once in a module, that are an empty word."""
    names = [name.strip("_") for source in COUNTED for name in {*_given_names(parsed(source))}]
    return sum(name in EMPTY_WORDS for name in names) / len(names)
