"""Inverse dynamics (36)-(74) over blocks of samples, forward dynamics (5), energy and losses.

The inverse dynamics is `inverse`: `recursion` for the links, `drive` for each joint. Read them in this order.
"""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.dynamics.elastic_torques import link_torques
    from vsacli.dynamics.forward import State, mass_matrix, state_derivative
    from vsacli.dynamics.inverse import motor_torques

__all__ = [
    "State",
    "link_torques",
    "mass_matrix",
    "motor_torques",
    "state_derivative",
]
__getattr__, __dir__ = lazy_exports(__name__)
