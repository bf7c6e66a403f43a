"""Summary of a study as text and as JSON."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.base.json_records import Stored, named
from vsacli.results.store.study_table import StoredStudy
from vsacli.studies.sweeps.rows import FAILED, IMPOSSIBLE

MOST_ERRORS = 3
"""Largest number of failed runs that the text lists."""


MOST_NUMBERS = 3
"""Largest number of parameters shown with a run; the table has them all."""


@dataclass(frozen=True)
class Failure(Stored):
    """A run that could not be computed: its number and the reason."""

    run: int
    error: str


@dataclass(frozen=True)
class Extreme(Stored):
    """The run in which the margin of a joint is smallest.

    Attributes:
        joint: name of the joint.
        margin: smallest relative margin.
        run: number of the run.
        at: varied values as text, by path.
    """

    joint: str
    margin: float
    run: int
    at: dict[str, str]


@dataclass(frozen=True)
class StudySummary(Stored):
    """The findings of a study.

    Attributes:
        study, robot: names of study and robot.
        runs: number of runs in the table.
        verdicts: number of runs by verdict.
        failures: runs that could not be computed.
        worst: smallest margin of each joint that has one.
    """

    study: str
    robot: str
    runs: int
    verdicts: dict[str, int]
    failures: tuple[Failure, ...]
    worst: tuple[Extreme, ...]

    format: ClassVar = "vsacli-study-summary/1"
    shape: ClassVar = named("format", "study", "robot", "runs", "verdicts", "failures", "worst")

    @classmethod
    def of(cls, table: StoredStudy) -> StudySummary:
        """Return the summary of a table."""
        verdicts, errors, runs = table.texts("verdict"), table.texts("error"), table.read("run").tolist()
        return cls(
            study=table.study_name,
            robot=table.robot_name,
            runs=table.rows,
            verdicts=dict(Counter(verdicts).most_common()),
            failures=tuple(
                Failure(run, error)
                for run, verdict, error in zip(runs, verdicts, errors, strict=True)
                if verdict == FAILED
            ),
            worst=tuple(_worst(table)),
        )

    def __str__(self) -> str:
        counts = ", ".join(f"{count:,} {verdict}" for verdict, count in self.verdicts.items())
        lines = [f"{self.study}: {self.runs:,} runs of {self.robot}: {counts or 'none'}"]
        for each in self.worst:
            few = each.at if len(each.at) <= MOST_NUMBERS else {}
            at = ", ".join(f"{path} = {value}" for path, value in few.items())
            where = f"in run {each.run}{f' ({at})' if at else ''}"
            lines.append(f"{each.joint}: smallest margin {100 * each.margin:.3g} % {where}")
        without = sum(self.verdicts.get(verdict, 0) for verdict in ("infeasible", "singular"))
        if without:
            lines.append(
                f"infeasible or singular steps in {without:,} runs; peaks and energies there are NaN"
            )
        impossible = self.verdicts.get(IMPOSSIBLE, 0)
        if impossible:
            lines.append(f"nothing feasible was found in {impossible:,} runs; error in the table says why")
        lines += [f"run {each.run} failed: {each.error}" for each in self.failures[:MOST_ERRORS]]
        if len(self.failures) > MOST_ERRORS:
            lines.append(f"and {len(self.failures) - MOST_ERRORS:,} more failed, see error in the table")
        return "\n".join(lines)


def _worst(table: StoredStudy) -> list[Extreme]:
    if "margin" not in table.columns or not table.rows:
        return []
    margins, runs = table.read("margin"), table.read("run")
    found = []
    for index, joint in enumerate(table.joint_names):
        if np.isfinite(margins[:, index]).any():
            row = int(np.nanargmin(margins[:, index]))
            found.append(Extreme(joint, float(margins[row, index]), int(runs[row]), _shown(table, row)))
    return found


def _shown(table: StoredStudy, row: int) -> dict[str, str]:
    """Return the values of a row that differ between rows."""
    shown = {}
    for path in (*table.parameters, "trajectory"):
        is_text = table.parameter_is_text(path)
        values = table.texts(path) if is_text else table.read(path).tolist()
        if len(set(values)) > 1:
            value = values[row] if is_text else f"{values[row]:.6g} {table.unit(path)}"
            shown[path] = value.strip().removesuffix(" 1")
    return shown
