"""Operations of recorded inverse dynamics grow with the joints and the depths of loaded tools, no faster."""

from __future__ import annotations

import pytest
from samples.trees import hand

from vsacli import Robot
from vsacli.base.wrench import WrenchFrame
from vsacli.compute.tracing import Tape
from vsacli.control.codegen.cost import worst_cost
from vsacli.dynamics.elastic_torques import LinkTorques


def operations(robot: Robot, frame: WrenchFrame | None) -> int:
    """Of tau_e, dtau_e and ddtau_e at a sample."""
    kernel, tape = LinkTorques(robot, frame), Tape()
    return worst_cost(tape.program(kernel(tape.inputs(kernel.arguments.size)))).operations


@pytest.mark.parametrize("frame", [None, "end_effector", "base"])
def test_a_finger_costs_the_same_however_many_there_are(frame: str | None) -> None:
    costs = {fingers: operations(hand(fingers, 2), frame and (frame,) * fingers) for fingers in (1, 2, 4)}
    assert costs[4] - costs[2] == 2 * (costs[2] - costs[1])
