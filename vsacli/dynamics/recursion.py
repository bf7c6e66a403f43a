"""The recursion of Buondonno & De Luca (2016), (36)-(60): link torques and their first two derivatives.

`forward` runs (36)-(51) from base to tip, `backward` (52)-(60) from tip to base. Scalars are of any kind:
floats, NumPy rows of samples, complex numbers, fractions, symbols. Given cos and sin of each joint angle (and
the offset d of prismatic joints) the recursion is a polynomial in its inputs.

Every quantity of frame k is a derivative taken in the base frame, written in components of frame k.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vsacli.compute.control_flow import call
from vsacli.compute.vector import ZERO, Rotation, Scalar, SymmetricTensor, Vector, add, cross, mul
from vsacli.dynamics.chain import JointState, LinkConstants, TipLoad, TorqueDerivatives

Z0 = Vector(0, 0, 1)


class _Angular(NamedTuple):
    """Angular velocity, acceleration, jerk and snap of a frame."""

    omega: Vector
    gamma: Vector
    iota: Vector
    varsigma: Vector


class FrameMotion(NamedTuple):
    """Motion of a link frame: angular, and acceleration, jerk and snap of its origin."""

    angular: _Angular
    a: Vector
    j: Vector
    s: Vector


class _PointRates(NamedTuple):
    """First to fourth derivative of the position of a point fixed in a frame, from the frame's origin."""

    first: Vector
    second: Vector
    third: Vector
    fourth: Vector


class _Slide(NamedTuple):
    """Terms of a prismatic joint's offset d(t) in p', and in (40), (42), (44)."""

    dp: Vector
    a: Vector
    j: Vector
    s: Vector


_NO_SLIDE = _Slide(ZERO, ZERO, ZERO, ZERO)


class MovingBody(NamedTuple):
    """Quantities of link k for the backward pass.

    Attributes:
        rotation: Rotation R from frame k to frame k-1: `apply` is R, `undo` its transpose.
        z: Axis z of frame k-1, in frame k.
        frame: Motion of frame k.
        p: Vector from origin k-1 to origin k, p', p''.
        c: Vector from origin k to the center of mass, c', c''.
        force: Inertial force and its derivatives, (46)-(48).
        moment: Inertial moment and its derivatives, (49)-(51).
    """

    rotation: Rotation
    z: Vector
    frame: FrameMotion
    p: tuple[Vector, Vector, Vector]
    c: tuple[Vector, Vector, Vector]
    force: tuple[Vector, Vector, Vector]
    moment: tuple[Vector, Vector, Vector]


class _Reaction(NamedTuple):
    """Force f and moment n of link k-1 on link k, with their derivatives f', f'', n', n''.

    For k = N + 1, force and moment of the last link on the environment.
    """

    f: tuple[Vector, Vector, Vector]
    n: tuple[Vector, Vector, Vector]


_NO_REACTION = _Reaction((ZERO, ZERO, ZERO), (ZERO, ZERO, ZERO))


def recursion(
    links: Sequence[LinkConstants],
    states: Sequence[JointState],
    gravity: Vector,
    tip: TipLoad | None = None,
) -> list[TorqueDerivatives]:
    """Run (36)-(60) once over a chain.

    Args:
        links: Constants of each joint and link, base to tip.
        states: Pose and motion of each joint, in the same order.
        gravity: Acceleration of gravity in frame 0, m/s^2.
        tip: Load of the end effector on the environment, if any; N and N m per s^k.

    Returns:
        tau_e, tau_e', tau_e'' of each joint, base to tip; N m (N at a prismatic joint) per s^k.
    """
    return backward(links, states, forward(links, states, base_frame(gravity)), tip)


def base_frame(gravity: Vector) -> FrameMotion:
    """Return frame 0 at rest, with the acceleration -g that stands for gravity (IV-A)."""
    return FrameMotion(_Angular(ZERO, ZERO, ZERO, ZERO), a=ZERO - gravity, j=ZERO, s=ZERO)


def forward(
    links: Sequence[LinkConstants], states: Sequence[JointState], previous: FrameMotion
) -> list[MovingBody]:
    """Run (36)-(51) from a frame whose motion is known to the tip."""
    bodies = []
    for link, state in zip(links, states, strict=True):
        # Computes _forward(link, state, previous); `call` lets links of equal structure share one body.
        body: MovingBody = call(state.rates[0], _forward, link, state, previous)
        previous = body.frame
        bodies.append(body)
    return bodies


def backward(
    links: Sequence[LinkConstants],
    states: Sequence[JointState],
    bodies: Sequence[MovingBody],
    tip: TipLoad | None,
) -> list[TorqueDerivatives]:
    """Run (52)-(60) from tip to base; arguments and result as for `recursion`."""
    torques: list[TorqueDerivatives] = []
    beyond = _NO_REACTION if tip is None else _tip_reaction(tip, bodies)
    for link, state, body in zip(reversed(links), reversed(states), reversed(bodies), strict=True):
        of_base = body is bodies[0]
        torque, beyond = call(state.rates[0], _backward, link, state, body, beyond, of_base)
        torques.append(torque)
    return torques[::-1]


def _forward(link: LinkConstants, state: JointState, previous: FrameMotion) -> MovingBody:
    turning, sliding = (state.rates, (0, 0, 0, 0)) if link.revolute else ((0, 0, 0, 0), state.rates)
    rotation = Rotation(state.cos, state.sin, link.cos_alpha, link.sin_alpha)
    z = Vector(0, link.sin_alpha, link.cos_alpha)
    p = Vector(link.a, mul(state.d, link.sin_alpha), mul(state.d, link.cos_alpha))

    angular = _angular_motion(rotation, turning, previous.angular)
    p_rates = _point_rates(angular, p)  # of the origin of frame k, in (40), (42), (44)
    slide = _slide(angular, sliding, z) if not link.revolute else _NO_SLIDE
    frame = FrameMotion(
        angular,
        a=rotation.undo(previous.a) + p_rates.second + slide.a,  # (40)
        j=rotation.undo(previous.j) + p_rates.third + slide.j,  # (42)
        s=rotation.undo(previous.s) + p_rates.fourth + slide.s,  # (44)
    )
    c_rates = _point_rates(angular, link.com)  # of the center of mass, in (41), (43), (45)
    a_c, j_c, s_c = (
        frame.a + c_rates.second,
        frame.j + c_rates.third,
        frame.s + c_rates.fourth,
    )  # (41) (43) (45)
    return MovingBody(
        rotation=rotation,
        z=z,
        frame=frame,
        p=(p, p_rates.first + slide.dp, p_rates.second + slide.a),
        c=(link.com, c_rates.first, c_rates.second),
        # (46)-(51) belong to the paper's backward pass, but do not depend on other links.
        force=(a_c * link.mass, j_c * link.mass, s_c * link.mass),  # (46)-(48)
        moment=_euler(link.inertia, angular),
    )


def _angular_motion(rotation: Rotation, turning: Sequence[Scalar], previous: _Angular) -> _Angular:
    # omega to varsigma of frame k-1, theta' z0 to theta'''' z0. `undo` is R^T, from frame k-1 to k.
    w, g, iota, varsigma = previous
    t1z, t2z, t3z, t4z = (Z0 * rate for rate in turning)
    w_t1z, g_t1z = cross(w, t1z), cross(g, t1z)
    ww_t1z = cross(w, w_t1z)
    return _Angular(
        omega=rotation.undo(w + t1z),  # (36)
        gamma=rotation.undo(g + t2z + w_t1z),  # (37)
        iota=rotation.undo(iota + t3z + g_t1z + cross(w, t2z * 2 + w_t1z)),  # (38)
        varsigma=rotation.undo(  # (39)
            varsigma + t4z + cross(g, t2z) * 3 + cross(w, t3z + cross(w, t2z)) * 3
            + cross(g, w_t1z) * 2 + cross(w, ww_t1z + g_t1z) + cross(iota, t1z)
        ),
    )  # fmt: skip


def _point_rates(angular: _Angular, r: Vector) -> _PointRates:
    # Derivatives of r' = omega x r, each from those before; expanded, the terms of (40)-(45).
    w, g, iota, varsigma = angular
    first = cross(w, r)
    second = cross(g, r) + cross(w, first)
    third = cross(iota, r) + cross(g, first) * 2 + cross(w, second)
    fourth = cross(varsigma, r) + cross(iota, first) * 3 + cross(g, second) * 3 + cross(w, third)
    return _PointRates(first, second, third, fourth)


def _slide(angular: _Angular, sliding: Sequence[Scalar], z: Vector) -> _Slide:
    d1, d2, d3, d4 = sliding
    z_rates = _point_rates(angular, z)
    return _Slide(
        dp=z * d1,
        a=z * d2 + z_rates.first * (2 * d1),  # of (40)
        j=z * d3 + z_rates.first * (3 * d2) + z_rates.second * (3 * d1),  # of (42)
        s=z * d4 + z_rates.first * (4 * d3) + z_rates.second * (6 * d2) + z_rates.third * (4 * d1),  # of (44)
    )


def _euler(inertia: SymmetricTensor, angular: _Angular) -> tuple[Vector, Vector, Vector]:
    w, g, iota, varsigma = angular
    inertia_w, inertia_g = inertia.times(w), inertia.times(g)
    g_x_w = cross(g, w)
    moment = inertia_g + cross(w, inertia_w)  # (49)
    dmoment = cross(w, inertia_g + moment) + inertia.times(g_x_w + iota) + cross(g, inertia_w)  # (50)
    # omega x (omega x gamma) = -omega x (gamma x omega)
    ddmoment = (  # (51)
        cross(g, inertia_g + moment * 2) + cross(iota, inertia_w)
        + inertia.times(cross(iota, w) * 2 - cross(w, g_x_w) + varsigma)
        + cross(w, cross(w, inertia_g) + inertia.times(iota + g_x_w) * 2 + dmoment)
    )  # fmt: skip
    return moment, dmoment, ddmoment


def _tip_reaction(tip: TipLoad, bodies: Sequence[MovingBody]) -> _Reaction:
    """Return f_N+1, n_N+1 and their derivatives, about the origin of frame N, in frame N."""
    angular = bodies[-1].frame.angular
    if tip.in_base:
        rotations = [body.rotation for body in bodies]
        f, df, ddf = (_into_last_frame(rotations, vector) for vector in tip.force)
        m, dm, ddm = (_into_last_frame(rotations, vector) for vector in tip.moment)
    else:
        f, df, ddf = _turning(angular, *tip.force)
        m, dm, ddm = _turning(angular, *tip.moment)

    v_r = _point_rates(angular, tip.point)
    r, dr, ddr = tip.point, v_r.first, v_r.second
    n = m + cross(r, f)
    dn = dm + cross(dr, f) + cross(r, df)
    ddn = ddm + cross(ddr, f) + cross(dr, df) * 2 + cross(r, ddf)
    return _Reaction((f, df, ddf), (n, dn, ddn))


def _into_last_frame(rotations: Sequence[Rotation], v: Vector) -> Vector:
    for rotation in rotations:
        v = call(v.x, Rotation.undo, rotation, v)
    return v


def _turning(angular: _Angular, u: Vector, du: Vector, ddu: Vector) -> tuple[Vector, Vector, Vector]:
    """Return a vector with components u(t) in a rotating frame, and its derivatives in the base frame."""
    w, g = angular.omega, angular.gamma
    w_u = cross(w, u)
    return u, du + w_u, ddu + cross(w, du) * 2 + cross(g, u) + cross(w, w_u)


def _backward(
    link: LinkConstants, state: JointState, body: MovingBody, beyond: _Reaction, of_base: bool
) -> tuple[TorqueDerivatives, _Reaction]:
    """Return the torque of a joint, and the reaction on its link in frame k-1; zero if that is the base."""
    reaction = _reaction(body, beyond)
    torque = _project(link, state, body, reaction)
    return torque, _NO_REACTION if of_base else _in_previous_frame(body.rotation, reaction)


def _reaction(body: MovingBody, beyond: _Reaction) -> _Reaction:
    (c, dc, ddc), (p, dp, ddp) = body.c, body.p
    force, dforce, ddforce = body.force
    moment, dmoment, ddmoment = body.moment

    # `beyond` is the reaction on link k+1, already in frame k.
    f = beyond.f[0] + force  # (52)
    df = beyond.f[1] + dforce  # (53)
    ddf = beyond.f[2] + ddforce  # (54)
    n = beyond.n[0] + cross(c, force) + cross(p, f) + moment  # (55)
    dn = (  # (56)
        beyond.n[1] + cross(dc, force) + cross(c, dforce) + cross(dp, f) + cross(p, df) + dmoment
    )
    ddn = (  # (57)
        beyond.n[2] + cross(ddc, force) + cross(dc, dforce) * 2 + cross(c, ddforce)
        + cross(ddp, f) + cross(dp, df) * 2 + cross(p, ddf) + ddmoment
    )  # fmt: skip
    return _Reaction((f, df, ddf), (n, dn, ddn))


def _project(
    link: LinkConstants, state: JointState, body: MovingBody, reaction: _Reaction
) -> TorqueDerivatives:
    w, g, z = body.frame.angular.omega, body.frame.angular.gamma, body.z
    x, dx, ddx = reaction.n if link.revolute else reaction.f
    x_w = cross(x, w)
    dq, ddq, d3q, _ = state.rates
    tau = add(x.dot(z), mul(link.viscous_damping, dq))  # (58)
    dtau = add((dx + x_w).dot(z), mul(link.viscous_damping, ddq))  # (59)
    # `along=z` drops the components of the products that the inner product with z does not need.
    ddx_turned = ddx + cross(dx, w, along=z) * 2 + cross(x, g, along=z) + cross(x_w, w, along=z)
    ddtau = add(ddx_turned.dot(z), mul(link.viscous_damping, d3q))  # (60)
    # Beyond the paper: torque against dry friction and dampers between the links, 0 without them.
    return TorqueDerivatives(*map(add, (tau, dtau, ddtau), state.resistance))


def _in_previous_frame(rotation: Rotation, reaction: _Reaction) -> _Reaction:
    f, df, ddf = (rotation.apply(vector) for vector in reaction.f)
    n, dn, ddn = (rotation.apply(vector) for vector in reaction.n)
    return _Reaction((f, df, ddf), (n, dn, ddn))
