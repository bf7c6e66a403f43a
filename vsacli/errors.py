"""What can go wrong, as exceptions that carry data and build their own sentence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path


class VsacliError(Exception):
    """Root of every error the tool raises on purpose."""


@dataclass(frozen=True, order=True)
class Problem:
    """One thing wrong with an input: where it stands and what is expected there.

    Attributes:
        file: path as the user gave it, or "" for values that came from Python.
        line: line number from 1, or 0 if the problem concerns the whole file.
        message: what is wrong, what was expected, how to mend it; no full stop at the end.
    """

    file: str
    line: int
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        return place + self.message


class InputError(VsacliError, ValueError):
    """An input file, or a value given from Python, cannot be used. Carries every problem found."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def one(cls, message: str, file: str | Path = "", line: int = 0) -> InputError:
        """An error with a single problem."""
        return cls([Problem(str(file), line, message)])


@dataclass(frozen=True)
class FieldProblem:
    """A field of a record that cannot hold its value; `path` leads to it, e.g. ("inertia", "xx")."""

    path: tuple[str | int, ...]
    message: str

    def __str__(self) -> str:
        return ": ".join([".".join(map(str, self.path)), self.message] if self.path else [self.message])


class InvalidRecordError(InputError):
    """A record was built with values it cannot have. A file reader adds file and line to each problem."""

    def __init__(self, record: str, fields: Iterable[FieldProblem]) -> None:
        self.fields = tuple(fields)
        super().__init__(Problem("", 0, f"{record}: {field}") for field in self.fields)


class StorageError(VsacliError):
    """A file cannot be written or read: disk full, permission, a name that is taken."""

    def __init__(self, path: str | Path, message: str) -> None:
        self.path = str(path)
        super().__init__(f"{path}: {message}")
