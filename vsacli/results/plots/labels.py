"""Labels of axes, with the unit that a quantity has at a type of joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from vsacli.base import units
from vsacli.base.units import Quantity
from vsacli.base.variables import MOTORS, Variable

Label = Callable[[str], str]
"""Label of an axis for a type of joint."""

_FORCES = {"revolute": "torque", "prismatic": "force"}
"""What moves a joint of a type."""


def _words(words: str, quantity: Quantity, motor: int, joint_type: str) -> str:
    force = _FORCES.get(joint_type, "torque")
    return f"{words.format(force=force, motor=motor)} [{quantity.unit(joint_type)}]"


def label(words: str, quantity: Quantity) -> Label:
    """A label in these words; `{force}` stands for what moves the joint."""
    return partial(_words, words, quantity, 0)


def motor_labels(words: str, quantity: Quantity) -> Sequence[Label]:
    """A label for each motor; `{motor}` stands for its number."""
    return [partial(_words, words, quantity, motor) for motor in MOTORS]


def variable_labels(variable: Variable) -> Sequence[Label]:
    """Names of the curves that a joint has of a variable."""
    if "motor" in variable.dims:
        return motor_labels(variable.name + "_{motor}", variable.quantity)
    return [label(variable.name, variable.quantity)]


POSITIONS = label("joint position $q$", units.POSITION)
ELASTIC_TORQUES = label(r"elastic {force} $\tau_e$", units.TORQUE)
ELASTIC_ENERGIES = label("elastic energy", units.ENERGY)
DAMPINGS = label("damping $d$", units.DAMPING)
DAMPER_TORQUES = label("{force} of the damper", units.TORQUE)
LOSSES = label("friction and damping", units.POWER)
POSITION_ERRORS = label("position error $q - q_d$", units.POSITION)
STIFFNESS_ERRORS = label(r"stiffness error $\sigma - \sigma_d$", units.STIFFNESS)

MOTOR_TORQUES = motor_labels(r"motor {force} $\tau_{motor}$", units.TORQUE)
WORK = motor_labels("work of motor {motor}", units.ENERGY)
CURRENTS = motor_labels("current of motor {motor}, $i_{motor}$", units.CURRENT)
VOLTAGES = motor_labels("voltage of motor {motor}, $u_{motor}$", units.VOLTAGE)
