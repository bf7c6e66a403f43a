"""Exceptions that carry their data and write their own sentence."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, Self

from vsacli.base.texts import one_line


class VsacliError(Exception):
    """Root of every error the tool raises on purpose."""


class Problem(NamedTuple):
    """A problem of an input, with its place.

    Attributes:
        file: path as the user gave it, or "" for values that came from Python.
        line: line number from 1, or 0 if the problem concerns the whole file.
        message: the problem, what was expected, how to fix it; no full stop at the end.
    """

    file: str
    line: int
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        return one_line(place + self.message)


class InputError(VsacliError, ValueError):
    """An input file, or a value given from Python, cannot be used. Carries every problem found."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def one(cls, message: str, file: str | Path = "", line: int = 0) -> Self:
        """Return an error with a single problem."""
        return cls([Problem(str(file), line, message)])


def check_type(argument: str, value: object, expected: type, remedy: str) -> None:
    """Refuse an argument of another type than a function expects.

    Args:
        argument: its name.
        value: the argument.
        expected: the type.
        remedy: a clause with the call that would do; `{}` stands for a path.

    Raises:
        TypeError: with a sentence of all of these.
    """
    if isinstance(value, expected):
        return
    path, given = f"{argument}.yaml", _described(value)
    if isinstance(value, str | os.PathLike):
        path = os.fspath(value)
        given = f"the path {path!r}"
    raise TypeError(f"{argument} must be a {expected.__name__}, not {given}; {remedy.format(repr(path))}")


def check_path(value: object, call: str) -> None:
    """Refuse an argument that is no path of a file.

    Raises:
        TypeError: with the call that would do.
    """
    if not isinstance(value, str | os.PathLike):
        raise TypeError(f"path must be a path, not {_described(value)}; call {call}")


def _described(value: object) -> str:
    if value is None:
        return "None"
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    kind = type(value)
    room = kind.__module__.partition(".")[0]
    name = kind.__name__ if room in ("builtins", "vsacli") else f"{room}.{kind.__name__}"
    return f"{'an' if name[0] in 'AEIOUaeio' else 'a'} {name}"


class FieldProblem(NamedTuple):
    """A field of a record that cannot hold its value.

    Attributes:
        path: leads to the field, e.g. ("inertia", "xx"); numbers are indices in lists, and of joints.
        message: as in `Problem`.
        joint: index of the joint it concerns, if it is one of them; a file reader knows its name.
    """

    path: tuple[str | int, ...]
    message: str
    joint: int | None = None

    def __str__(self) -> str:
        return self._sentence(map(str, self.path), None if self.joint is None else str(self.joint + 1))

    def in_file(self, joints: Sequence[str]) -> str:
        """Return the sentence with names of joints, and without list indices: the line is known."""
        keys = (step for step in self.path if isinstance(step, str))
        return self._sentence(keys, None if self.joint is None else joints[self.joint])

    def _sentence(self, path: Iterable[str], joint: str | None) -> str:
        where = " of joint ".join(filter(None, [".".join(path), joint]))
        return f"{where}: {self.message}" if where else self.message

    def inside(self, *outer: str | int) -> FieldProblem:
        """Return the same, seen from a record that holds this one; `outer` leads to it."""
        return self._replace(path=(*outer, *self.path))


class InvalidRecordError(InputError):
    """A record was built with values it cannot have. A file reader adds file and line to each problem."""

    def __init__(self, record: str, fields: Iterable[FieldProblem]) -> None:
        self.fields = tuple(fields)
        super().__init__(Problem("", 0, f"{record}: {field}") for field in self.fields)


class StorageError(VsacliError):
    """A file cannot be written or read: disk full, permission, a name that is taken."""

    def __init__(self, path: str | Path, message: str) -> None:
        self.path = str(path)
        super().__init__(one_line(f"{path}: {message}"))
