"""Minima of costs with kinks, which are smoothed less and less."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from vsacli.base.arrays import FloatArray
from vsacli.studies.optimisation.criteria import Criterion, Scale
from vsacli.studies.optimisation.interior_point import WARM_GAP, Minimum, Problem, minimise


class Costed(Protocol):
    """Whatever has a cost that can be smoothed."""

    criterion: Criterion
    scale: Scale


def smoothed_minimum(problem: Problem, start: FloatArray, gap: float, costed: Sequence[Costed]) -> Minimum:
    """A minimum of a cost that is smoothed less and less, far from it at least.

    Args:
        problem: the sum of the costs, with bounds.
        start: unknowns that keep all bounds.
        gap: what bounds may raise the cost by at the first barrier.
        costed: what has these costs, all by the same criterion.
    """
    smoothings = costed[0].criterion.smoothings
    for smoothing in smoothings if gap > WARM_GAP else smoothings[-1:]:
        for each in costed:
            each.scale = each.scale._replace(smoothing=smoothing)
        found = minimise(problem, start, gap)
        start, gap = found.unknowns, WARM_GAP
    return found
