"""Wrong versions of a module: each differs from it in one term, sign or coefficient of an equation."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType


@dataclass(frozen=True)
class Mutant:
    """A source text with one change: what it is, and the coefficient it makes wrong if it is of this kind."""

    label: str
    coefficient: int | None
    source: str

    def load(self) -> ModuleType:
        """The changed module, known to nobody else."""
        module = ModuleType(f"mutant of {self.label}")
        exec(compile(self.source, module.__name__, "exec"), module.__dict__)
        return module


@dataclass(frozen=True)
class _Change:
    node: ast.expr
    replacement: str
    description: str
    coefficient: int | None = None


def mutants_of(module: ModuleType, entry: str) -> list[Mutant]:
    """Every mutant of the functions that `entry` calls, directly or not."""
    source = inspect.getsource(module)
    functions = {node.name: node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)}
    return [
        Mutant(
            label=f"{name}:{change.node.lineno}: {change.description}",
            coefficient=change.coefficient,
            source=_spliced(source, change.node, change.replacement),
        )
        for name in sorted(_called(functions, entry))
        for change in _changes(functions[name])
    ]


def _called(functions: dict[str, ast.FunctionDef], entry: str) -> set[str]:
    called: set[str] = set()
    fresh = {entry}
    while fresh:
        called |= fresh
        nodes = [node for name in fresh for node in ast.walk(functions[name])]
        fresh = ({node.id for node in nodes if isinstance(node, ast.Name)} & functions.keys()) - called
    return called


def _changes(function: ast.FunctionDef) -> Iterator[_Change]:
    for node in ast.walk(function):
        match node:
            case ast.BinOp(left, ast.Add(), right) | ast.Call(ast.Name("add"), [left, right]):
                yield _without(node, right, kept=left)
                if not _is_sum(left):
                    yield _without(node, left, kept=right)
            case ast.BinOp(left, ast.Sub(), right):
                yield _replaced(node, f"({ast.unparse(left)} + ({ast.unparse(right)}))")
            case ast.Call(ast.Name("cross"), [left, right]):
                yield _replaced(node, f"cross({ast.unparse(right)}, {ast.unparse(left)})")
            case ast.BinOp(ast.Constant(int(value)), ast.Mult(), factor) | ast.BinOp(
                factor, ast.Mult(), ast.Constant(int(value))
            ):
                yield _replaced(node, f"(({ast.unparse(factor)}) * {value + 1})", coefficient=value)


def _is_sum(node: ast.expr) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)


def _without(node: ast.expr, term: ast.expr, kept: ast.expr) -> _Change:
    return _Change(node, f"({ast.unparse(kept)})", f"without {ast.unparse(term)}")


def _replaced(node: ast.expr, replacement: str, coefficient: int | None = None) -> _Change:
    return _Change(node, replacement, f"{replacement} for {ast.unparse(node)}", coefficient)


def _spliced(source: str, node: ast.expr, replacement: str) -> str:
    lines = source.encode().splitlines(keepends=True)
    start = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: (node.end_lineno or 0) - 1])) + (node.end_col_offset or 0)
    text = source.encode()
    return (text[:start] + replacement.encode() + text[end:]).decode()
