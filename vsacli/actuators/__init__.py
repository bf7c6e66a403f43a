"""Actuators of the joints: motors, friction and dampers, spring laws, and the kinds of actuator."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.actuators import laws, mechanisms
    from vsacli.actuators.antagonistic import Antagonistic
    from vsacli.actuators.damper import Damper
    from vsacli.actuators.elastic import Elastic
    from vsacli.actuators.friction import Friction
    from vsacli.actuators.motor import Motor
    from vsacli.actuators.rigid import Rigid
    from vsacli.actuators.serial import Serial

__all__ = [
    "Antagonistic",
    "Damper",
    "Elastic",
    "Friction",
    "Motor",
    "Rigid",
    "Serial",
    "laws",
    "mechanisms",
]
__getattr__, __dir__ = lazy_exports(__name__)
