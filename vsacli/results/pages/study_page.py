"""The page of one or several study tables: margin and cost of each run over the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, IndexArray, evenly
from vsacli.base.tables import ReportText
from vsacli.base.texts import one_line
from vsacli.results.charts.study_points import StudyPoints, verdict_counts_text, verdict_label
from vsacli.results.pages.document import PageTexts, input_text, plotting_library, rendered
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
        "studies": [_study(points, packed) for points in studies],
    }
    texts = [_texts(*each) for each in zip(studies, tables, reports, strict=True)]
    return rendered(library, " / ".join(points.title for points in studies), texts, data, packed)


def _study(points: StudyPoints, packed: Packed) -> dict[str, Any]:
    """Return the values of a study for the scripts, with arrays of the drawn runs."""
    drawn = _drawn(points)
    ok, every = (_curve(points, chosen, packed) for chosen in (points.ok, np.ones_like(points.ok)))
    first_limits = [points.first_limits[row] for row in drawn]
    return {
        "label": points.name,
        "of": len(points.runs),
        "runs": [int(run) for run in points.runs[drawn]],
        "verdicts": [verdict_label(points.verdicts[row]) for row in drawn],
        "verdicts_drawn": [verdict_label(verdict) for verdict in points.counts],
        "first_limits": first_limits if any(first_limits) else None,
        "margin": packed.add(100 * points.margin[drawn]),
        "cost": None if points.cost is None else packed.add(points.cost[1][drawn]),
        "cost_words": "" if points.cost is None else points.cost[0],
        "front": [] if points.cost is None else np.searchsorted(drawn, points.front).tolist(),
        "worst": np.searchsorted(drawn, points.worst).tolist(),
        "varying": [
            {"words": points.words(path), "unit": points.unit(path), "values": packed.add(values[drawn])}
            for path, values in points.varying.items()
        ],
        "shares": ", ".join(points.shares_lines),
        "exceedance": ok,
        "exceedance_of_all": None if points.ok.all() else every,
    }


def _curve(points: StudyPoints, chosen: BoolArray, packed: Packed) -> dict[str, int]:
    """Return the arrays of the share of chosen runs, %, with at least each margin, %."""
    margins, shares = points.exceedance(chosen)
    kept = evenly(len(margins), MOST_RUNS)
    return {"margins": packed.add(100 * margins[kept]), "shares": packed.add(100 * shares.values[kept])}


def _drawn(points: StudyPoints) -> IndexArray:
    """Return the rows to draw: all, or `MOST_RUNS` and in addition the worst rows and the front."""
    chosen = [evenly(len(points.runs), MOST_RUNS), points.worst]
    if points.cost is not None:
        chosen.append(points.front)
    return np.unique(np.concatenate(chosen))


def _texts(points: StudyPoints, table: StoredStudy, report: ReportText) -> PageTexts:
    made = table.provenance()
    return PageTexts(
        title=points.title,
        label=points.name,
        verdict=verdict_counts_text(points.counts),
        tone="good" if points.ok.all() else "fair" if points.ok.any() else "bad",
        report=report,
        provenance=[(name.replace("_", " "), one_line(text)) for name, text in made.items() if text],
        inputs=[input_text(each) for each in table.inputs()],
    )
