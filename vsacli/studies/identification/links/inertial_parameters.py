"""Standard inertial parameters of links, in which torques are linear: mass, its first and second moments.

Ten of each link, in its frame: m; m c, with c the centre of mass; and the inertia tensor about the frame's
origin (W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002, section 9.2).
"""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import Inertia, Link
from vsacli.robot.model import Robot

SYMBOLS = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Of the parameters of a link, in their order."""

UNITS = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
"""Of these."""

TENSOR = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Entries of a symmetric tensor in the order of the parameters."""


def parameters_of(link: Link) -> FloatArray:
    """Standard inertial parameters of a link, (10,)."""
    com = np.array(link.com)
    about_origin = link.inertia.tensor + link.mass * steiner(com)
    return np.concatenate(([link.mass], link.mass * com, _entries(about_origin)))


def link_of(parameters: FloatArray) -> Link:
    """The link of standard inertial parameters, (10,), with a mass.

    Raises:
        InvalidRecordError: its inertia about its centre of mass has a negative eigenvalue, or its mass is not
            positive.
    """
    mass, com = float(parameters[0]), parameters[1:4] / parameters[0]
    central = _entries(tensor(parameters) - mass * steiner(com))
    x, y, z = map(float, com)
    inertia = Inertia(**dict(zip(TENSOR, map(float, central), strict=True)))
    return Link(mass=mass, com=(x, y, z), inertia=inertia)


def all_parameters(robot: Robot) -> FloatArray:
    """Of all links, base to tip, (10 joints,)."""
    return np.concatenate([parameters_of(joint.link) for joint in robot.joints])


def names(robot: Robot) -> list[str]:
    """Of the parameters of all links, e.g. `elbow.Izz`."""
    return [f"{joint.name}.{symbol}" for joint in robot.joints for symbol in SYMBOLS]


def steiner(point: FloatArray) -> FloatArray:
    """Inertia about the origin of a unit of mass at a point, (3, 3)."""
    return np.asarray(point @ point * np.eye(3) - np.outer(point, point))


def tensor(parameters: FloatArray) -> FloatArray:
    """The inertia about the frame's origin, (3, 3)."""
    xx, yy, zz, xy, xz, yz = parameters[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _entries(symmetric: FloatArray) -> FloatArray:
    return symmetric[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
