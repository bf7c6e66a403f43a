"""Which numbers of the robot, as a result file holds them, bound which variable."""

from __future__ import annotations

from vsacli.base.simulation_variables import ACTUAL, MEASURED, actual, measured

RANGES = {
    "q": "limits_position",
    "dq": "limits_velocity",
    "stiffness": "limits_stiffness",
    "damping": "damper_range",
}
"""Lower and upper bound of a variable of joints, by its name."""

SIZES = {
    "phi": "actuator_spring_max_deflection",
    "dtheta": "actuator_motor_max_velocity",
    "tau_motor": "actuator_motor_max_torque",
    "current": "actuator_motor_max_current",
    "voltage": "actuator_motor_max_voltage",
}
"""Largest size of a variable of motors, by its name."""

ACHIEVED = {**{actual(name): name for name in ACTUAL}, **{measured(name): name for name in MEASURED}}
"""What simulations add, by name: bounded as what was commanded."""
