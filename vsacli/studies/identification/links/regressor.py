"""The regressor Y of tau_e = Y pi, with pi the standard inertial parameters of all links."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from vsacli.base.arrays import FloatArray, by_joint
from vsacli.compute.engine.engines import TracedEngine
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.vector import ZERO, Scalar, SymmetricTensor, Vector, sub
from vsacli.dynamics.chain import LinkConstants, TorqueDerivatives
from vsacli.dynamics.elastic_torques import joint_state, link_constants
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.rigid_body import bare
from vsacli.robot.joint import Joint
from vsacli.robot.kinematics import base_gravity
from vsacli.robot.model import Robot
from vsacli.studies.identification.links.inertial_parameters import SYMBOLS

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
        *before, last = [_massless(joint) for joint in joints[: moving + 1]]
        links = [*before, last._replace(mass=mass, com=com, inertia=inertia)]
        states = [
            joint_state(joint, q, (dq, ddq, 0, 0))._replace(resistance=TorqueDerivatives(0, 0, 0))
            for joint, q, dq, ddq in zip(joints[: moving + 1], *given.values(), strict=False)
        ]
        torques = recursion(links, states, base_gravity(self.robot))
        return [*(torque.tau for torque in torques), *[0] * (len(joints) - len(links))]


def _massless(joint: Joint) -> LinkConstants:
    return link_constants(joint)._replace(mass=0, com=ZERO, inertia=_NO_INERTIA, damping=0)


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
