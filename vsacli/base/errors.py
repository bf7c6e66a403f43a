"""Exceptions that carry their data and compose their own message."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, Self

from vsacli.base.texts import one_line
from vsacli.base.units import Quantity


class VsacliError(Exception):
    """Base class of all errors that vsacli raises on purpose."""


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
    """An input file, or a value passed from Python, that cannot be used; holds every problem found."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def one(cls, message: str, file: str | Path = "", line: int = 0) -> Self:
        """Return an error with a single problem."""
        return cls([Problem(str(file), line, message)])


def check_type(argument: str, value: object, expected: type, advice: str) -> None:
    """Refuse an argument whose type is not the one a function expects.

    Args:
        argument: name of the argument.
        value: argument as passed.
        expected: type that the function expects.
        advice: clause with a valid call; `{}` stands for a path.

    Raises:
        TypeError: with the name, both types, and the valid call.
    """
    if isinstance(value, expected):
        return
    path, value_text = f"{argument}.yaml", _describe_value(value)
    if isinstance(value, str | os.PathLike):
        path = os.fspath(value)
        value_text = f"the path {path!r}"
    raise TypeError(
        f"{argument} must be a {expected.__name__}, not {value_text}; {advice.format(repr(path))}"
    )


def check_path(value: object, call: str) -> None:
    """Refuse an argument that is not a file path.

    Raises:
        TypeError: with a valid call.
    """
    if not isinstance(value, str | os.PathLike):
        raise TypeError(f"path must be a path, not {_describe_value(value)}; call {call}")


def _describe_value(value: object) -> str:
    if value is None:
        return "None"
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    value_type = type(value)
    package = value_type.__module__.partition(".")[0]
    name = value_type.__name__ if package in ("builtins", "vsacli") else f"{package}.{value_type.__name__}"
    return f"{'an' if name[0] in 'AEIOUaeio' else 'a'} {name}"


class FieldProblem(NamedTuple):
    """A field of a record whose value is invalid.

    Attributes:
        path: keys that lead to the field, e.g. ("inertia", "xx"); integers are indices of lists, and of
            joints.
        message: as in `Problem`.
        joint: index of the joint concerned, if any; a file reader replaces it by the joint's name.
        quantities: quantities whose units replace `{}` in the message, since they differ between joints.
    """

    path: tuple[str | int, ...]
    message: str
    joint: int | None = None
    quantities: tuple[Quantity, ...] = ()

    def __str__(self) -> str:
        return self._sentence(map(str, self.path), None if self.joint is None else str(self.joint + 1))

    def in_file(self, joints: Sequence[str]) -> str:
        """Return the sentence with joint names; list indices are omitted, since the line is known."""
        keys = (key for key in self.path if isinstance(key, str))
        return self._sentence(keys, None if self.joint is None else joints[self.joint])

    def _sentence(self, path: Iterable[str], joint: str | None) -> str:
        field_text = " of joint ".join(filter(None, [".".join(path), joint]))
        message = self.message.format(*self.quantities) if self.quantities else self.message
        return f"{field_text}: {message}" if field_text else message

    def in_units(self, variant: str | None) -> FieldProblem:
        """Return the problem with the units of a joint type; None is an unknown one."""
        units = [quantity if variant is None else quantity.unit(variant) for quantity in self.quantities]
        message = self.message.format(*units) if units else self.message
        return self._replace(message=message, quantities=())

    def inside(self, *outer_path: str | int) -> FieldProblem:
        """Return the same problem seen from an enclosing record; `outer_path` is the path from there."""
        return self._replace(path=(*outer_path, *self.path))


class InvalidRecordError(InputError):
    """Values that a record cannot have. A file reader adds file and line to each problem."""

    def __init__(self, record: str, fields: Iterable[FieldProblem]) -> None:
        self.fields = tuple(fields)
        super().__init__(Problem("", 0, f"{record}: {field}") for field in self.fields)


class StorageError(VsacliError):
    """A file that cannot be written or read: disk full, no permission, or a name that is taken."""

    def __init__(self, path: str | Path, message: str) -> None:
        self.path = str(path)
        super().__init__(one_line(f"{path}: {message}"))
