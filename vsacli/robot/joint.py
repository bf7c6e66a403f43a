"""A joint: its Denavit-Hartenberg row, the link it moves, its limits and its actuator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.damper import Damper
from vsacli.actuators.friction import Friction
from vsacli.actuators.kinds import ACTUATORS
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import COMMANDED, Signal
from vsacli.base.variables import LOSSES, MOTOR_CONSTANTS, OF_ANY_ROBOT, Variable
from vsacli.documents.fields import (
    NON_NEGATIVE,
    POSITIVE,
    SMALLEST,
    OneOf,
    OwnKind,
    RecordOf,
    Refer,
    Schema,
    choice,
    interval,
    number,
    text,
    value,
    vector,
)
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_reader import read_text
from vsacli.documents.tree import Node, Scope, TextNode

UNBOUNDED = (-math.inf, math.inf)
FRAME_0 = "frame 0"
"""Parent of a joint on the base; no joint has this name."""

INERTIA_ROUNDING = 1e-12
"""Relative size below which a negative eigenvalue of an inertia tensor counts as rounding of its entries."""


@dataclass(frozen=True)
class DenavitHartenberg(DeclaredRecord):
    """Standard Denavit-Hartenberg row: frame i-1 to frame i is Rz(theta) Tz(d) Tx(a) Rx(alpha)."""

    a: float = number(units.LENGTH, "distance of the axes z_{i-1} and z_i, along x_i")
    alpha: float = number(units.ANGLE, "angle from z_{i-1} to z_i, about x_i")
    d: float = number(
        units.LENGTH, "offset along z_{i-1}; the variable of a prismatic joint adds to it", default=0.0
    )
    theta: float = number(
        units.ANGLE, "angle about z_{i-1}; the variable of a revolute joint adds to it", default=0.0
    )


@dataclass(frozen=True)
class Pose(DeclaredRecord):
    """The pose of a frame in another one: position, then fixed-axis rotations, like `origin` in URDF."""

    xyz: tuple[float, float, float] = vector(
        3, units.LENGTH, "position of its origin", default=(0.0, 0.0, 0.0)
    )
    rpy: tuple[float, float, float] = vector(
        3,
        units.ANGLE,
        "roll, pitch, yaw: turned about the fixed x, then y, then z axis, Rz(yaw) Ry(pitch) Rx(roll)",
        default=(0.0, 0.0, 0.0),
    )

    @staticmethod
    def example(_joint_type: str) -> dict[str, Any]:
        """Return plausible values of the fields, for a new robot file."""
        return {"xyz": [0.0, 0.1, 0.0], "rpy": [0.0, 0.0, 0.0]}


class ParentName(OwnKind):
    """The joint on whose link a joint is mounted: its name, or null for the base, read as `FRAME_0`."""

    words = "name of an earlier joint, or null"
    dims = ()

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return the name; see `OwnKind.read`."""
        if isinstance(node, TextNode) and node.is_null:
            return FRAME_0
        return read_text(self, node, label, scope)

    def schema(self, _refer: Refer) -> Schema:
        """See `OwnKind.schema`."""
        return {"type": ["string", "null"]}

    def json_value(self, content: str, _of_record: Callable[[Any], Any]) -> str | None:
        """See `OwnKind.json_value`."""
        return None if content == FRAME_0 else content


@dataclass(frozen=True)
class Tool(Pose):
    """An end effector: a frame on the link of a joint."""

    name: str = text("name of the tool", identifier=True)
    joint: str = text("joint whose link carries the tool", identifier=True)
    min_stiffness: float | None = number(
        units.LINEAR_STIFFNESS,
        "smallest stiffness against forces in any direction, motors held; flagged below",
        check=POSITIVE,
        default=None,
    )

    keyed_by = "name"

    @staticmethod
    def example(_joint_type: str) -> dict[str, Any]:
        """Return plausible values of the fields, for a new robot file."""
        return {"name": "hand", "joint": "wrist"}


@dataclass(frozen=True)
class Inertia(DeclaredRecord):
    """Central inertia tensor, with the entries of the tensor itself, as in URDF: xy = -integral(x y dm)."""

    xx: float = number(units.INERTIA, "moment about the x axis")
    yy: float = number(units.INERTIA, "moment about the y axis")
    zz: float = number(units.INERTIA, "moment about the z axis")
    xy: float = number(units.INERTIA, "tensor entry -integral(x y dm)", default=0.0)
    xz: float = number(units.INERTIA, "tensor entry -integral(x z dm)", default=0.0)
    yz: float = number(units.INERTIA, "tensor entry -integral(y z dm)", default=0.0)

    def _problems(self) -> Iterator[FieldProblem]:
        smallest = self.principal_moments[0]
        if smallest < -INERTIA_ROUNDING * np.abs(self.tensor).max():
            problem = f"the tensor has the negative eigenvalue {smallest:.4g} kg m^2, which no body has"
            yield FieldProblem((), problem)

    @property
    def tensor(self) -> FloatArray:
        """The symmetric 3x3 tensor."""
        return np.array(
            [[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]]
        )

    @property
    def principal_moments(self) -> FloatArray:
        """Eigenvalues of the tensor, ascending, kg m^2."""
        return np.asarray(np.linalg.eigvalsh(self.tensor), dtype=np.float64)


@dataclass(frozen=True)
class Link(DeclaredRecord):
    """The augmented link: the body with the motors mounted on it, without the inertia of their rotors."""

    mass: float = number(units.MASS, "mass of the link with the motors mounted on it", check=NON_NEGATIVE)
    com: tuple[float, float, float] = vector(3, units.LENGTH, "center of mass in the link frame (DH frame i)")
    inertia: Inertia = value(RecordOf(Inertia), "inertia tensor about the center of mass, link axes")


@dataclass(frozen=True)
class Limits(DeclaredRecord):
    """Limits of the commanded motion; samples beyond them are computed and flagged."""

    position: tuple[float, float] = interval(units.POSITION, "range of the joint position", default=UNBOUNDED)
    velocity: tuple[float, float] = interval(units.VELOCITY, "range of the joint velocity", default=UNBOUNDED)
    stiffness: tuple[float, float] = interval(
        units.STIFFNESS, "range of the joint stiffness", lowest=-math.inf, default=UNBOUNDED
    )


@dataclass(frozen=True)
class Joint(DeclaredRecord):
    """One joint with its link and actuator."""

    name: str = text("name of the joint, used in reports and CSV headers", identifier=True)
    type: str = choice(("revolute", "prismatic"), "kind of joint")
    parent: str | None = value(
        ParentName(),
        "joint on whose link it is mounted; null: frame 0; by default the joint before, if any",
        default=None,
    )
    mount: Pose | None = value(
        RecordOf(Pose),
        "pose at which its DH row begins, in the frame of that link; by default that frame",
        default=None,
    )
    dh: DenavitHartenberg = value(RecordOf(DenavitHartenberg), "Denavit-Hartenberg row; see `convention`")
    link: Link = value(RecordOf(Link), "link that the joint moves")
    damping: float = number(
        units.DAMPING, "viscous damping between the links", check=NON_NEGATIVE, default=0.0
    )
    friction: Friction | None = value(
        RecordOf(Friction), "dry friction between the links, smooth: with a width", default=None
    )
    actuator: Actuator = value(OneOf(ACTUATORS), "actuator that drives the joint")
    damper: Damper | None = value(RecordOf(Damper), "damper whose damping is commanded", default=None)
    limits: Limits = value(RecordOf(Limits), "limits of the commanded motion", default=Limits())

    unit_variant = "type"

    def _problems(self) -> Iterator[FieldProblem]:
        if not self.actuator.sprung and self.limits.stiffness != UNBOUNDED:
            reason = f"a joint with a {self.actuator_type} actuator has no stiffness to limit; leave it out"
            yield FieldProblem(("limits", "stiffness"), reason)
        if not self.actuator.sprung and self.damper is not None:
            reason = f"a joint with a {self.actuator_type} actuator has no springs to calm; leave it out"
            yield FieldProblem(("damper",), reason)
        unfit = self.actuator.unfit_for(self.type)
        if unfit is not None:
            yield unfit.inside("actuator")
        yield from self._friction_problems()

    @property
    def is_revolute(self) -> bool:
        """Whether the joint variable is an angle."""
        return self.type == "revolute"

    @property
    def actuator_type(self) -> str:
        """Key of the actuator's class in `ACTUATORS`."""
        return ACTUATORS.name_of(type(self.actuator))

    def damper_at(self, location: str) -> Damper | None:
        """Return the damper if it has this location, else None."""
        return self.damper if self.damper is not None and self.damper.location == location else None

    @property
    def damper_start(self) -> float | None:
        """Initial position of a damped transmission, if given."""
        return None if self.damper is None else self.damper.start

    @property
    def commanded(self) -> tuple[str, ...]:
        """Keys of the signals that a trajectory commands in addition to the motion."""
        devices = (
            signal.key
            for signal in COMMANDED.values()
            if signal.device is not None and getattr(self, signal.device) is not None
        )
        return (*self.actuator.commanded, *devices)

    def uncommanded(self, signal: Signal) -> str:
        """Return the reason why a trajectory does not command a signal, as a clause."""
        if signal.device is not None:
            return f"it has no {signal.device}"
        return self.actuator.uncommanded.get(signal.key, f"its actuator takes no {signal.key}")

    def has_columns(self, variable: Variable) -> list[bool]:
        """Return a mask of the columns that a result variable has: of motors 1 and 2, or of the joint."""
        if variable.requires in OF_ANY_ROBOT:
            return self.actuator.has_columns(variable)
        of_kind = self.actuator.has_columns(variable._replace(requires=None))
        if variable.requires in MOTOR_CONSTANTS:
            has_constant = [
                getattr(side, variable.requires, None) is not None for side in self.actuator.sides
            ]
            return [kind and motor for kind, motor in zip(of_kind, has_constant, strict=True)]
        is_commanded = variable.requires == LOSSES or variable.requires in self.commanded
        return [is_commanded and column for column in of_kind]

    @property
    def has_friction(self) -> bool:
        """Whether the joint or one of its motors has dry friction."""
        return any((self.friction, *(motor.friction for motor in self.actuator.motors)))

    def _friction_problems(self) -> Iterator[FieldProblem]:
        """Yield problems of friction that is not twice differentiable as a part of the elastic torque."""
        if self.friction is None:
            return
        backward, forward = self.friction.coulomb
        if self.friction.sharp:
            reason = (
                "must be positive: friction between the links is part of the elastic torque, of which two "
                "derivatives are needed, and the sign function has none; take a speed below which the joint "
                "hardly moves, or give the friction to the motor, where width 0 will do"
            )
            yield FieldProblem(("friction", "width"), reason)
        if 0 < self.friction.width < SMALLEST:
            reason = f"must be at least {SMALLEST:g} in size, not {self.friction.width:g}"
            yield FieldProblem(("friction", "width"), reason)
        if backward != forward:
            reason = (
                "must be one number between the links: with two the slope of the torque jumps at rest; give "
                f"their mean {(backward + forward) / 2:g}, and half their difference as "
                f"offset: {(forward - backward) / 2:g}"
            )
            yield FieldProblem(("friction", "coulomb"), reason)

    def warnings(self) -> Iterator[str]:
        """Yield warnings about springs."""
        yield from (f"spring of joint {self.name}: {warning}" for warning in self.actuator.warnings)


def existing_columns(variable: Variable, kinds: Iterable[str]) -> list[list[bool]]:
    """Return a mask of the columns of a variable that exist, for each joint by its kind of actuator.

    All columns count as existing for an unknown kind.
    """
    all_columns = [True] * (2 if "motor" in variable.dims else 1)
    return [ACTUATORS[kind].has_columns(variable) if kind in ACTUATORS else all_columns for kind in kinds]
