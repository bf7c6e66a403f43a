"""Stretches of time that a page shades: steps that cannot be done, and those whose numbers are doubtful."""

from __future__ import annotations

import numpy as np

from vsacli.base.flags import LIMITS, Flag, has
from vsacli.results.envelopes import marked_spans
from vsacli.results.store.damage import reporting_damage
from vsacli.results.store.reader import StoredResult

KINDS = {
    "infeasible": Flag.INFEASIBLE,
    "singular": Flag.SINGULAR,
    "near-singular": Flag.NEAR_SINGULAR,
    "over a limit": LIMITS,
}
"""What may be wrong with a step, by the bits that say so."""

DOUBTFUL = "doubtful"
"""The ends of a record, where its derivatives are."""

Spans = list[list[float]]
"""Start and end of each stretch, s."""


def troubles(result: StoredResult) -> dict[str, list[Spans]]:
    """The stretches of each kind of trouble, those of each joint; only kinds that there are."""
    if "flags" not in result.variables:
        return {}
    flags = np.asarray(result.read("flags"), dtype=np.uint16)
    marked = {kind: has(flags, bits) for kind, bits in KINDS.items()}
    return {
        kind: [marked_spans(result.time, of_joint).tolist() for of_joint in where.T]
        for kind, where in marked.items()
        if where.any()
    }


def doubtful(result: StoredResult) -> Spans:
    """The stretches at both ends of a record where derivatives of what was fitted to it are doubtful.

    Raises:
        InputError: the report is damaged.
    """
    with reporting_damage(result.path, "report"):
        columns = [column for fit in result.report_json.get("fits", ()) for column in fit["columns"]]
        ends = [column["doubtful"] for column in columns if "doubtful" in column]
        start, end = (max((float(each[side]) for each in ends), default=0.0) for side in ("start", "end"))
    if not start and not end:
        return []
    first, last = result.whole_span()
    shown = float(result.time[0]), float(result.time[-1])
    spans = (first, first + start), (last - end, last)
    clipped = [[max(ends[0], shown[0]), min(ends[1], shown[1])] for ends in spans]
    return [span for span in clipped if span[0] < span[1]]
