"""Description of a result or a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vsacli.analysis.report import Report
from vsacli.base.tables import ReportText, aligned
from vsacli.base.texts import counted
from vsacli.base.units import Quantity
from vsacli.documents.reading import format_changes
from vsacli.results.store.reader import StoredResult
from vsacli.robot.model import END_EFFECTOR


def describe_result(result: StoredResult) -> dict[str, Any]:
    """Describe a result or simulation as JSON values: provenance, inputs with SHA-256, variables, report.

    Raises:
        InputError: the file is damaged.
    """
    tools = {} if result.tool_names == (END_EFFECTOR,) else {"tools": list(result.tool_names)}
    return {
        "kind": result.kind,
        "robot": result.robot_name,
        "trajectory": result.trajectory_name,
        "verdict": result.verdict,
        "complete": result.complete,
        "samples": result.time.size,
        "joints": [
            {"name": name, "type": joint_type, "actuator": actuator}
            for name, joint_type, actuator in zip(
                result.joint_names, result.joint_types, result.actuators, strict=True
            )
        ],
        **tools,
        "provenance": result.provenance(),
        "variables": [
            {
                "name": name,
                "dims": ["time", *result.declared[name].dims],
                "units": _units(result.declared[name].quantity, result.joint_types),
                "meaning": result.declared[name].long_name,
            }
            for name in result.variables
        ],
        "report": result.report_json,
    }


def _units(quantity: Quantity, joint_types: tuple[str, ...]) -> str:
    found = {quantity.unit(joint_type) for joint_type in joint_types}
    return found.pop() if len(found) == 1 else str(quantity)


def result_lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the description of a result or a simulation as lines of text."""
    whole, samples = "" if result["complete"] else ", ended early", counted(result["samples"], "sample")
    yield f"{result['kind']} of {result['robot']}, {result['trajectory']}: {samples}{whole}"
    yield f"verdict {result['verdict']}"
    source = result["provenance"]
    versions = ", ".join(f"{name} {version}" for name, version in source["versions"].items())
    yield f"created {source['created']} by {source['generated_by']} ({versions})"
    yield f"command line: {source['command_line']}"
    if "engine" in source:
        compiled = f", compiled by {source['compiler']}, threads: {source['threads']}"
        yield f"engine: {source['engine']}{compiled if source['compiler'] else ''}"
    if "precision" in source:
        yield f"values stored in {source['precision']} precision"
    for each in source["inputs"]:
        yield f"input {each['path']}, SHA-256 {each['sha256']}"
        yield from (f"  with --set {change}" for change in format_changes(each.get("changes", {})))
    rows = [("joint", "type", "actuator")]
    rows += [(joint["name"], joint["type"], joint["actuator"]) for joint in result["joints"]]
    yield from ("", *aligned(rows))
    if result.get("tools"):
        yield f"tools {', '.join(result['tools'])}"
    yield ""
    yield from _left(
        [
            (each["name"], ", ".join(each["dims"]), each["units"], each["meaning"])
            for each in result["variables"]
        ]
    )
    yield from ("", str(stored_report(result["kind"], result["report"])))


def _left(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield a table with all columns aligned left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()


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
