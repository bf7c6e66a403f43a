"""Errors of inputs in the words of the command line: names of options, and kinds of files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from vsacli.base.errors import InputError, InvalidRecordError, Problem, StorageError
from vsacli.base.storage import STANDARD
from vsacli.base.texts import joined


@contextmanager
def naming_option(option: str, kind: type[InputError] = InputError) -> Iterator[None]:
    """Put the name of an option before each error that its value causes.

    Problems of a file keep their place, since the option only names that file. Problems of a record lose the
    name of its class, which no user has seen.

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
        raise InputError(each if each.file else _named(option, each) for each in problems) from error


def _named(option: str, problem: Problem) -> Problem:
    """Return a problem that names the option, once."""
    named = problem.message.startswith(option)
    return problem if named else problem._replace(message=f"{option}: {problem.message}")


@contextmanager
def naming_changes(others: Mapping[str, str]) -> Iterator[None]:
    """Put `--set` before each error of a change, or the option from which the change was made.

    Args:
        others: other options, by the path that each of them changes, e.g. {"rate": "--rate"}.
    """
    from vsacli.documents.reading import ChangeError

    try:
        yield
    except ChangeError as error:
        named = []
        for each in error.problems:
            path, _, rest = each.message.partition(": ")
            message = f"{others[path]}: {rest}" if path in others else f"--set: {each.message}"
            named.append(each._replace(message=message))
        raise InputError(named) from error


_KINDS = {
    "table": "CSV table",
    "poles": "poles file",
    "columns": "columns file",
    "table of a study": "study table",
    "urdf": "URDF file",
}
"""Kinds of files in the words of an error, where they differ."""

_COMPUTED = ("result", "simulation", "table of a study")
"""Kinds of files that commands compute."""

_INPUTS = ("ROBOT", "TRAJECTORY")
"""Arguments of commands that compute."""


@contextmanager
def naming_kind(argument: str, path: str | None, expected: tuple[str, ...]) -> Iterator[None]:
    """Raise one error that says what a file is, if it cannot be read since it is of another kind.

    Args:
        argument: name of the argument in the help, or of the option.
        path: path of the file; None if the option is not given.
        expected: kinds that the argument may be, the usual one first; as in `FileKind`.
    """
    try:
        yield
    except InputError as error:
        kind = None if path in (None, STANDARD) else recognized(path)
        if path is None or kind is None or kind in expected:
            raise
        if kind == "urdf" and argument in _INPUTS:  # readers of these say more of XML files
            raise
        needed = joined(map(in_words, expected), "or")
        message = f"is {in_words(kind)}, but {argument} must be {needed}"
        raise InputError.one(message + _advice(kind, argument, path, expected), path) from error


def in_words(kind: str) -> str:
    """Return a kind of `FileKind` with its article."""
    return f"a {_KINDS.get(kind, kind)}"


def _advice(kind: str, argument: str, path: str, expected: tuple[str, ...]) -> str:
    """Return a clause that says what to do with a file of a kind that is not the expected one."""
    if kind in _COMPUTED and argument in _INPUTS:
        return "; vsacli info FILE --extract FOLDER gives the files that it was computed from"
    if kind in ("robot", "trajectory") and argument in _INPUTS:
        return "; are ROBOT and TRAJECTORY swapped?"
    if kind == "trajectory" and "result" in expected:
        return f"; compute one first: vsacli invdyn ROBOT {path}"
    if kind == "motor catalog":
        return "; vsacli size takes it as --catalog"
    return ""


def recognized(path: str) -> str | None:
    """Return the kind of a file, as in `FileKind`; None if it is of none that is known, or cannot be read."""
    from vsacli.files.file_kinds import recognize

    try:
        return recognize(path).value
    except (InputError, StorageError):
        return None
