"""Links of a robot by what was found of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vsacli.robot.model import Robot
from vsacli.studies.identification.estimation.solution import Solution
from vsacli.studies.identification.links.consistent_links import (
    WITHIN,
    ConsistentLinks,
    Told,
    consistent_links,
)
from vsacli.studies.identification.links.link_system import LinkSystem


def found_links(robot: Robot, found: Solution) -> ConsistentLinks:
    """Links that are bodies, nearest to the robot's, by the solution of a system of links."""
    assert isinstance(found.system, LinkSystem), "of links"
    return consistent_links(robot, _told(found.system, found))


def _told(system: LinkSystem, found: Solution) -> Told:
    """What can be told of base parameters, one by one or in combinations, at the other numbers found."""
    fit, base = found.fit, system.base
    combined = {each.terms[0][0]: each.terms for each in fit.inseparable}
    first = [at for at in range(len(fit.values)) if at in combined or np.isfinite(fit.standard_errors[at])]
    rows = np.zeros((len(first), len(fit.values)))
    for row, at in zip(rows, first, strict=True):
        for place, factor in combined.get(at, ((at, 1.0),)):
            row[place] = factor
    of_base = rows[:, : len(base.kept)]
    there = np.flatnonzero(of_base.any(axis=1))
    among = np.array(first)[there]
    return Told(
        shares=of_base[there] @ base.shares,
        values=of_base[there] @ fit.solution[: len(base.kept)],
        covariance=fit.covariance[np.ix_(among, among)],
    )


def doubts_of(links: ConsistentLinks) -> Iterator[str]:
    """What to say if bodies cannot have what was found."""
    if not links.within:
        off = np.abs(links.off).max()
        yield (
            "no bodies near the links of the file have the base parameters found: "
            f"some are {off:.2g} standard errors off, more than {WITHIN:g}, so the links stay as they are; "
            "do forces act on the arm?"
        )
