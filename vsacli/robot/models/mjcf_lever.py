"""A spring between a lever and a point of the link, as in the MACCEPA, in the geometry of MJCF.

Motor 1 turns a lever where it is in the device: about the axis of the joint, on the link below. Motor 2 rides
on the lever; along the axis it draws the end of a pulley away from an anchor, which is the pretension.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vsacli.actuators.spring_elements import LeverSpring
from vsacli.robot.joint import Joint
from vsacli.robot.models.mjcf_rotor import Rotor, add_rotor
from vsacli.robot.models.xml_text import Element, Value, add, element

ANCHOR = 2.0
"""Distance, m for rad, of the anchor from motor 2 at zero, which is its least while there is pretension."""

DRAWN = 0.005
"""Size of a drawn point, m."""

LEVER_COLOUR = (0.8, 0.4, 0.2, 1)

GHOST: dict[str, Value] = {"contype": 0, "conaffinity": 0, "mass": 0}
"""What is drawn and nothing else."""

HIDDEN = 4
"""Group of what a viewer does not show unless asked: the spring is drawn along the pulley, too, a metre for a
radian."""


def draw_rod(body: Element, end: Sequence[float], radius: float, colour: Sequence[float]) -> None:
    """A rod from the origin of a body to a point, without mass and contact."""
    ends = (0, 0, 0, *end)
    element(body, "geom", type="capsule", fromto=ends, size=radius, rgba=colour, **GHOST)


def add_lever(below: Element, joint: Joint, spring: LeverSpring, rotors: Sequence[Rotor]) -> None:
    """Both motors, on the link before the joint; the lever stands along the link while both are at zero."""
    first, second = rotors
    half = joint.dh.theta / 2
    lever = add_rotor(below, first, type="hinge")
    add(lever, quat=(math.cos(half), 0, 0, math.sin(half)))
    draw_rod(lever, (spring.lever, 0, 0), DRAWN, LEVER_COLOUR)
    element(lever, "site", name=f"{joint.name}.lever", pos=(spring.lever, 0, 0), size=DRAWN)
    place = -math.copysign(ANCHOR, spring.lead)
    element(lever, "site", name=f"{second.name}.anchor", pos=(0, 0, place), size=DRAWN)
    slide = add_rotor(lever, second, type="slide")
    element(slide, "site", name=f"{second.name}.end", pos=(0, 0, 0), size=DRAWN)


def add_lever_spring(tendons: Element, joint: Joint, spring: LeverSpring, setter: str, body: Element) -> None:
    """The spring from the lever to a point of the link, and by the pulley from the anchor to motor 2."""
    dh, lead = joint.dh, abs(spring.lead)
    place = (spring.arm - dh.a, -dh.d * math.sin(dh.alpha), -dh.d * math.cos(dh.alpha))
    element(body, "site", name=f"{joint.name}.point", pos=place, size=DRAWN)
    tendon = element(tendons, "spatial", name=f"{joint.name}.spring", stiffness=spring.stiffness)
    add(tendon, springlength=abs(spring.arm - spring.lever) + ANCHOR * lead, group=HIDDEN)
    element(tendon, "site", site=f"{joint.name}.lever")
    element(tendon, "site", site=f"{joint.name}.point")
    element(tendon, "pulley", divisor=1 / lead)
    element(tendon, "site", site=f"{setter}.anchor")
    element(tendon, "site", site=f"{setter}.end")
