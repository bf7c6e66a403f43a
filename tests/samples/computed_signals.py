"""Motions with the torques that inverse dynamics gives, in place of records."""

from __future__ import annotations

import numpy as np

from samples.shipped import shipped_run
from vsacli import Robot, inverse_dynamics
from vsacli.studies.identification.conditioning import ConditionedRecording, Filter


def computed_signals(robot: str, trajectory: str) -> tuple[Robot, ConditionedRecording]:
    """A robot that comes along, and what would be measured of it without noise."""
    loaded, motion = shipped_run(robot, trajectory)
    run = inverse_dynamics(loaded, motion)
    names = ("time", "q", "dq", "ddq", "theta", "dtheta", "ddtheta", "tau_motor")
    rate = (len(run.time) - 1) / float(run.time[-1])
    arrays: list[np.ndarray] = [getattr(run, name) for name in names]
    return loaded, ConditionedRecording(*arrays, rate=rate, filter=Filter.low_pass(rate / 20, rate))
