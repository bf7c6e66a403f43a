"""The regressor Y of tau_e = Y pi, with pi the inertial parameters of all links, and its base parameters.

Standard inertial parameters are ten of each link, in its frame: m; m c, with c the centre of mass; and the
inertia tensor about the frame's origin (W. Khalil, E. Dombre, Modeling, Identification and Control of Robots,
2002, section 9.2). Base parameters are those combinations that torques tell apart: columns of Y at random
motions are taken one after the other, base to tip; one that is a combination of those before it is regrouped
into them (M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of Robotic
Systems 8 (1991)). So each keeps the name of the parameter that it begins with, whatever rounding does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray, by_joint
from vsacli.compute.engine.engines import TracedEngine
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.vector import ZERO, Scalar, SymmetricTensor, Vector, sub
from vsacli.dynamics.chain import TorqueDerivatives
from vsacli.dynamics.elastic_torques import joint_state, link_constants
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.rigid_body import bare
from vsacli.robot.joint import Inertia, Link
from vsacli.robot.kinematics import base_gravity
from vsacli.robot.model import Robot
from vsacli.studies.identification.independence import first_independent, in_words, shares_of

SYMBOLS = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Symbols of the parameters of a link, in their order."""

UNITS = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
"""Units of these."""

TENSOR = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Entries of a symmetric tensor in the order of the parameters."""


def parameters_of(link: Link) -> FloatArray:
    """Standard inertial parameters of a link, (10,)."""
    com = np.array(link.com)
    about_origin = link.inertia.tensor + link.mass * steiner(com)
    return np.concatenate(([link.mass], link.mass * com, _entries(about_origin)))


def link_of(parameters: FloatArray) -> Link:
    """Return the link of standard inertial parameters, (10,), with a mass.

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
    """Return the parameters of all links, base to tip, (10 joints,)."""
    return np.concatenate([parameters_of(joint.link) for joint in robot.joints])


def names(robot: Robot) -> list[str]:
    """Return the names of the parameters of all links, e.g. `elbow.Izz`."""
    return [f"{joint.name}.{symbol}" for joint in robot.joints for symbol in SYMBOLS]


def steiner(point: FloatArray) -> FloatArray:
    """Inertia about the origin of a unit of mass at a point, (3, 3)."""
    return np.asarray(point @ point * np.eye(3) - np.outer(point, point))


def tensor(parameters: FloatArray) -> FloatArray:
    """Return the inertia about the frame's origin, (3, 3)."""
    xx, yy, zz, xy, xz, yz = parameters[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _entries(symmetric: FloatArray) -> FloatArray:
    return symmetric[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


Motion = Mapping[str, Sequence[Scalar]]
_NO_INERTIA = SymmetricTensor(0, 0, 0, 0, 0, 0)
_AXES = (Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1))
_POINT_INERTIAS = (
    SymmetricTensor(0, 1, 1, 0, 0, 0),
    SymmetricTensor(1, 0, 1, 0, 0, 0),
    SymmetricTensor(1, 1, 0, 0, 0, 0),
)
"""About the origin, of a unit of mass at the unit distance along each axis."""


@dataclass(frozen=True)
class Regressor(RowKernel):
    """The recursion (36)-(58) of links with one unit of one parameter each; the rest of the robot is without.

    Inputs are q, dq, ddq of the joints; outputs the torques by joint and parameter. Traced, what the runs
    have in common is computed once, and derivatives of torques not at all.

    Attributes:
        robot: whose rows, base and gravity count.
    """

    robot: Robot

    @property
    def arguments(self) -> RowLayout:
        """Motion of the joints."""
        return RowLayout(dict.fromkeys(("q", "dq", "ddq"), (len(self.robot.joints),)))

    @property
    def results(self) -> RowLayout:
        """Y, joint by joint."""
        joints = len(self.robot.joints)
        return RowLayout({"Y": (joints, len(SYMBOLS) * joints)})

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run the recursion for each parameter."""
        given = self.arguments.unpack(rows)
        columns = [
            column for index in range(len(self.robot.joints)) for column in self._of_link(index, given)
        ]
        return [torque for of_joint in zip(*columns, strict=True) for torque in of_joint]

    def _of_link(self, moving: int, given: Motion) -> Iterator[list[Scalar]]:
        """Torques of the joints by each parameter of a link."""
        alone = self._torques(moving, given, 1, ZERO, _NO_INERTIA)
        yield alone
        for axis, inertia in zip(_AXES, _POINT_INERTIAS, strict=True):
            # a unit of mass there, less what it has of m and of the inertia about the origin
            central = SymmetricTensor(*(-entry for entry in inertia))
            yield list(map(sub, self._torques(moving, given, 1, axis, central), alone))
        for place in range(len(_NO_INERTIA)):
            entries = [int(place == entry) for entry in range(len(_NO_INERTIA))]
            yield self._torques(moving, given, 0, ZERO, SymmetricTensor(*entries))

    def _torques(
        self, moving: int, given: Motion, mass: int, com: Vector, inertia: SymmetricTensor
    ) -> list[Scalar]:
        """Torques of the joints by a link alone; joints beyond it bear nothing."""
        joints = self.robot.joints
        *before, last = [
            link_constants(joint)._replace(mass=0, com=ZERO, inertia=_NO_INERTIA, damping=0)
            for joint in joints[: moving + 1]
        ]
        links = [*before, last._replace(mass=mass, com=com, inertia=inertia)]
        states = [
            joint_state(joint, q, (dq, ddq, 0, 0))._replace(resistance=TorqueDerivatives(0, 0, 0))
            for joint, q, dq, ddq in zip(joints[: moving + 1], *given.values(), strict=False)
        ]
        torques = recursion(links, states, base_gravity(self.robot))
        return [*(torque.tau for torque in torques), *[0] * (len(joints) - len(links))]


def regressor(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
    """Y(q, q', q'') with tau_e = Y pi, friction and damping left out.

    Args:
        robot: whose rows, base and gravity count.
        q: positions of the joints, (samples, joints).
        dq: their velocities.
        ddq: their accelerations.

    Returns:
        Y, (joints, 10 joints, samples), N m (N) per kg, kg m, kg m^2.
    """
    kernel = Regressor(bare(robot))
    rows = kernel.arguments.pack({"q": by_joint(q), "dq": by_joint(dq), "ddq": by_joint(ddq)})
    return kernel.results.arrays(TracedEngine().run(kernel, rows))["Y"]


SAMPLES_A_LINK = 30
"""Random poses, speeds and accelerations: three for each parameter, and a row of each joint."""

SEED = 0
"""Seed of the random motions, so that the same robot has the same base parameters each time."""

STRUCTURAL = 1e-9
"""Distance of a column from a combination of others, over its norm, below which it is one. Of the robots that
come along dependent columns are below 1e-15, the others above 0.3."""

PREFERRED = ("Ixx", "Ixy", "Ixz", "Iyz", "Izz", "mx", "my", "Iyy", "mz", "m")
"""Parameters of a link in the order in which they are kept: with revolute joints the last three are regrouped
into the link before."""


class BaseParameters(NamedTuple):
    """Combinations of the standard parameters of all links.

    Attributes:
        kept: standard parameter that each begins with, (base,), ascending.
        shares: of all standard parameters in each, (base, parameters).
    """

    kept: IndexArray
    shares: FloatArray

    def of(self, parameters: FloatArray) -> FloatArray:
        """Values from standard parameters, (..., parameters)."""
        values: FloatArray = parameters @ self.shares.T
        return values

    def names(self, names: Sequence[str]) -> list[str]:
        """Return the name of the first parameter of each; with a star if others are regrouped into it."""
        alone = np.count_nonzero(self.shares, axis=1) == 1
        return [f"{names[at]}{'' if one else '*'}" for at, one in zip(self.kept, alone, strict=True)]

    def words(self, place: int, names: Sequence[str]) -> str:
        """Return the sum that one stands for, e.g. `shoulder.Izz + 0.09 elbow.m`."""
        first, factors = int(self.kept[place]), self.shares[place]
        others = ((int(at), float(factors[at])) for at in np.flatnonzero(factors) if at != first)
        return in_words([(first, 1.0), *others], names)


def base_parameters(robot: Robot) -> BaseParameters:
    """Return the base parameters of a robot's links."""
    joints = len(robot.joints)
    q, dq, ddq = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (3, SAMPLES_A_LINK * joints, joints))
    columns = np.moveaxis(regressor(robot, q, dq, ddq), 1, -1).reshape(-1, len(SYMBOLS) * joints)
    links = len(SYMBOLS) * np.arange(joints)[:, None]
    order = (links + [SYMBOLS.index(symbol) for symbol in PREFERRED]).ravel()
    kept: IndexArray = np.sort(order[first_independent(columns[:, order], STRUCTURAL)])
    return BaseParameters(kept, shares_of(columns[:, kept], columns, STRUCTURAL))
