"""Errors of inputs in the words of the command line: names of options, and kinds of files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from vsacli.base.errors import InputError, InvalidRecordError, Problem, StorageError
from vsacli.base.storage import STANDARD


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
        raise InputError(
            each if each.file else each._replace(message=f"{option}: {each.message}") for each in problems
        ) from error


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
}
"""Kinds of files in the words of an error, where they differ."""

_ADVICE = {
    **dict.fromkeys(
        ("result", "simulation", "table of a study"),
        "vsacli info FILE --extract FOLDER gives the files that it was computed from",
    ),
    "trajectory": "are ROBOT and TRAJECTORY swapped?",
    "robot": "are ROBOT and TRAJECTORY swapped?",
    "motor catalog": "vsacli size takes it as --catalog",
}
"""What to do with a file of a kind that a command does not read as a robot or trajectory."""


@contextmanager
def naming_kind(argument: str, path: str, expected: tuple[str, ...]) -> Iterator[None]:
    """Raise one error that says what a file is, if it cannot be read since it is of another kind.

    Args:
        argument: name of the argument in the help.
        path: path of the file.
        expected: kinds that the argument may be, the usual one first; as in `FileKind`.
    """
    try:
        yield
    except InputError as error:
        kind = None if path == STANDARD else _recognized(path)
        if kind is None or kind in ("urdf", *expected):  # readers say more of XML files
            raise
        message = f"is a {_KINDS.get(kind, kind)}, but {argument} must be a {expected[0]}"
        advice = f"; {_ADVICE[kind]}" if kind in _ADVICE else ""
        raise InputError.one(message + advice, path) from error


def _recognized(path: str) -> str | None:
    """Return the kind of a file; None if it is of none that is known, or cannot be read."""
    from vsacli.files.file_kinds import recognize

    try:
        return recognize(path).value
    except (InputError, StorageError):
        return None
