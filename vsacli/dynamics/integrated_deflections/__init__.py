"""Deflections that follow the root of the first step: (19)-(20) integrated, instead of (14) solved anew.

Buondonno & De Luca (2016), III-B, who warn of the drift.
"""

from vsacli.dynamics.integrated_deflections.solution import IntegratedDeflections, integrate_deflections

__all__ = ["IntegratedDeflections", "integrate_deflections"]
