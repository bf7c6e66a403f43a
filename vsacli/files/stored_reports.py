"""The report that a result file or a simulation holds, as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsacli.analysis.report import Report
from vsacli.base.tables import ReportText


def stored_report(kind: str, content: Mapping[str, Any]) -> ReportText:
    """Return the report that the command printed when it made the file.

    Args:
        kind: of the file, "result" or "simulation".
        content: the report as JSON, of any version.
    """
    from vsacli.control.simulation.simulation_report import SimulationReport

    try:
        if kind == "simulation":
            return SimulationReport.from_json(content).as_text()
        return Report.from_json(content).as_text()
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        return ReportText("its report has another form than this version writes; --json shows it", [], [])
