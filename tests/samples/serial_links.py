"""Inputs of the recursion for a chain of links."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.compute.vector import Vector
from vsacli.dynamics.recursion_inputs import Carrier, JointState, LinkConstants, RecursionInputs


def serial_links(
    links: Sequence[LinkConstants],
    states: Sequence[JointState],
    gravity: Vector,
) -> RecursionInputs:
    """Each link carries the next joint at its frame."""
    carriers = [Carrier(index - 1) for index in range(len(links))]
    return RecursionInputs(links, states, carriers, gravity)
