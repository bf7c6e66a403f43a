"""Peer of batches: what a JAX user would do.

The rigid recursion (Luh, Walker and Paul, 1980) in double precision, compiled by `jax.jit`, mapped by
`jax.vmap` over samples and over variants, whose masses are an argument. It has no derivatives of the torques.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import numpy as np
from jax import numpy as jnp

from vsacli import Robot

jax.config.update("jax_enable_x64", True)


def mapped_torques(robot: Robot) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Torques, (variants, samples, joints), of masses, (variants, joints), along (3, samples, joints)."""
    over_samples = jax.vmap(lambda masses, motion: _torques(robot, masses, *motion), (None, 1))
    compiled = jax.jit(jax.vmap(over_samples, (0, None)))
    return lambda masses, motion: np.asarray(compiled(masses, motion))


def _torques(robot: Robot, masses: jax.Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
    """Torques of revolute joints by the outward and inward recursion, in the frames of the links."""
    z = jnp.array([0.0, 0.0, 1.0])
    omega, alpha, acceleration = jnp.zeros(3), jnp.zeros(3), -jnp.array(robot.gravity)
    bodies = []
    for k, joint in enumerate(robot.joints):
        dh, com = joint.dh, jnp.array(joint.link.com)
        ct, st = jnp.cos(q[k] + dh.theta), jnp.sin(q[k] + dh.theta)
        ca, sa = (round(function(dh.alpha), 15) for function in (np.cos, np.sin))
        rotation = jnp.array([[ct, -st * ca, st * sa], [st, ct * ca, -ct * sa], [0, sa, ca]])
        offset = jnp.array([dh.a, dh.d * sa, dh.d * ca])
        alpha = rotation.T @ (alpha + z * ddq[k] + jnp.cross(omega, z * dq[k]))
        omega = rotation.T @ (omega + z * dq[k])
        acceleration = rotation.T @ acceleration + _point(omega, alpha, offset)
        tensor = jnp.array(joint.link.inertia.tensor)
        force = masses[k] * (acceleration + _point(omega, alpha, com))
        moment = tensor @ alpha + jnp.cross(omega, tensor @ omega)
        bodies.append((rotation, offset, com, force, moment))
    torques, f, n = [], jnp.zeros(3), jnp.zeros(3)
    for k in reversed(range(len(bodies))):
        rotation, offset, com, force, moment = bodies[k]
        f = f + force
        n = n + moment + jnp.cross(com, force) + jnp.cross(offset, f)
        torques.append(n @ (rotation.T @ z) + robot.joints[k].damping * dq[k])
        f, n = rotation @ f, rotation @ n
    return jnp.stack(torques[::-1])


def _point(omega: jax.Array, alpha: jax.Array, r: jax.Array) -> jax.Array:
    return jnp.cross(alpha, r) + jnp.cross(omega, jnp.cross(omega, r))
