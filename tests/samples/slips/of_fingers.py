"""Slips of units of all values of a kind in the files of a finger of three joints, and their warnings."""

from __future__ import annotations

import re
from typing import NamedTuple

FINGER = """format: vsacli-robot/1
name: finger
gravity: [0, -9.81, 0]
joints:
  - name: knuckle
    type: revolute
    dh: {a: 0.045, alpha: 0}
    link: {mass: 0.018, com: [-0.0225, 0, 0], inertia: {xx: 4.05e-7, yy: 3.24e-6, zz: 3.24e-6}}
    damping: 2e-4
    actuator:
      type: antagonistic
      motor: {inertia: 2e-3, damping: 5e-3, max_torque: 1.5, max_velocity: 6}
      spring:
        - {type: sinh, k: 0.0026, a: 9, max_deflection: 0.7}
        - {type: sinh, k: 0.0011, a: 9, max_deflection: 0.7}
  - name: middle
    type: revolute
    dh: {a: 0.028, alpha: 0}
    link: {mass: 0.010, com: [-0.014, 0, 0], inertia: {xx: 1.8e-7, yy: 7.4e-7, zz: 7.4e-7}}
    damping: 2e-4
    actuator:
      type: antagonistic
      motor: {inertia: 2e-9, damping: 5e-9, max_torque: 3e-3, max_velocity: 1571, gear_ratio: 100,
        side: shaft}
      spring: {type: exponential, c: 0.02, a: 4, max_deflection: 0.8}
  - name: tip
    type: revolute
    dh: {a: 0.022, alpha: 0}
    link: {mass: 0.007, com: [-0.011, 0, 0], inertia: {xx: 1.3e-7, yy: 3.5e-7, zz: 3.5e-7}}
    damping: 2e-4
    actuator:
      type: antagonistic
      motor: {inertia: 2e-9, damping: 5e-9, max_torque: 3e-3, max_velocity: 1571, gear_ratio: 100,
        side: shaft}
      spring: {type: quadratic, k: 0.2, max_deflection: 0.8}
"""

FLEXION = """format: vsacli-trajectory/1
name: flexion
duration: 1
position: {type: polynomial, degree: 9, start: 0, end: 60 deg}
stiffness:
  type: polynomial
  degree: 5
  start: {knuckle: 0.3, middle: 0.25, tip: 0.1}
  end: {knuckle: 1.0, middle: 0.8, tip: 0.3}
"""

VALUES = {
    "length": r"(?<=dh: \{a: )[\d.]+",
    "com": r"(?<=com: \[)-[\d.]+",
    "mass": r"(?<=mass: )[\d.]+",
    "inertia": r"(?<=(?:xx|yy|zz): )[\d.e-]+",
    "rotor": r"(?<=inertia: )2e-9",
    "max_velocity": r"(?<=max_velocity: )1571",
    "damping": r"(?<=\n    damping: )2e-4",
    "damping of motors": r"(?<=, damping: )5e-[39]",
    "springs of the knuckle": r"(?<=sinh, k: )[\d.]+",
    "springs of the middle": r"(?<=c: )0.02",
    "springs of the tip": r"(?<=k: )0.2(?=,)",
    "duration": r"(?<=duration: )1",
}
"""Patterns of values that are scaled."""


class Planted(NamedTuple):
    """A slip of the unit of all values of a kind.

    Attributes:
        what: in a few words.
        factors: factor on the values of `VALUES`.
        warnings: end of the field that each warning names, and what it says of its unit, in their order.
    """

    what: str
    factors: dict[str, float]
    warnings: list[tuple[str, str]]

    def of(self, text: str) -> str:
        """Return the text of a file with the slip in it."""
        for name, factor in self.factors.items():
            text = re.sub(VALUES[name], lambda each, by=factor: repr(float(each[0]) * by), text)
        return text


LENGTHS, CENTERS = "knuckle.dh.a", "knuckle.link.com.0 (x)"
MASSES, INERTIAS = "knuckle.link.mass", "knuckle.link.inertia"
MM = {"length": 1e3, "com": 1e3}
CM = {"length": 1e2, "com": 1e2}

PLANTED = [
    Planted("nothing", {}, []),
    Planted("masses in g", {"mass": 1e3}, [(MASSES, "18 g, which is 0.018 kg?")]),
    Planted("lengths in mm", MM, [(LENGTHS, "45 mm, which is 0.045 m?")]),
    Planted("lengths in cm", CM, [(LENGTHS, "4.5 cm, which is 0.045 m?")]),
    Planted("rows in mm", {"length": 1e3}, [(LENGTHS, "45 mm, which is 0.045 m?")]),
    Planted("centers of mass in mm", {"com": 1e3}, [(CENTERS, "-22.5 mm, which is -0.0225 m?")]),
    Planted("centers of mass in cm", {"com": 1e2}, [(CENTERS, "-2.25 cm, which is -0.0225 m?")]),
    Planted("inertias in kg mm^2", {"inertia": 1e6}, [(INERTIAS, "is it in kg mm^2?")]),
    Planted("inertias in kg cm^2", {"inertia": 1e4}, [(INERTIAS, "is it in kg cm^2?")]),
    Planted("inertias in g cm^2", {"inertia": 1e7}, [(INERTIAS, "is it in g cm^2?")]),
    Planted("inertias in g mm^2", {"inertia": 1e9}, [(INERTIAS, "is it in g mm^2?")]),
    Planted("mm and g", {**MM, "mass": 1e3}, [(LENGTHS, "45 mm,"), (MASSES, "18 g,")]),
    Planted(
        "mm, g and g mm^2",
        {**MM, "mass": 1e3, "inertia": 1e9},
        [(LENGTHS, "45 mm,"), (MASSES, "18 g,"), (INERTIAS, "is it in g mm^2?")],
    ),
    Planted("mm and kg mm^2", {**MM, "inertia": 1e6}, [(LENGTHS, "45 mm,"), (INERTIAS, "in kg mm^2?")]),
    Planted("cm and kg cm^2", {**CM, "inertia": 1e4}, [(LENGTHS, "4.5 cm,"), (INERTIAS, "in kg cm^2?")]),
    Planted("centers ten times too far", {"com": 10.0}, [
        (f"{name}.link.com", "did you mean a tenth of it?") for name in ("knuckle", "middle", "tip")
    ]),
    Planted("centers of the wrong sign", {"com": -1.0}, [
        (f"{name}.link.com", "did you mean the opposite sign?") for name in ("knuckle", "middle", "tip")
    ]),
    Planted("rotors in g cm^2", {"rotor": 1e7}, [("middle.actuator.motor.inertia", "0.02 g cm^2,")]),
    Planted("rotors in kg mm^2", {"rotor": 1e6}, [("middle.actuator.motor.inertia", "0.002 kg mm^2,")]),
    Planted("rotors in kg cm^2", {"rotor": 1e4}, [("middle.actuator.motor.inertia", "2e-05 kg cm^2,")]),
    Planted("rpm", {"max_velocity": 9.549}, [("middle.actuator.motor.max_velocity", "15001.5 rpm,")]),
    Planted("damping in N mm s", {"damping": 1e3}, [("knuckle.damping", "0.2 N mm s/rad,")]),
    Planted("damping of motors", {"damping of motors": 1e3},
        [("knuckle.actuator.motor.damping", "5 N mm s/rad,")]),
    Planted("springs in N mm", {"springs of the knuckle": 1e3},
        [("knuckle.actuator.spring.0", "is it in N mm/rad?")]),
    Planted("a spring in N mm", {"springs of the middle": 1e3},
        [("middle.actuator.spring", "is it in N mm/rad?")]),
    Planted("a spring without stiffness at rest in N mm", {"springs of the tip": 1e3},
        [("tip.actuator.spring", "is it in N mm/rad?")]),
    Planted("duration in ms", {"duration": 1e3}, [("duration", "1000 ms, which is 1 s?")]),
]  # fmt: skip
