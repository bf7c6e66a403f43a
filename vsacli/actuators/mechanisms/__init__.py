"""Mechanisms of serial actuators: springs between a motor that carries the load and one that sets them.

Adding a mechanism is adding a class derived from `Mechanism` and its line in `MECHANISMS`.
"""

from __future__ import annotations

from vsacli.base.lazy import LazyRegistry

MECHANISMS = LazyRegistry(
    {
        "awas": "vsacli.actuators.mechanisms.ratios.awas:Awas",
        "lever": "vsacli.actuators.mechanisms.ratios.lever:Lever",
        "variable_ratio": "vsacli.actuators.mechanisms.ratios.variable_ratio:VariableRatio",
        "maccepa": "vsacli.actuators.mechanisms.preloaded_cams.maccepa:Maccepa",
        "potential": "vsacli.actuators.mechanisms.potential:Potential",
        "cam": "vsacli.actuators.mechanisms.preloaded_cams.cam:Cam",
        "shifted_cams": "vsacli.actuators.mechanisms.shifted_cams:ShiftedCams",
    }
)
"""Mechanisms by the name they have in a robot file."""
