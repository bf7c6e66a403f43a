"""Description of the table of a study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vsacli.results.store.study_table import StoredStudy
from vsacli.studies.sweeps import StudySummary


def describe_study(path: str) -> dict[str, Any]:
    """Describe a study table as JSON values: findings, varying parameters, provenance, inputs with SHA-256.

    Raises:
        InputError: the file is damaged.
    """
    with StoredStudy(path) as table:
        provenance = table.provenance()
        inputs = [
            {"path": stored_input.path, "sha256": stored_input.sha256} for stored_input in table.inputs()
        ]
        return {
            "kind": "table of a study",
            **StudySummary.of(table).as_json(),
            "parameters": [_describe_parameter(table, path) for path in table.parameters],
            "columns": list(table.columns),
            "provenance": {"created": str(table.attributes["created"]), **provenance, "inputs": inputs},
        }


def _describe_parameter(table: StoredStudy, path: str) -> dict[str, Any]:
    """Describe the values of a parameter: all texts, or range and count of distinct numbers."""
    if table.parameter_is_text(path):
        return {"path": path, "values": sorted(set(table.texts(path)))}
    values = table.read(path)
    low, high = (float(values.min()), float(values.max())) if len(values) else (None, None)
    distinct_count = len(np.unique(values))
    return {"path": path, "units": table.unit(path), "min": low, "max": high, "different": distinct_count}


def study_lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the description of a study table as lines of text."""
    yield str(StudySummary.from_json(table))
    provenance = table["provenance"]
    yield f"created {provenance['created']} with NumPy {provenance['numpy']}, engine {provenance['engine']}"
    yield f"method {provenance['method']}, seed {provenance['seed']}"
    yield f"command line: {provenance['command_line']}"
    yield from (f"input {each['path']}, SHA-256 {each['sha256']}" for each in provenance["inputs"])
    for each in table["parameters"]:
        if "values" in each:
            yield f"{each['path']}: {', '.join(each['values'])}"
        elif each["different"] == 1:
            yield f"{each['path']}: {each['min']:.6g} {each['units']}"
        else:
            span = f"{each['min']:.6g} to {each['max']:.6g} {each['units']}"
            yield f"{each['path']}: {span}, {each['different']} values"
    yield f"columns: {', '.join(table['columns'])}"
