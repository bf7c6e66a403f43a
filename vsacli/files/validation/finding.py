"""What a check says about a file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from vsacli.base.errors import InputError, Problem

ERROR, WARNING, NOTE = "error", "warning", "note"


@dataclass(frozen=True)
class Finding:
    """One thing to say about a file.

    Attributes:
        problem: what, and where.
        severity: ERROR if the file cannot be used, WARNING if its content is doubtful, NOTE otherwise.
    """

    problem: Problem
    severity: str

    def __str__(self) -> str:
        if self.severity == ERROR:
            return str(self.problem)
        problem = self.problem
        return str(Problem(problem.file, problem.line, f"{self.severity}: {problem.message}"))

    def as_json(self) -> dict[str, Any]:
        """JSON values under the published keys; a line of None concerns the whole file."""
        return {
            "file": self.problem.file,
            "line": self.problem.line or None,
            "message": self.problem.message,
            "severity": self.severity,
        }


@dataclass(frozen=True)
class Checked:
    """A file that was checked.

    Attributes:
        path: as given.
        summary: what it is, a few words; empty if it cannot be used.
        findings: all there is to say.
    """

    path: str
    summary: str
    findings: tuple[Finding, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether nothing keeps it from being used."""
        return all(finding.severity != ERROR for finding in self.findings)


def failed(path: str, error: InputError) -> Checked:
    """A file that cannot be used."""
    return Checked(path, "", tuple(Finding(problem, ERROR) for problem in error.problems))


def usable(path: str, summary: str, warnings: Iterable[str] = (), notes: Iterable[str] = ()) -> Checked:
    """A file that can be used, with what is to be known about it."""
    remarks = [(WARNING, message) for message in warnings] + [(NOTE, message) for message in notes]
    findings = tuple(Finding(Problem(path, 0, message), severity) for severity, message in remarks)
    return Checked(path, summary, findings)
