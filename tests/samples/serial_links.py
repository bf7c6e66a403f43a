"""Inputs of the recursion for a chain of links."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.compute.vector import Vector
from vsacli.dynamics.recursion_inputs import Carrier, JointState, LinkConstants, RecursionInputs, ToolLoad


def serial_links(
    links: Sequence[LinkConstants],
    states: Sequence[JointState],
    gravity: Vector,
    load: ToolLoad | None = None,
) -> RecursionInputs:
    """Each link carries the next joint at its frame; the last one may carry a load."""
    carriers = [Carrier(index - 1) for index in range(len(links))]
    return RecursionInputs(links, states, carriers, gravity, [] if load is None else [load])
