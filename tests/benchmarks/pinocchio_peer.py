"""Peer 2: Pinocchio's recursion for each sample in a Python loop, and finite differences of its torques."""

from __future__ import annotations

import numpy as np
import pinocchio
from oracles.pinocchio import build

from vsacli import Robot


def link_torques(robot: Robot, motion: list[np.ndarray], step: float) -> tuple[np.ndarray, ...]:
    """tau_e, and its first two derivatives by central differences over samples `step` seconds apart."""
    model = build(robot)
    data = model.createData()
    damping = np.array([joint.damping for joint in robot.joints])
    q, dq, ddq = motion[:3]
    tau = np.array([pinocchio.rnea(model, data, *row).copy() for row in zip(q, dq, ddq, strict=True)])
    tau += damping * dq
    dtau = np.gradient(tau, step, axis=0, edge_order=2)
    return tau, dtau, np.gradient(dtau, step, axis=0, edge_order=2)
