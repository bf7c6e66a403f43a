"""Mechanisms of serial actuators, and the names that a user-defined mechanism needs.

To add a mechanism, derive a class from `Mechanism` and add a line to `MECHANISMS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from vsacli.base.lazy import LazyRegistry, lazy_exports

if TYPE_CHECKING:
    from vsacli.actuators.laws.law import PairSolution
    from vsacli.actuators.mechanisms.mechanism import Mechanism, Partials
    from vsacli.actuators.mechanisms.potentials.potential import BranchStart, Potential, PotentialRange
    from vsacli.actuators.mechanisms.preloaded_cams.cam import Cam
    from vsacli.actuators.mechanisms.preloaded_cams.preloaded_cam import Maccepa
    from vsacli.actuators.mechanisms.ratios.ratio import Awas, Lever, Sine
    from vsacli.actuators.mechanisms.ratios.scales import MeasuredScale, PolynomialScale, Power
    from vsacli.actuators.mechanisms.ratios.variable_ratio import VariableRatio
    from vsacli.actuators.mechanisms.shifted_cams import ShiftedCams
    from vsacli.base.units import DIMENSIONLESS, LEAD, LENGTH, LINEAR_STIFFNESS, POSITION, STIFFNESS, TORQUE
    from vsacli.documents.fields import NON_ZERO, POSITIVE, interval, number

MECHANISMS = LazyRegistry(
    {
        "awas": "vsacli.actuators.mechanisms.ratios.ratio:Awas",
        "lever": "vsacli.actuators.mechanisms.ratios.ratio:Lever",
        "variable_ratio": "vsacli.actuators.mechanisms.ratios.variable_ratio:VariableRatio",
        "maccepa": "vsacli.actuators.mechanisms.preloaded_cams.preloaded_cam:Maccepa",
        "potential": "vsacli.actuators.mechanisms.potentials.potential:Potential",
        "cam": "vsacli.actuators.mechanisms.preloaded_cams.cam:Cam",
        "shifted_cams": "vsacli.actuators.mechanisms.shifted_cams:ShiftedCams",
    }
)
"""Mechanisms by their name in a robot file."""

__all__ = [
    "DIMENSIONLESS",
    "LEAD",
    "LENGTH",
    "LINEAR_STIFFNESS",
    "MECHANISMS",
    "NON_ZERO",
    "POSITION",
    "POSITIVE",
    "STIFFNESS",
    "TORQUE",
    "Awas",
    "BranchStart",
    "Cam",
    "Lever",
    "Maccepa",
    "MeasuredScale",
    "Mechanism",
    "PairSolution",
    "Partials",
    "PolynomialScale",
    "Potential",
    "PotentialRange",
    "Power",
    "ShiftedCams",
    "Sine",
    "VariableRatio",
    "interval",
    "number",
]
__getattr__, __dir__ = lazy_exports(__name__)
