"""Catalogs of motors as text, and what a motor does on its shaft, worked out without the program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

COLUMNS = (
    *("name", "inertia[g cm^2]", "continuous_torque[mNm]", "max_torque[mNm]", "max_velocity[rpm]"),
    *(
        "torque_constant[mNm/A]",
        "resistance",
        "max_current",
        "max_voltage",
        "mass[g]",
        "coulomb[mNm]",
        "damping",
    ),
)
GENERIC = f"""{",".join(COLUMNS)}
flat-45,135,130,400,6000,36.9,0.464,15,24,150,3,1e-6
flat-60,830,290,1200,4300,53.4,0.293,25,24,350,8,5e-6
flat-90,3060,500,2500,2600,136,0.573,20,48,600,15,2e-5
frame-70,5000,1200,4200,3500,140,0.25,35,48,700,30,5e-5
frame-85,12000,2300,8000,3000,160,0.12,60,48,1200,50,1e-4
small-32,20,20,60,9000,20,2.5,4,24,60,0.5,1e-7
"""
"""Numbers of the size that motors have, of none that is made."""


def random_motor(rng: np.random.Generator, name: str) -> dict[str, Any]:
    """A row of a catalog, with and without what may be missing."""
    torque = 10 ** rng.uniform(-1, 1)
    motor: dict[str, Any] = {
        "name": name,
        "inertia": 10 ** rng.uniform(-6, -3),
        "continuous_torque": torque,
        "max_torque": torque * rng.uniform(1, 4),
        "max_velocity": 10 ** rng.uniform(1.5, 3),
        "damping": 10 ** rng.uniform(-7, -4),
        "coulomb": rng.choice([0.0, torque * rng.uniform(0, 0.1)]),
        "gear_efficiency": rng.choice([1.0, rng.uniform(0.5, 1)]),
    }
    if rng.random() < 0.7:
        constant = 10 ** rng.uniform(-1.5, 0)
        resistance = 10 ** rng.uniform(-1.5, 0.5)
        voltage = 1.5 * resistance * torque / constant + constant * 10 ** rng.uniform(1, 2.5)
        motor |= {"torque_constant": constant, "resistance": resistance, "max_voltage": voltage}
    return motor


def write(path: Path, motors: Sequence[dict[str, Any]]) -> Path:
    """The catalog with these motors."""
    columns = list(dict.fromkeys(name for motor in motors for name in motor))
    rows = [",".join(str(motor.get(name, "")) for name in columns) for motor in motors]
    path.write_text("\n".join([",".join(columns), *rows, ""]))
    return path


def shares_used(
    motor: dict[str, Any],
    ratio: float,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    load: np.ndarray,
    weight: np.ndarray,
) -> dict[str, float]:
    """What a motor with a gear uses of its limits for a motion on the joint's side, each (samples,).

    Sample by sample in plain arithmetic: the gear takes a share of the power, the shaft bears the rest.
    """
    squares, peak, voltage, speed = 0.0, 0.0, 0.0, 0.0
    for v, a, output, w in zip(velocity, acceleration, load, weight, strict=True):
        efficiency = motor.get("gear_efficiency", 1.0)
        way = 0.0 if abs(v) <= 1e-10 else math.copysign(1.0, v)
        through_gear = output / ratio * (1 / efficiency if output * way >= 0 else efficiency)
        torque = (
            motor["inertia"] * ratio * a
            + motor.get("damping", 0.0) * ratio * v
            + motor.get("coulomb", 0.0) * way
            + through_gear
        )
        squares += w * torque**2
        peak = max(peak, abs(torque))
        speed = max(speed, abs(ratio * v))
        if "max_voltage" in motor:
            constant = motor["torque_constant"]
            voltage = max(voltage, abs(motor["resistance"] * torque / constant + constant * ratio * v))
    used = {
        "torque": peak / motor["max_torque"],
        "continuous_torque": math.sqrt(squares / weight.sum()) / motor["continuous_torque"],
        "velocity": speed / motor["max_velocity"],
    }
    return used | ({"voltage": voltage / motor["max_voltage"]} if "max_voltage" in motor else {})
