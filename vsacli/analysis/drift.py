"""How far followed deflections get from the root of (14), over blocks of steps."""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.antagonistic import Antagonistic, solve_deflections
from vsacli.analysis.report import JointDrift
from vsacli.base.variables import VARIABLES, Block
from vsacli.dynamics.integrated_deflections import Stop
from vsacli.robot.model import Joint


class DriftTally:
    """Running record of one antagonistic joint; `add` blocks in order, then ask for the `report`."""

    def __init__(self, joint: Joint, actuator: Antagonistic, index: int, stop: Stop | None) -> None:
        self._joint = joint
        self._actuator = actuator
        self._index = index
        self._stop = stop
        self._largest, self._time = math.nan, math.nan

    def add(self, block: Block) -> None:
        """Merge a block of steps; those without deflections do not count."""
        tau_e, stiffness = block.tau_e[:, self._index], block.stiffness[:, self._index]
        root = solve_deflections(self._actuator, tau_e, stiffness).deflections
        drift = np.abs(block.phi[:, self._index].T - root).max(axis=0)
        followed = np.flatnonzero(~np.isnan(drift))
        if followed.size:
            step = followed[drift[followed].argmax()]
            if not drift[step] <= self._largest:
                self._largest, self._time = float(drift[step]), float(block.time[step])

    def report(self) -> JointDrift:
        """What was found so far."""
        unit = VARIABLES["phi"].quantity.unit(self._joint.type)
        return JointDrift(self._joint.name, self._largest, self._time, unit, self._stop)
