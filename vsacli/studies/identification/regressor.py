"""The regressor Y of tau_e = Y pi, with pi the inertial parameters of all links, and its base parameters.

Each link has ten standard inertial parameters, in its frame: m; m c, with c the center of mass; and the
inertia tensor about the frame's origin (W. Khalil, E. Dombre, Modeling, Identification and Control of Robots,
2002, section 9.2). Base parameters are the combinations that torques distinguish: columns of Y at random
motions are processed one after the other, link by link; a column that is a combination of previous ones is
regrouped into them (M. Gautier, "Numerical calculation of the base inertial parameters of robots", Journal of
Robotic Systems 8 (1991)). So each base parameter is named after its first parameter, in spite of rounding.
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
from vsacli.dynamics.elastic_torques import carriers, joint_state, link_constants
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import RecursionInputs, TorqueDerivatives
from vsacli.dynamics.rigid_body import without_drives
from vsacli.robot.joint import Inertia, Link
from vsacli.robot.kinematics import base_gravity
from vsacli.robot.model import Robot
from vsacli.studies.identification.independence import first_independent, in_words, shares_of

SYMBOLS = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Symbols of the parameters of a link, in order."""

UNITS = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
"""Units of the parameters of a link."""

TENSOR = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Entries of a symmetric tensor in the order of the parameters."""


def parameters_of(link: Link) -> FloatArray:
    """Return the standard inertial parameters of a link, (10,)."""
    return about_origin(np.array([link.mass, *link.com, *tensor_entries(link.inertia.tensor)]))


def about_origin(file_values: FloatArray) -> FloatArray:
    """Return the standard parameters, (10,), from mass, center of mass and inertia about it, (10,)."""
    mass, com = file_values[0], file_values[1:4]
    return np.concatenate(([mass], mass * com, file_values[4:] + tensor_entries(mass * steiner(com))))


def derivatives_by_file(link: Link) -> FloatArray:
    """Return derivatives of the standard parameters by mass, center of mass and inertia, (10, 10)."""
    file_values = np.array([link.mass, *link.com, *tensor_entries(link.inertia.tensor)])
    changes = np.eye(len(SYMBOLS))  # central differences of polynomials of second degree are exact
    columns = [(about_origin(file_values + each) - about_origin(file_values - each)) / 2 for each in changes]
    return np.stack(columns, axis=1)


def link_of(parameters: FloatArray) -> Link:
    """Return the link with standard inertial parameters, (10,).

    Raises:
        InvalidRecordError: the inertia about the center of mass has a negative eigenvalue, or the mass is not
            positive.
    """
    mass, com = float(parameters[0]), parameters[1:4] / parameters[0]
    central = tensor_entries(tensor(parameters) - mass * steiner(com))
    x, y, z = map(float, com)
    inertia = Inertia(**dict(zip(TENSOR, map(float, central), strict=True)))
    return Link(mass=mass, com=(x, y, z), inertia=inertia)


def all_parameters(robot: Robot) -> FloatArray:
    """Return the parameters of all links, (10 joints,)."""
    return np.concatenate([parameters_of(joint.link) for joint in robot.joints])


def link_parameter_names(robot: Robot) -> list[str]:
    """Return the names of the parameters of all links, e.g. `elbow.Izz`."""
    return [f"{joint.name}.{symbol}" for joint in robot.joints for symbol in SYMBOLS]


def steiner(point: FloatArray) -> FloatArray:
    """Return the inertia about the origin of a unit mass at a point, (3, 3)."""
    return np.asarray(point @ point * np.eye(3) - np.outer(point, point))


def tensor(parameters: FloatArray) -> FloatArray:
    """Return the inertia about the frame's origin, (3, 3)."""
    xx, yy, zz, xy, xz, yz = parameters[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def tensor_entries(symmetric: FloatArray) -> FloatArray:
    """Return the entries of a symmetric tensor in the order of `TENSOR`, (6,)."""
    return symmetric[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


Motion = Mapping[str, Sequence[Scalar]]
_NO_INERTIA = SymmetricTensor(0, 0, 0, 0, 0, 0)
_AXES = (Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1))
_POINT_INERTIAS = (
    SymmetricTensor(0, 1, 1, 0, 0, 0),
    SymmetricTensor(1, 0, 1, 0, 0, 0),
    SymmetricTensor(1, 1, 0, 0, 0, 0),
)
"""Inertias about the origin of a unit mass at unit distance along each axis."""


@dataclass(frozen=True)
class Regressor(RowKernel):
    """The recursion (36)-(58), run once per parameter with one unit of it and no other inertia.

    Inputs are q, dq, ddq of the joints; outputs are the torques by joint and parameter. Tracing computes
    common parts of the runs once and omits derivatives of torques.

    Attributes:
        robot: robot that gives the DH rows, the base and gravity.
    """

    robot: Robot

    @property
    def arguments(self) -> RowLayout:
        """Motion of the joints."""
        return RowLayout(dict.fromkeys(("q", "dq", "ddq"), (len(self.robot.joints),)))

    @property
    def results(self) -> RowLayout:
        """Regressor Y, (joints, 10 joints)."""
        joints = len(self.robot.joints)
        return RowLayout({"Y": (joints, len(SYMBOLS) * joints)})

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run the recursion for each parameter."""
        motion = self.arguments.unpack(rows)
        columns = [
            column for index in range(len(self.robot.joints)) for column in self._link_columns(index, motion)
        ]
        return [torque for joint_torques in zip(*columns, strict=True) for torque in joint_torques]

    def _link_columns(self, link_index: int, motion: Motion) -> Iterator[list[Scalar]]:
        """Yield the torques of the joints per unit of each parameter of a link."""
        mass_torques = self._torques(link_index, motion, 1, ZERO, _NO_INERTIA)
        yield mass_torques
        for axis, inertia in zip(_AXES, _POINT_INERTIAS, strict=True):
            # torque per unit of m c: a unit mass at c = axis, minus its shares of m and of the inertia
            central = SymmetricTensor(*(-entry for entry in inertia))
            yield list(map(sub, self._torques(link_index, motion, 1, axis, central), mass_torques))
        for place in range(len(_NO_INERTIA)):
            entries = [int(place == entry) for entry in range(len(_NO_INERTIA))]
            yield self._torques(link_index, motion, 0, ZERO, SymmetricTensor(*entries))

    def _torques(
        self, moving: int, given: Motion, mass: int, com: Vector, inertia: SymmetricTensor
    ) -> list[Scalar]:
        """Return the torques of all joints for one link alone; only those that move it carry it."""
        path = self.robot.paths[moving]
        joints, seats = [self.robot.joints[index] for index in path], carriers(self.robot)
        *before, last = [
            link_constants(joint)._replace(mass=0, com=ZERO, inertia=_NO_INERTIA, viscous_damping=0)
            for joint in joints
        ]
        states = []
        for index, joint in zip(path, joints, strict=True):
            q, dq, ddq = (rows[index] for rows in given.values())
            state = joint_state(joint, q, (dq, ddq, 0, 0))
            states.append(state._replace(resistance=TorqueDerivatives(0, 0, 0)))
        inputs = RecursionInputs(
            links=[*before, last._replace(mass=mass, com=com, inertia=inertia)],
            states=states,
            carriers=[seats[index]._replace(parent=place - 1) for place, index in enumerate(path)],
            gravity=base_gravity(self.robot),
        )
        by_joint = {index: torque.tau for index, torque in zip(path, recursion(inputs), strict=True)}
        return [by_joint.get(index, 0) for index in range(len(self.robot.joints))]


def regressor(robot: Robot, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
    """Return Y(q, q', q'') with tau_e = Y pi, without friction and damping.

    Args:
        robot: robot that gives the DH rows, the base and gravity.
        q: joint positions, (samples, joints).
        dq: joint velocities, (samples, joints).
        ddq: joint accelerations, (samples, joints).

    Returns:
        Y, (joints, 10 joints, samples), N m (N) per kg, kg m, kg m^2.
    """
    kernel = Regressor(without_drives(robot))
    rows = kernel.arguments.pack({"q": by_joint(q), "dq": by_joint(dq), "ddq": by_joint(ddq)})
    return kernel.results.arrays(TracedEngine().run(kernel, rows))["Y"]


SAMPLES_A_LINK = 30
"""Random samples of position, velocity and acceleration per link: three per parameter; each sample gives one
row per joint."""

SEED = 0
"""Seed of the random motions, so that the same robot has the same base parameters each time."""

DEPENDENCE_TOLERANCE = 1e-9
"""Relative distance of a column from the span of others below which it is dependent. For the bundled robots,
dependent columns are below 1e-15, the others above 0.3."""

KEPT_SYMBOLS = ("Ixx", "Ixy", "Ixz", "Iyz", "Izz", "mx", "my", "Iyy", "mz", "m")
"""Parameters of a link in the order in which they are kept: with revolute joints, the last three are
regrouped into the previous link."""


class BaseParameters(NamedTuple):
    """Combinations of parameters that torques distinguish.

    Attributes:
        kept: index of the first parameter of each combination, (base,), ascending.
        shares: factors of all parameters in each combination, (base, parameters).
    """

    kept: IndexArray
    shares: FloatArray

    @classmethod
    def of_columns(cls, columns: FloatArray, order: IndexArray) -> BaseParameters:
        """Return the combinations that the columns of a regressor at random motions distinguish.

        Args:
            columns: derivatives of the torques by the parameters, (rows, parameters).
            order: indices of the parameters in the order in which they are kept.
        """
        kept: IndexArray = np.sort(order[first_independent(columns[:, order], DEPENDENCE_TOLERANCE)])
        shares = shares_of(columns[:, kept], columns, DEPENDENCE_TOLERANCE)
        shares[:, kept] = np.eye(len(kept))  # without rounding
        return cls(kept, shares)

    def of(self, parameters: FloatArray) -> FloatArray:
        """Return the combinations, (..., base), of the parameters, (..., parameters)."""
        return parameters @ self.shares.T

    def names(self, names: Sequence[str]) -> list[str]:
        """Return the name of each combination's first parameter, with a star if it has others."""
        is_single = np.count_nonzero(self.shares, axis=1) == 1
        return [
            f"{names[index]}{'' if single else '*'}"
            for index, single in zip(self.kept, is_single, strict=True)
        ]

    def words(self, combination: int, names: Sequence[str]) -> str:
        """Return a combination as a sum in words, e.g. `shoulder.Izz + 0.09 elbow.m`."""
        first_index, factors = int(self.kept[combination]), self.shares[combination]
        other_terms = ((int(at), float(factors[at])) for at in np.flatnonzero(factors) if at != first_index)
        return in_words([(first_index, 1.0), *other_terms], names)


def random_motion(joints: int) -> FloatArray:
    """Return random samples of q, q' and q'', (3, samples, joints)."""
    return np.random.default_rng(SEED).uniform(-np.pi, np.pi, (3, SAMPLES_A_LINK * joints, joints))


def preferred_order(joints: int) -> IndexArray:
    """Return the indices of the parameters of all links in the order in which they are kept."""
    links = len(SYMBOLS) * np.arange(joints)[:, None]
    return np.asarray((links + [SYMBOLS.index(symbol) for symbol in KEPT_SYMBOLS]).ravel())
