"""Inputs of figures by hand: motions of a motor, a recorded signal, a joint before and after a search."""

from __future__ import annotations

import math

import numpy as np

from vsacli.results.charts.measured import AmplitudeSpectrum, HighestDerivative, RecordedCurve
from vsacli.results.charts.optimum import JointMotion, OptimizedJoint
from vsacli.results.charts.reduction import Curve
from vsacli.results.plots import MotorLimits, TorqueSpeed

TIME = np.linspace(0, 10, 400)
PLACE = np.linspace(0.0, 2.0, 50)
FREQUENCIES = np.geomspace(0.5, 100, 50)
LIMITED = MotorLimits(5.0, 2.0, 3.0, math.inf, 0.0, 0.0)
FREE = MotorLimits(math.inf, math.inf, math.inf, math.inf, 0.0, 0.0)


def motor(bounds: MotorLimits) -> TorqueSpeed:
    time = np.linspace(0, 6, 100)
    runs = {"fast": (np.sin(time), np.cos(time)), "slow": (np.sin(time) / 2, np.cos(time))}
    return TorqueSpeed("elbow, motor 1", "joint side", "N m", "rad/s", bounds, runs, (0.7, 0.7))


def curve(
    name: str = "elbow.q", *, rms: float = 1e-4, cutoff: float = 5.0, above: float = np.nan
) -> RecordedCurve:
    """A sine with noise that a spline leaves."""
    residual = rms * np.cos(900 * TIME)
    motion = FREQUENCIES**-4.0
    return RecordedCurve(
        name=name,
        unit="rad",
        fit="smoothed" if rms else "interpolated",
        knots=65,
        recorded=Curve(TIME, np.sin(TIME) + residual),
        fitted=Curve(TIME, np.sin(TIME)),
        residual=Curve(TIME, residual),
        rms=rms,
        noise=1e-4,
        inside=(0.5, 9.0),
        spectrum=AmplitudeSpectrum(FREQUENCIES, motion + 1e-5, motion, 1e-5, cutoff, above),
        highest=HighestDerivative("d4q", "rad/s^4", 4, 0.0123 if rms else np.nan),
    )


def moved(stiffness: float) -> JointMotion:
    """A motion with constant stiffness and torques."""
    rows = np.full_like(PLACE, stiffness)
    return JointMotion(PLACE, rows, 0.5 * rows, 2 * rows, np.stack([rows / 10, -rows / 10]))


def joint(name: str, stiffness: float = 900.0, limit: float = np.inf) -> OptimizedJoint:
    """A joint whose optimum has 0.9 times the commanded stiffness and torques."""
    return OptimizedJoint(
        name, "revolute", moved(stiffness), moved(0.9 * stiffness), np.array([[-limit, limit]] * 2)
    )
