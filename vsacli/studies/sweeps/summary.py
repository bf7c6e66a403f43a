"""Summary of a study as text and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from vsacli.base.json_records import Stored, named
from vsacli.base.tables import ReportText, TextReport
from vsacli.base.texts import counted
from vsacli.results.charts.study_points import (
    count_verdicts,
    ok_share,
    runs_are_independent,
    verdict_counts_text,
)
from vsacli.results.store.study_table import FIRST_LIMIT, StoredStudy
from vsacli.studies.sweeps.rows import FAILED, IMPOSSIBLE

MAX_LISTED_LIMITS = 5
"""Largest number of limits that the text lists."""

MAX_LISTED_ERRORS = 3
"""Largest number of failed runs that the text lists."""


MAX_LISTED_PARAMETERS = 3
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
class OkShare(Stored):
    """Share of ok runs among random draws, with the ends of its interval of 95 % confidence."""

    share: float
    low: float
    high: float


@dataclass(frozen=True)
class StudySummary(Stored, TextReport):
    """The findings of a study.

    Attributes:
        study, robot: names of study and robot.
        runs: number of runs in the table.
        verdicts: number of runs by verdict, ok first.
        failures: runs that could not be computed.
        worst: smallest margin of each joint that has one.
        warnings: warnings about the study.
        ok_share: share of ok runs; None if the runs are not independent random draws.
        first_limits: number of runs by joint and limit that they exceed first.
    """

    study: str
    robot: str
    runs: int
    verdicts: dict[str, int]
    failures: tuple[Failure, ...]
    worst: tuple[Extreme, ...]
    warnings: tuple[str, ...] = ()
    ok_share: OkShare | None = None
    first_limits: dict[str, int] = field(default_factory=dict)

    format: ClassVar = "vsacli-study-summary/1"
    shape: ClassVar = {
        **named("format", "study", "robot", "runs", "verdicts"),
        "ok_share?": "ok_share",
        "first_limits?": "first_limits",
        **named("failures", "worst"),
        "warnings?": "warnings",
    }

    @classmethod
    def of(cls, table: StoredStudy) -> StudySummary:
        """Return the summary of a table."""
        verdicts, errors, runs = table.texts("verdict"), table.texts("error"), table.read("run").tolist()
        counts, random = count_verdicts(verdicts), table.rows > 0 and runs_are_independent(table)
        return cls(
            study=table.study_name,
            robot=table.robot_name,
            runs=table.rows,
            verdicts=counts,
            failures=tuple(
                Failure(run, error)
                for run, verdict, error in zip(runs, verdicts, errors, strict=True)
                if verdict == FAILED
            ),
            worst=tuple(_worst(table)),
            warnings=() if table.parameters or table.runs > 1 else ("nothing varies; add vary:",),
            ok_share=OkShare(*ok_share(counts)) if random else None,
            first_limits=dict(Counter(filter(None, table.texts(FIRST_LIMIT))).most_common()),
        )

    @property
    def title(self) -> str:
        """Name of the study, number of runs, and how many have each verdict."""
        counts = verdict_counts_text(self.verdicts)
        runs = f"{self.study}: {counted(self.runs, 'run')} of {self.robot}"
        return f"{runs}: {counts}" if counts else runs

    def as_text(self) -> ReportText:
        """Return the report in parts."""
        lines = [] if self.ok_share is None else [_share_line(self.ok_share)]
        lines += [f"run {each.run} failed: {each.error}" for each in self.failures[:MAX_LISTED_ERRORS]]
        if len(self.failures) > MAX_LISTED_ERRORS:
            others = counted(len(self.failures) - MAX_LISTED_ERRORS, "other run")
            lines.append(f"{others} failed; the column error of the table says why")
        return ReportText(self.title, list(self._findings()), [self._rows()], lines)

    def _findings(self) -> Iterator[str]:
        yield from (f"warning: {warning}" for warning in self.warnings)
        run_count = sum(self.verdicts.get(verdict, 0) for verdict in ("infeasible", "singular"))
        if run_count:
            runs = counted(run_count, "run")
            yield f"infeasible or singular samples in {runs}; peaks and energies there are NaN"
        if impossible := self.verdicts.get(IMPOSSIBLE, 0):
            runs = counted(impossible, "run")
            yield f"nothing feasible was found in {runs}; the column error of the table says why"
        if self.first_limits:
            limit_texts = [f"{limit} ({counted(runs, 'run')})" for limit, runs in self.first_limits.items()]
            other_count = len(limit_texts) - MAX_LISTED_LIMITS
            limit_texts[MAX_LISTED_LIMITS:] = (
                [f"and {counted(other_count, 'other limit')}"] if other_count > 0 else []
            )
            yield f"first limit exceeded: {', '.join(limit_texts)}"

    def _rows(self) -> list[tuple[str, ...]]:
        """Return the table of the smallest margin of each joint, smallest first."""
        if not self.worst:
            return []
        varied_paths = list(dict.fromkeys(path for each in self.worst for path in each.at))
        varied_paths = varied_paths if len(varied_paths) <= MAX_LISTED_PARAMETERS else []
        rows = [("joint", "smallest margin\n%", "run", *varied_paths)]
        rows += [
            (
                each.joint,
                f"{100 * each.margin:.3g}",
                f"{each.run}",
                *(each.at.get(path, "-") for path in varied_paths),
            )
            for each in sorted(self.worst, key=lambda each: each.margin)
        ]
        return rows


def _share_line(ok: OkShare) -> str:
    share, low_end, high_end = (f"{100 * each:.3g}" for each in (ok.share, ok.low, ok.high))
    return f"share of ok runs: {share} %, 95 % confidence interval {low_end} to {high_end} %"


def _worst(table: StoredStudy) -> list[Extreme]:
    if "margin" not in table.columns or not table.rows:
        return []
    margins, runs = table.read("margin"), table.read("run")
    found = []
    for index, joint in enumerate(table.joint_names):
        if np.isfinite(margins[:, index]).any():
            row = int(np.nanargmin(margins[:, index]))
            found.append(
                Extreme(joint, float(margins[row, index]), int(runs[row]), _differing_values(table, row))
            )
    return found


def _differing_values(table: StoredStudy, row: int) -> dict[str, str]:
    """Return the values of a row that differ between rows."""
    shown = {}
    for path in (*table.parameters, "trajectory"):
        is_text = table.parameter_is_text(path)
        values = table.texts(path) if is_text else table.read(path).tolist()
        if len(set(values)) > 1:
            value = values[row] if is_text else f"{values[row]:.6g} {table.unit(path)}"
            shown[path] = value.strip().removesuffix(" 1")
    return shown
