"""The page of one or several study tables: margin and cost of each run over the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, IndexArray, evenly
from vsacli.base.tables import ReportText
from vsacli.base.texts import one_line
from vsacli.results.charts.study_points import StudyPoints, verdict_counts_text, verdict_label
from vsacli.results.pages.document import PageTexts, input_text, plotting_library, render_page
from vsacli.results.pages.packing import Packed
from vsacli.results.store.study_table import StoredStudy

MOST_RUNS = 20_000
"""Maximum number of points in a plot; more slow a browser down and hide one another."""


def study_page(tables: Sequence[StoredStudy], reports: Sequence[ReportText]) -> str:
    """Return the page of study tables, as HTML.

    Args:
        tables: open tables.
        reports: report of each study.

    Raises:
        InputError: a table has no margins, or no rows, or is damaged; or a library that pages need is not
            installed.
    """
    library, packed = plotting_library(), Packed()
    studies = [StudyPoints(table) for table in tables]
    data = {
        "kind": "study",
        "studies": [_study_values(points, packed) for points in studies],
    }
    texts = [_page_texts(*study) for study in zip(studies, tables, reports, strict=True)]
    return render_page(library, " / ".join(points.title for points in studies), texts, data, packed)


def _study_values(points: StudyPoints, packed: Packed) -> dict[str, Any]:
    """Return the values of a study for the scripts, with arrays of the drawn runs."""
    rows = _drawn_rows(points)
    ok_curve, all_curve = (
        _exceedance_curve(points, mask, packed) for mask in (points.ok, np.ones_like(points.ok))
    )
    first_limits = [points.first_limits[row] for row in rows]
    return {
        "label": points.name,
        "of": len(points.runs),
        "runs": [int(run) for run in points.runs[rows]],
        "verdicts": [verdict_label(points.verdicts[row]) for row in rows],
        "verdicts_drawn": [verdict_label(verdict) for verdict in points.counts],
        "first_limits": first_limits if any(first_limits) else None,
        "margin": packed.add(100 * points.margin[rows]),
        "cost": None if points.cost is None else packed.add(points.cost[1][rows]),
        "cost_words": "" if points.cost is None else points.cost[0],
        "front": [] if points.cost is None else np.searchsorted(rows, points.front).tolist(),
        "worst": np.searchsorted(rows, points.worst).tolist(),
        "varying": [
            {"words": points.words(path), "unit": points.unit(path), "values": packed.add(values[rows])}
            for path, values in points.varying.items()
        ],
        "shares": ", ".join(points.shares_lines),
        "exceedance": ok_curve,
        "exceedance_of_all": None if points.ok.all() else all_curve,
    }


def _exceedance_curve(points: StudyPoints, mask: BoolArray, packed: Packed) -> dict[str, int]:
    """Return the arrays of the share of chosen runs, %, with at least each margin, %."""
    margins, shares = points.exceedance(mask)
    indices = evenly(len(margins), MOST_RUNS)
    return {"margins": packed.add(100 * margins[indices]), "shares": packed.add(100 * shares.values[indices])}


def _drawn_rows(points: StudyPoints) -> IndexArray:
    """Return the rows to draw: all, or `MOST_RUNS` and in addition the worst rows and the front."""
    row_groups = [evenly(len(points.runs), MOST_RUNS), points.worst]
    if points.cost is not None:
        row_groups.append(points.front)
    return np.unique(np.concatenate(row_groups))


def _page_texts(points: StudyPoints, table: StoredStudy, report: ReportText) -> PageTexts:
    provenance = table.provenance()
    return PageTexts(
        title=points.title,
        label=points.name,
        verdict=verdict_counts_text(points.counts),
        tone="good" if points.ok.all() else "fair" if points.ok.any() else "bad",
        report=report,
        provenance=[(name.replace("_", " "), one_line(text)) for name, text in provenance.items() if text],
        inputs=[input_text(stored_input) for stored_input in table.inputs()],
    )
