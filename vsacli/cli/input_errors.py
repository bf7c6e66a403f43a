"""Errors of inputs in the words of the command line: names of options, and kinds of files."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import click

from vsacli.base.errors import InputError, InvalidRecordError, Problem, StorageError
from vsacli.base.storage import STANDARD
from vsacli.base.texts import joined


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
        raise InputError(_name_option(option, option.lstrip("-"), problem) for problem in problems) from error


@contextmanager
def naming_changes(option_by_path: Mapping[str, str]) -> Iterator[None]:
    """Put `--set PATH=VALUE` before each error of a change, or the option from which the change was made.

    Args:
        option_by_path: other options, by the path that each of them changes, e.g. {"rate": "--rate"}.
    """
    from vsacli.documents.reading import ChangeError

    try:
        yield
    except ChangeError as error:
        path = error.change.partition("=")[0]
        option = option_by_path.get(path, f"--set {error.change}".rstrip())
        raise InputError(_name_option(option, path, problem) for problem in error.problems) from error


def _name_option(option: str, word: str, problem: Problem) -> Problem:
    """Return a problem that names the option, once, instead of the word that it begins with."""
    if problem.file or problem.message.startswith(option):
        return problem
    return problem._replace(message=f"{option}: {problem.message.removeprefix(f'{word}: ')}")


class _Words(NamedTuple):
    """The words for a kind of file: as found, as expected, its format, and what to do with it, or nothing."""

    found: str
    expected: str
    format: str
    advice: str = ""


_EXTRACT = "vsacli info {file} --extract FOLDER gives the files that it was computed from"
_KINDS = {
    "robot": _Words("a robot", "a robot file", "YAML"),
    "trajectory": _Words("a trajectory", "a trajectory", "YAML"),
    "table": _Words("a CSV table", "a CSV table", ""),
    "poles": _Words("a poles file", "a poles file", "YAML", "give it to simulate as --poles {file}"),
    "columns": _Words("a columns file", "a columns file", "YAML", "give it as --columns {file}"),
    "study": _Words("a study", "a study file", "YAML", "run it with vsacli study {file}"),
    "result": _Words("a result", "a result", "HDF5", _EXTRACT),
    "simulation": _Words("a simulation", "a simulation", "HDF5", _EXTRACT),
    "table of a study": _Words("a study table", "a study table", "HDF5", _EXTRACT),
    "urdf": _Words("a URDF file", "a URDF file", ""),
    "motor catalog": _Words(
        "a motor catalog", "a motor catalog", "CSV", "give it to size as --catalog {file}"
    ),
    "tolerances": _Words(
        "a tolerances file", "a tolerances file", "YAML, e.g. joints.*.link.mass: {normal: 2 %}"
    ),
}
"""Words by kind; tolerances have no key `format`, so that they are not recognized."""

_EXPORT = "vsacli export {file} writes a CSV table of it, and vsacli plot compares several results"
_COMPUTE = {
    "robot": "to compute a result: vsacli invdyn {file} TRAJECTORY",
    "trajectory": "to compute a result: vsacli invdyn ROBOT {file}",
}
_ADVICE = {
    **{(found, wanted): text for found, text in _COMPUTE.items() for wanted in ("result", "study")},
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
        expected: kinds that the argument may be, the usual one first; values of `FileKind`, or `tolerances`.
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

    if noun := unreadable(path):
        return f"is a {noun}, but {argument} must be {_alternatives(expected)}"
    kind, usual = file_kind_or_none(path), expected[0]
    if kind is None or kind in expected or _better_said(kind, usual):
        return ""
    advice = _ADVICE.get((kind, usual), _KINDS[kind].advice).format(file=shlex.quote(path))
    order = _order_of_arguments() if (kind, usual) in _SWAPPED else ""
    clauses = [f"is {in_words(kind)}, but {argument} must be {_alternatives(expected)}", order or advice]
    return "; ".join(filter(None, clauses))


def _better_said(kind: str, usual: str) -> bool:
    """Return whether the reader of the usual kind says more of a file: of XML, or of missing columns."""
    return (kind == "urdf" and _KINDS[usual].format == "YAML") or (kind, usual) == ("table", "motor catalog")


def _alternatives(kinds: Sequence[str]) -> str:
    """Return the expected kinds, each with its format unless the next one has the same."""
    words = [_KINDS[kind] for kind in kinds]
    formats = [each.format for each in words]
    shown = [
        "" if one == following else one for one, following in zip(formats, [*formats[1:], ""], strict=True)
    ]
    return joined(
        (
            f"{each.expected} ({text})" if text else each.expected
            for each, text in zip(words, shown, strict=True)
        ),
        "or",
    )


def _order_of_arguments() -> str:
    """Return the arguments of the running command in their order; empty if it has only one."""
    context = click.get_current_context(silent=True)
    if context is None:
        return ""
    words = [word for word in context.command.collect_usage_pieces(context) if "OPTIONS" not in word]
    return f"the order is {' '.join(words)}" if len(words) > 1 else ""


def in_words(kind: str) -> str:
    """Return a kind of `FileKind` with its article."""
    return _KINDS[kind].found


def file_kind_or_none(path: str) -> str | None:
    """Return the kind of a file, as in `FileKind`; None if it is of none that is known, or cannot be read."""
    from vsacli.files.file_kinds import recognize

    try:
        return recognize(path).value
    except (InputError, StorageError):
        return None
