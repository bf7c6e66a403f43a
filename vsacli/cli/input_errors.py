"""Errors of inputs in the words of the command line: names of options, and kinds of files."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import click

from vsacli.base.errors import InputError, InvalidRecordError, Problem, StorageError
from vsacli.base.storage import STANDARD


@contextmanager
def naming_option(option: str, kind: type[InputError] = InputError) -> Iterator[None]:
    """Put the name of an option before each error that its value causes.

    Problems of a file keep their place, since the option only names that file. Problems of a record lose the
    name of its class, which no user has seen, and others a first word that repeats the option.

    Args:
        option: the option, e.g. `--rate`; or an argument such as RECORDING.
        kind: class of the errors that the value causes; others pass unchanged.
    """
    try:
        yield
    except kind as error:
        if isinstance(error, InvalidRecordError):
            problems = [Problem("", 0, str(field)) for field in error.fields]
        else:
            problems = list(error.problems)
        change = getattr(error, "change", "")  # of `--set`, which may be given several times
        label, path = f"{option} {change}".rstrip(), change.partition("=")[0] or option.lstrip("-")
        raise InputError(
            each if each.file else each._replace(message=f"{label}: {each.message.removeprefix(f'{path}: ')}")
            for each in problems
        ) from error


class _Words(NamedTuple):
    """The words for a kind of file: as found, as expected, and what to do with it, or nothing."""

    found: str
    expected: str
    advice: str = ""


_EXTRACT = "vsacli info {file} --extract FOLDER gives the files that it was computed from"
_KINDS = {
    "robot": _Words("a robot", "a robot file (YAML)"),
    "trajectory": _Words("a trajectory", "a trajectory (YAML or CSV)"),
    "table": _Words("a CSV table", "a CSV table"),
    "poles": _Words("a poles file", "a poles file (YAML)", "give it to simulate as --poles {file}"),
    "columns": _Words("a columns file", "a columns file (YAML)", "give it as --columns {file}"),
    "study": _Words("a study", "a study file (YAML)", "run it with vsacli study {file}"),
    "result": _Words("a result", "a result or a simulation (HDF5)", _EXTRACT),
    "simulation": _Words("a simulation", "a simulation (HDF5)", _EXTRACT),
    "table of a study": _Words("a study table", "a study table (HDF5)", _EXTRACT),
    "urdf": _Words("a URDF", "a URDF file"),
    "catalog": _Words("a motor catalog", "a motor catalog (CSV)"),
    "tolerances": _Words("a tolerances file", "a tolerances file (YAML)"),
}
"""Words by kind; a catalog is a table, and tolerances have no `format`, so that neither is recognized."""

_COMPUTE = "to compute a result: vsacli invdyn ROBOT TRAJECTORY"
_EXPORT = "vsacli export {file} writes a CSV table of it, and vsacli plot compares several results"
_ADVICE = {
    ("robot", "result"): _COMPUTE,
    ("trajectory", "result"): _COMPUTE,
    ("robot", "study"): _COMPUTE,
    ("trajectory", "study"): _COMPUTE,
    ("result", "table"): _EXPORT,
    ("simulation", "table"): _EXPORT,
    ("trajectory", "columns"): "the columns of a recording are declared in a file of their own",
}
"""Advice for some pairs of a kind found and a kind expected, which precedes that of the kind found."""

_SWAPPED = (("robot", "trajectory"), ("robot", "table"), ("trajectory", "robot"), ("table", "robot"))
"""Pairs of found and expected kinds that suggest a wrong order of the arguments."""


@contextmanager
def naming_kind(
    argument: str, paths: str | Path | Sequence[str | Path] | None, expected: tuple[str, ...]
) -> Iterator[None]:
    """Raise one error that says what a file is, if it cannot be read since it is of another kind.

    Args:
        argument: name of the argument or option in the help.
        paths: path of the file, or paths of several; None: none was given.
        expected: kinds that the argument may be, the usual one first; values of `FileKind`, or `catalog` and
            `tolerances`.
    """
    try:
        yield
    except (InputError, StorageError) as error:
        given = [paths] if isinstance(paths, str | Path) else paths or ()
        path = error.path if isinstance(error, StorageError) else error.problems[0].file
        if path == STANDARD or path not in map(str, given):
            raise
        problem = _wrong_kind(argument, path, expected)
        if not problem:
            raise
        raise InputError.one(problem, path) from error


def _wrong_kind(argument: str, path: str, expected: tuple[str, ...]) -> str:
    """Return what a file is, what it must be, and what to do; empty if it is expected, or not recognized."""
    from vsacli.documents.source import unreadable

    words = _KINDS[expected[0]]
    noun = unreadable(path)
    if noun:
        return f"is a {noun}, but {argument} must be {words.expected}"
    kind = _recognized(path)
    if kind is None or kind in ("urdf", *expected):  # readers say more of XML files
        return ""
    advice = _ADVICE.get((kind, expected[0]), _KINDS[kind].advice).format(file=shlex.quote(path))
    order = _order_of_arguments() if (kind, expected[0]) in _SWAPPED else ""
    clauses = [f"is {_KINDS[kind].found}, but {argument} must be {words.expected}", order or advice]
    return "; ".join(filter(None, clauses))


def _order_of_arguments() -> str:
    """Return the arguments of the running command in their order; empty if it has only one."""
    context = click.get_current_context(silent=True)
    if context is None:
        return ""
    words = [word for word in context.command.collect_usage_pieces(context) if "OPTIONS" not in word]
    return f"the order is {' '.join(words)}" if len(words) > 1 else ""


def _recognized(path: str) -> str | None:
    """Return the kind of a file; None if it is of none that is known, or cannot be read."""
    from vsacli.files.file_kinds import recognize

    try:
        return recognize(path).value
    except (InputError, StorageError):
        return None
