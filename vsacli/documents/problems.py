"""Collecting everything that is wrong with a document, so that it is reported at once."""

from __future__ import annotations

from typing import NoReturn

from vsacli.base.errors import InputError, Problem

MAX_PROBLEMS = 50
"""A document with more problems is given up on: the reader would drown, and so would the user."""


class Problems:
    """What is wrong with one file.

    Every problem of a document is added here while reading goes on; `check` raises them all.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self._found: list[Problem] = []

    def add(self, line: int, message: str) -> None:
        """Note a problem.

        Raises:
            InputError: there are now more than MAX_PROBLEMS.
        """
        if len(self._found) == MAX_PROBLEMS:
            self._found.append(
                Problem(self.file, line, f"more than {MAX_PROBLEMS} problems; reading stopped here")
            )
            self.check()
        self._found.append(Problem(self.file, line, message))

    def include(self, error: InputError) -> None:
        """Note the problems of another file that this one names."""
        self._found.extend(error.problems)

    def fail(self, line: int, message: str) -> NoReturn:
        """Raise everything found so far and this problem, behind which nothing can be read."""
        raise InputError(self._in_order(Problem(self.file, line, message)))

    def check(self) -> None:
        """Raise what was found.

        Raises:
            InputError: with every problem once, in the order of the lines.
        """
        if self._found:
            raise InputError(self._in_order())

    def _in_order(self, *last: Problem) -> list[Problem]:
        return sorted(
            dict.fromkeys([*self._found, *last]), key=lambda problem: (problem.file != self.file, problem)
        )
