"""Sources of the parameters of a robot: words of data sheets, CAD programs, or a measurement."""

from __future__ import annotations

_SPRING = "Data sheet: torque over deflection, to which the coefficients are fitted"

SOURCES = {
    "DenavitHartenberg.a": "From the drawing or CAD",
    "Link.mass": "From CAD, or weighed",
    "Link.com": "From CAD, in this frame",
    "Link.inertia": "From CAD, about the center of mass",
    "Joint.damping": "0, or measured: identify finds it",
    "Motor.inertia": "Data sheet of the motor: rotor inertia, with side: shaft",
    "Motor.damping": "Data sheet: torque constant * no-load current / no-load speed",
    "Motor.max_torque": "Data sheet: peak torque of motor or gear, the smaller one",
    "Motor.max_velocity": "Data sheet: maximum speed; 1 rpm is pi/30 rad/s",
    "Motor.gear_ratio": "Data sheet of the gear: reduction",
    "Motor.torque_constant": "Data sheet, or 30/pi divided by the speed constant in rpm/V",
    "Motor.resistance": "Data sheet: terminal resistance",
    "Motor.max_current": "Data sheet: peak current of motor or driver, the smaller one",
    "Motor.max_voltage": "Data sheet of the driver: supply voltage",
    "Antagonistic.spring": _SPRING,
    "Elastic.stiffness": "Data sheet of spring, gear or torque sensor: torsional stiffness",
    "Elastic.spring": _SPRING,
    "Serial.mechanism": "Lengths from the drawing, stiffness from the data sheet of its springs",
    "Limits.position": "From the drawing: mechanical stops",
    "Limits.velocity": "Data sheet of the motor: maximum speed over gear_ratio",
    "Limits.stiffness": "Data sheet of the actuator: stiffness range",
}
"""Source of the value of a field, by `Class.field`."""
