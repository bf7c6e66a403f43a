"""A result or simulation file: where it comes from, what it holds, what its report says."""

from __future__ import annotations

from typing import Any

from vsacli.base.units import Quantity
from vsacli.results.store.reader import StoredResult


def describe_result(result: StoredResult) -> dict[str, Any]:
    """A result or simulation as JSON values: provenance, inputs with their SHA-256, variables, report.

    Raises:
        InputError: the file is damaged.
    """
    return {
        "kind": result.kind,
        "robot": result.robot_name,
        "trajectory": result.trajectory_name,
        "verdict": result.verdict,
        "complete": result.complete,
        "samples": result.samples,
        "joints": [
            {"name": name, "type": joint_type, "actuator": actuator}
            for name, joint_type, actuator in zip(
                result.joint_names, result.joint_types, result.actuators, strict=True
            )
        ],
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
        "report": result.report,
    }


def _units(quantity: Quantity, joint_types: tuple[str, ...]) -> str:
    found = {quantity.unit(joint_type) for joint_type in joint_types}
    return found.pop() if len(found) == 1 else str(quantity)
