"""The kinds of actuator."""

from __future__ import annotations

from typing import TypeAlias

from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.rigid import Rigid

Actuator: TypeAlias = Antagonistic | Elastic | Rigid

ACTUATORS: dict[str, type[Actuator]] = {"antagonistic": Antagonistic, "elastic": Elastic, "rigid": Rigid}
"""Actuators by the name they have in a robot file."""
