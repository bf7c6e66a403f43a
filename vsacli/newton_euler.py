"""Torques that the links demand of the joints, over blocks of samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from vsacli.arrays import FloatArray, by_joint, over_time
from vsacli.errors import InputError
from vsacli.recursion import JointState, LinkConstants, TipLoad, recursion
from vsacli.robot import Joint, Pose, Robot
from vsacli.vector import ZERO, Matrix, Scalar, SymmetricTensor, Vector, add, exact, mul, sub
from vsacli.wrench import WRENCH_AXES, WRENCH_NAMES, Wrench

SAMPLES_PER_PASS = 4096
"""Samples in one pass: fewer waste time in the interpreter, more leave the processor's cache."""

JOINT_SAMPLES_PER_PASS = 2**19
"""Bound on joints times samples in one pass: the recursion keeps about 500 bytes for each."""


def link_constants(joint: Joint) -> LinkConstants:
    """Constants of a joint for the recursion, with exact zeros and ones where the geometry has them."""
    inertia = joint.link.inertia
    return LinkConstants(
        revolute=joint.is_revolute,
        a=exact(joint.dh.a),
        cos_alpha=_trigonometric(math.cos, joint.dh.alpha),
        sin_alpha=_trigonometric(math.sin, joint.dh.alpha),
        mass=exact(joint.link.mass),
        com=Vector(*map(exact, joint.link.com)),
        inertia=SymmetricTensor(
            *map(exact, (inertia.xx, inertia.yy, inertia.zz, inertia.xy, inertia.xz, inertia.yz))
        ),
        damping=exact(joint.damping),
    )


def _trigonometric(function: Callable[[float], float], angle: float) -> Scalar:
    """Cosine or sine of an angle, exactly zero at multiples of pi/2 although pi itself is rounded."""
    number = function(angle)
    return 0 if abs(number) <= np.finfo(float).eps * max(1.0, abs(angle)) else exact(number)


def base_gravity(robot: Robot) -> Vector:
    """Gravity acceleration in DH frame 0, m/s^2."""
    return _rotation(robot.base).transposed().times(Vector(*map(exact, robot.gravity)))


def tip_load(robot: Robot, frame: str, wrench: Iterable[Sequence[Scalar]]) -> TipLoad:
    """What the end effector exerts while the environment exerts a wrench on it.

    Args:
        robot: whose base and tool count.
        frame: along whose axes the components are, one of `vsacli.wrench.WRENCH_FRAMES`.
        wrench: the six components, their first and their second derivatives; scalars of any kind.
    """
    in_base = frame == "base"
    rotation = _rotation(robot.base).transposed() if in_base else _rotation(robot.tool)
    exerted = [(ZERO - Vector(*components[:3]), ZERO - Vector(*components[3:])) for components in wrench]
    return TipLoad(
        force=[rotation.times(force) for force, _ in exerted],
        moment=[rotation.times(moment) for _, moment in exerted],
        point=Vector(*map(exact, robot.tool.xyz)),
        in_base=in_base,
    )


def _rotation(pose: Pose) -> Matrix:
    """Rz(yaw) Ry(pitch) Rx(roll), with exact zeros and ones at right angles."""
    (cr, cp, cy), (sr, sp, sy) = (
        [_trigonometric(function, angle) for angle in pose.rpy] for function in (math.cos, math.sin)
    )
    return Matrix(
        Vector(mul(cy, cp), sub(mul(mul(cy, sp), sr), mul(sy, cr)), add(mul(mul(cy, sp), cr), mul(sy, sr))),
        Vector(mul(sy, cp), add(mul(mul(sy, sp), sr), mul(cy, cr)), sub(mul(mul(sy, sp), cr), mul(cy, sr))),
        Vector(sub(0, sp), mul(cp, sr), mul(cp, cr)),
    )


def link_torques(
    robot: Robot,
    q: npt.ArrayLike,
    dq: npt.ArrayLike,
    ddq: npt.ArrayLike,
    d3q: npt.ArrayLike,
    d4q: npt.ArrayLike,
    wrench: Wrench | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Torques that the links demand of the joints, and their first two derivatives, (36)-(60).

    Args:
        robot: the chain.
        q: joint positions, (samples, joints), rad (m).
        dq: their first derivative.
        ddq: their second derivative.
        d3q: their third derivative.
        d4q: their fourth derivative.
        wrench: what the environment exerts on the end effector, over the same samples; nothing if None.

    Returns:
        tau_e, dtau_e, ddtau_e, each (samples, joints), N m (N) per s^k.

    Raises:
        InputError: an array has another shape than (samples, joints), or not that of `q`; one of the wrench
            another than (samples, 6).
    """
    position, *rates = (_checked(robot, name, array) for name, array in _named(q, dq, ddq, d3q, d4q))
    if len({array.shape for array in (position, *rates)}) > 1:
        shapes = ", ".join(str(array.shape[::-1]) for array in (position, *rates))
        raise InputError.one(f"q, dq, ddq, d3q, d4q must have one shape, not {shapes}")

    tip_at = _tip_loads(robot, wrench, position.shape[1])
    links = [link_constants(joint) for joint in robot.joints]
    gravity = base_gravity(robot)
    torques = np.empty((3, *position.shape))
    samples = max(1, min(SAMPLES_PER_PASS, JOINT_SAMPLES_PER_PASS // len(robot.joints)))
    for start in range(0, position.shape[1], samples):
        part = slice(start, start + samples)
        states = _joint_states(robot, position[:, part], [rate[:, part] for rate in rates])
        for joint, derivatives in enumerate(recursion(links, states, gravity, tip_at(part))):
            for order, row in enumerate(derivatives):
                torques[order, joint, part] = row
    tau_e, dtau_e, ddtau_e = map(over_time, torques)
    return tau_e, dtau_e, ddtau_e


def _named(*motion: npt.ArrayLike) -> Iterator[tuple[str, npt.ArrayLike]]:
    return zip(("q", "dq", "ddq", "d3q", "d4q"), motion, strict=True)


def _checked(robot: Robot, name: str, array: npt.ArrayLike) -> FloatArray:
    shape = np.shape(array)
    if len(shape) != 2 or shape[1] != len(robot.joints):
        raise InputError.one(f"{name} must have the shape (samples, {len(robot.joints)}), not {shape}")
    return by_joint(array)


def _tip_loads(robot: Robot, wrench: Wrench | None, samples: int) -> Callable[[slice], TipLoad | None]:
    """The load at the tip over any part of the samples."""
    if wrench is None:
        return lambda _: None
    frame = wrench.frame
    for name in WRENCH_NAMES:
        if (shape := np.shape(getattr(wrench, name))) != (samples, len(WRENCH_AXES)):
            raise InputError.one(f"{name} must have the shape ({samples}, {len(WRENCH_AXES)}), not {shape}")
    rows = np.stack([by_joint(getattr(wrench, name)) for name in WRENCH_NAMES])
    return lambda part: tip_load(robot, frame, rows[:, :, part])


def _joint_states(robot: Robot, position: FloatArray, rates: Sequence[FloatArray]) -> list[JointState]:
    return [
        joint_state(joint, position[k], (rates[0][k], rates[1][k], rates[2][k], rates[3][k]))
        for k, joint in enumerate(robot.joints)
    ]


def joint_state(joint: Joint, q: Scalar, rates: tuple[Scalar, Scalar, Scalar, Scalar]) -> JointState:
    """Pose and motion of a joint for the recursion, from its position and four derivatives."""
    dh = joint.dh
    if joint.is_revolute:
        angle = q + dh.theta
        return JointState(np.cos(angle), np.sin(angle), exact(dh.d), rates)
    return JointState(_trigonometric(math.cos, dh.theta), _trigonometric(math.sin, dh.theta), q + dh.d, rates)
