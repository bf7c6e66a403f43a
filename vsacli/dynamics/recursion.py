"""The recursion of Buondonno & De Luca (2016), (36)-(60): link torques and their first two derivatives.

`forward` runs (36)-(51) from the base to the tips, `backward` (52)-(60) from the tips to the base. The paper
has chains; in a tree, "frame k-1" is the seat of joint k: the frame on the link that carries it at which its
row begins. The reactions of all joints on a link add up. Scalars are of any kind: floats, NumPy rows of
samples, complex numbers, fractions, symbols. Given cos and sin of each joint angle (and the offset d of
prismatic joints) the recursion is a polynomial in its inputs.

Every quantity of frame k is a derivative taken in the base frame, written in components of frame k.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from vsacli.compute.control_flow import call
from vsacli.compute.vector import ZERO, Matrix, Rotation, Scalar, SymmetricTensor, Vector, add, cross, mul
from vsacli.dynamics.recursion_inputs import (
    Carrier,
    JointState,
    LinkConstants,
    RecursionInputs,
    Seat,
    ToolLoad,
    TorqueDerivatives,
)

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


class _SlidingTerms(NamedTuple):
    """Terms of a prismatic joint's offset d(t) in p', and in (40), (42), (44)."""

    dp: Vector
    a: Vector
    j: Vector
    s: Vector


_NO_SLIDING = _SlidingTerms(ZERO, ZERO, ZERO, ZERO)


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


_VectorDerivatives: TypeAlias = tuple[Vector, Vector, Vector]
"""A vector and its first two derivatives in the base frame."""


class _Reaction(NamedTuple):
    """Force f and moment n of link k-1 on link k, with their derivatives f', f'', n', n''.

    Also those of a link on a tool's environment, and of a link on all that it carries.
    """

    f: _VectorDerivatives
    n: _VectorDerivatives


_NO_REACTION = _Reaction((ZERO, ZERO, ZERO), (ZERO, ZERO, ZERO))


def recursion(inputs: RecursionInputs) -> list[TorqueDerivatives]:
    """Run (36)-(60) once over a tree.

    Returns:
        tau_e, tau_e', tau_e'' of each joint; N m (N at a prismatic joint) per s^k.
    """
    return backward(inputs, forward(inputs))


def base_frame(gravity: Vector) -> FrameMotion:
    """Return frame 0 at rest, with the acceleration -g that stands for gravity (IV-A)."""
    return FrameMotion(_Angular(ZERO, ZERO, ZERO, ZERO), a=ZERO - gravity, j=ZERO, s=ZERO)


def forward(inputs: RecursionInputs) -> list[MovingBody]:
    """Run (36)-(51) from the base to the tips."""
    base, bodies = base_frame(inputs.gravity), list[MovingBody]()
    for link, state, (parent, seat) in zip(inputs.links, inputs.states, inputs.carriers, strict=True):
        frame = bodies[parent].frame if parent >= 0 else base
        # `call` computes e.g. _forward_step(link, state, frame); links of equal structure share one body.
        if seat is not None:
            frame = call(state.rates[0], _seat_motion, seat, frame)
        bodies.append(call(state.rates[0], _forward_step, link, state, frame))
    return bodies


def backward(inputs: RecursionInputs, bodies: Sequence[MovingBody]) -> list[TorqueDerivatives]:
    """Run (52)-(60) from the tips to the base; result as for `recursion`."""
    links, states, carriers, _, loads = inputs
    reactions_by_link: list[list[_Reaction]] = [[] for _ in links]
    torques: list[TorqueDerivatives] = []
    for index in reversed(range(len(links))):
        (parent, seat), row = carriers[index], states[index].rates[0]
        # Reactions of tools are computed next to their link, so that equal fingers share this code as well.
        tool_reactions = [_tool_reaction(load, carriers, bodies) for load in loads if load.joint == index]
        reaction_of_link = _total_reaction(row, [*tool_reactions, *reactions_by_link[index]])
        torque, reaction = call(
            row, _backward_step, links[index], states[index], bodies[index], reaction_of_link, parent < 0
        )
        torques.append(torque)
        if parent >= 0:
            if seat is not None:
                reaction = call(row, _seat_reaction, seat, bodies[parent].frame.angular, reaction)
            reactions_by_link[parent].append(reaction)
    return torques[::-1]


def _seat_motion(seat: Seat, frame: FrameMotion) -> FrameMotion:
    """Return the motion of a seat from that of the link frame, as (41), (43), (45) for its origin."""
    rates, into_seat = _point_rates(frame.angular, seat.lever), seat.rotation.transposed()
    return FrameMotion(
        _Angular(*map(into_seat.times, frame.angular)),
        a=into_seat.times(frame.a + rates.second),
        j=into_seat.times(frame.j + rates.third),
        s=into_seat.times(frame.s + rates.fourth),
    )


def _forward_step(link: LinkConstants, state: JointState, previous: FrameMotion) -> MovingBody:
    angle_rates, offset_rates = (state.rates, (0, 0, 0, 0)) if link.revolute else ((0, 0, 0, 0), state.rates)
    rotation = Rotation(state.cos, state.sin, link.cos_alpha, link.sin_alpha)
    z = Vector(0, link.sin_alpha, link.cos_alpha)
    p = Vector(link.a, mul(state.d, link.sin_alpha), mul(state.d, link.cos_alpha))

    angular = _angular_motion(rotation, angle_rates, previous.angular)
    p_rates = _point_rates(angular, p)  # of the origin of frame k, in (40), (42), (44)
    sliding_terms = _sliding_terms(angular, offset_rates, z) if not link.revolute else _NO_SLIDING
    frame = FrameMotion(
        angular,
        a=rotation.undo(previous.a) + p_rates.second + sliding_terms.a,  # (40)
        j=rotation.undo(previous.j) + p_rates.third + sliding_terms.j,  # (42)
        s=rotation.undo(previous.s) + p_rates.fourth + sliding_terms.s,  # (44)
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
        p=(p, p_rates.first + sliding_terms.dp, p_rates.second + sliding_terms.a),
        c=(link.com, c_rates.first, c_rates.second),
        # (46)-(51) belong to the paper's backward pass, but do not depend on other links.
        force=(a_c * link.mass, j_c * link.mass, s_c * link.mass),  # (46)-(48)
        moment=_inertial_moments(link.inertia, angular),
    )


def _angular_motion(rotation: Rotation, angle_rates: Sequence[Scalar], previous: _Angular) -> _Angular:
    # omega to varsigma of frame k-1, theta' z0 to theta'''' z0. `undo` is R^T, from frame k-1 to k.
    w, g, iota, varsigma = previous
    t1z, t2z, t3z, t4z = (Z0 * rate for rate in angle_rates)
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


def _sliding_terms(angular: _Angular, offset_rates: Sequence[Scalar], z: Vector) -> _SlidingTerms:
    d1, d2, d3, d4 = offset_rates
    z_rates = _point_rates(angular, z)
    return _SlidingTerms(
        dp=z * d1,
        a=z * d2 + z_rates.first * (2 * d1),  # of (40)
        j=z * d3 + z_rates.first * (3 * d2) + z_rates.second * (3 * d1),  # of (42)
        s=z * d4 + z_rates.first * (4 * d3) + z_rates.second * (6 * d2) + z_rates.third * (4 * d1),  # of (44)
    )


def _inertial_moments(inertia: SymmetricTensor, angular: _Angular) -> tuple[Vector, Vector, Vector]:
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


def _tool_reaction(load: ToolLoad, carriers: Sequence[Carrier], bodies: Sequence[MovingBody]) -> _Reaction:
    """Return force and moment of a tool on the environment about the origin of its link's frame, in it.

    In a chain they are f_N+1, n_N+1 and their derivatives.
    """
    angular = bodies[load.joint].frame.angular
    if load.in_base:
        f, df, ddf = (_in_link_frame(load.joint, carriers, bodies, vector) for vector in load.force)
        m, dm, ddm = (_in_link_frame(load.joint, carriers, bodies, vector) for vector in load.moment)
    else:
        f, df, ddf = _base_derivatives(angular, *load.force)
        m, dm, ddm = _base_derivatives(angular, *load.moment)
    return _Reaction((f, df, ddf), _shifted_moment(angular, load.point, (f, df, ddf), (m, dm, ddm)))


def _in_link_frame(
    joint: int, carriers: Sequence[Carrier], bodies: Sequence[MovingBody], v: Vector
) -> Vector:
    """Return components in frame 0 as components in a link frame."""
    parent, seat = carriers[joint]
    if parent >= 0:
        v = _in_link_frame(parent, carriers, bodies, v)
    if seat is not None:
        v = call(v.x, Matrix.times, seat.rotation.transposed(), v)
    rotated: Vector = call(v.x, Rotation.undo, bodies[joint].rotation, v)
    return rotated


def _shifted_moment(
    angular: _Angular, r: Vector, force: _VectorDerivatives, moment: _VectorDerivatives
) -> _VectorDerivatives:
    """Return the moment about the origin of a frame from that about a point r fixed in it."""
    point_rates, (f, df, ddf), (m, dm, ddm) = _point_rates(angular, r), force, moment
    dr, ddr = point_rates.first, point_rates.second
    return (
        m + cross(r, f),
        dm + cross(dr, f) + cross(r, df),
        ddm + cross(ddr, f) + cross(dr, df) * 2 + cross(r, ddf),
    )


def _seat_reaction(seat: Seat, angular: _Angular, reaction: _Reaction) -> _Reaction:
    """Return the reaction of a joint on its seat about the origin of the link frame, in this frame."""
    f, df, ddf = (seat.rotation.times(vector) for vector in reaction.f)
    n, dn, ddn = (seat.rotation.times(vector) for vector in reaction.n)
    return _Reaction((f, df, ddf), _shifted_moment(angular, seat.lever, (f, df, ddf), (n, dn, ddn)))


def _total_reaction(row: Scalar, reactions: Sequence[_Reaction]) -> _Reaction:
    """Return the sum of what the joints and tools on a link take from it."""
    total, *further = reactions or [_NO_REACTION]
    for reaction in further:
        total = call(row, _sum_of_reactions, total, reaction)
    return total


def _sum_of_reactions(first: _Reaction, second: _Reaction) -> _Reaction:
    f, df, ddf = (a + b for a, b in zip(first.f, second.f, strict=True))
    n, dn, ddn = (a + b for a, b in zip(first.n, second.n, strict=True))
    return _Reaction((f, df, ddf), (n, dn, ddn))


def _base_derivatives(angular: _Angular, u: Vector, du: Vector, ddu: Vector) -> tuple[Vector, Vector, Vector]:
    """Return a vector with components u(t) in a rotating frame, and its derivatives in the base frame."""
    w, g = angular.omega, angular.gamma
    w_u = cross(w, u)
    return u, du + w_u, ddu + cross(w, du) * 2 + cross(g, u) + cross(w, w_u)


def _backward_step(
    link: LinkConstants, state: JointState, body: MovingBody, outer_reaction: _Reaction, is_on_base: bool
) -> tuple[TorqueDerivatives, _Reaction]:
    """Return the torque of a joint, and the reaction on its link in frame k-1; zero if that is the base."""
    reaction = _link_reaction(body, outer_reaction)
    torque = _joint_torque(link, state, body, reaction)
    return torque, _NO_REACTION if is_on_base else _in_previous_frame(body.rotation, reaction)


def _link_reaction(body: MovingBody, outer: _Reaction) -> _Reaction:
    (c, dc, ddc), (p, dp, ddp) = body.c, body.p
    force, dforce, ddforce = body.force
    moment, dmoment, ddmoment = body.moment

    # `beyond` is the reaction on link k+1, or on all that link k carries, already in frame k.
    f = outer.f[0] + force  # (52)
    df = outer.f[1] + dforce  # (53)
    ddf = outer.f[2] + ddforce  # (54)
    n = outer.n[0] + cross(c, force) + cross(p, f) + moment  # (55)
    dn = (  # (56)
        outer.n[1] + cross(dc, force) + cross(c, dforce) + cross(dp, f) + cross(p, df) + dmoment
    )
    ddn = (  # (57)
        outer.n[2] + cross(ddc, force) + cross(dc, dforce) * 2 + cross(c, ddforce)
        + cross(ddp, f) + cross(dp, df) * 2 + cross(p, ddf) + ddmoment
    )  # fmt: skip
    return _Reaction((f, df, ddf), (n, dn, ddn))


def _joint_torque(
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
