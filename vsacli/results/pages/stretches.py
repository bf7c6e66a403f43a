"""Stretches of time that a page shades: steps that cannot be done, and those whose numbers are doubtful."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.results.envelopes import marked_spans
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
    """The stretches at both ends of a record where derivatives of what was fitted to it are doubtful."""
    lengths = list(map(_doubtful_ends, _fits(result)))
    if not lengths:
        return []
    time: FloatArray = result.time
    start, end = np.max(lengths, axis=0)
    first, last = float(time[0]), float(time[-1])
    return [[first, min(first + start, last)], [max(last - end, first), last]] if start or end else []


def _fits(result: StoredResult) -> Sequence[Any]:
    fits = result.report_json.get("fits", ())
    return [each for each in fits if isinstance(each, Mapping)] if isinstance(fits, list) else []


def _doubtful_ends(fit: Mapping[str, Any]) -> tuple[float, float]:
    ends = fit.get("doubtful") or {}
    return float(ends.get("start") or 0), float(ends.get("end") or 0)
