"""The stored report of a result file or a simulation, as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsacli.analysis.report import Report
from vsacli.base.tables import ReportText


def stored_report(kind: str, content: Mapping[str, Any]) -> ReportText:
    """Return the report as printed by the command that made the file.

    Args:
        kind: kind of the file, "result" or "simulation".
        content: report as JSON, of any version.
    """
    from vsacli.control.simulation.simulation_report import SimulationReport

    try:
        if kind == "simulation":
            return SimulationReport.from_json(content).as_text()
        return Report.from_json(content).as_text()
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        return ReportText("its report has another form than this version writes; --json shows it")
