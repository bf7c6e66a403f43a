"""Chains and trees of exact fractions: twists, angles and seats at rational points of circle and sphere."""

from __future__ import annotations

import random
from collections.abc import Collection, Sequence
from fractions import Fraction

import numpy as np

from oracles.contact import Contact
from oracles.lagrange import Array, Chain, Link, Place, State


def random_chain(types: str, seed: int) -> Chain:
    """A spatial chain such as "RP", every constant and every rate a random fraction, none of them 0."""
    rng = random.Random(seed)
    links = [_link(rng, letter == "R") for letter in types]
    states = [_state(rng) for _ in types]
    return Chain(links, states, _vector(rng))


def random_tree(types: str, parents: Sequence[int], seated: Collection[int], seed: int) -> Chain:
    """A tree of the links that `random_chain` has, each on the one of its parent, some joints on seats."""
    chain, rng = random_chain(types, seed), random.Random(f"seats {seed}")
    places = [Place(parent, _seat(rng) if joint in seated else None) for joint, parent in enumerate(parents)]
    return Chain(chain.links, chain.states, chain.gravity[:3], places)


def random_contact(seed: int, *, in_base: bool, link: int = -1) -> Contact:
    """Force, moment, their derivatives and the point of contact random fractions."""
    rng = random.Random(seed)
    force, moment = ([_vector(rng) for _ in range(3)] for _ in range(2))
    return Contact(force, moment, _vector(rng), in_base, link)


def _seat(rng: random.Random) -> Array:
    """A pose whose rotation is that of a quaternion of integers, none of its entries 0 or +-1."""
    w, x, y, z = (rng.choice((-1, 1)) * n for n in rng.sample(range(2, 12), 4))
    square = Fraction(w * w + x * x + y * y + z * z)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3, dtype=int) + 2 * (w * cross + cross @ cross) / square
    seat = np.eye(4, dtype=object)
    seat[:3, :3], seat[:3, 3] = rotation, _vector(rng)
    return seat


def _link(rng: random.Random, revolute: bool) -> Link:
    cos_alpha, sin_alpha = _point_of_circle(rng)
    lower = np.array([[_number(rng) if column <= row else 0 for column in range(3)] for row in range(3)])
    return Link(
        revolute=revolute,
        a=_number(rng),
        cos_alpha=cos_alpha,
        sin_alpha=sin_alpha,
        mass=_number(rng),
        com=_vector(rng),
        inertia=lower @ lower.T,
        damping=_number(rng),
    )


def _state(rng: random.Random) -> State:
    cos, sin = _point_of_circle(rng)
    return State(cos, sin, _number(rng), [_number(rng) for _ in range(4)])


def _point_of_circle(rng: random.Random) -> tuple[Fraction, Fraction]:
    half_tangent = _number(rng)
    scale = 1 + half_tangent**2
    return (1 - half_tangent**2) / scale, 2 * half_tangent / scale


def _vector(rng: random.Random) -> np.ndarray:
    return np.array([_number(rng) for _ in range(3)])


def _number(rng: random.Random) -> Fraction:
    """Neither 0 nor +-1, which the code under test may treat apart (and which are no generic point)."""
    return Fraction(rng.choice((-1, 1)) * rng.randint(11, 97), rng.choice((2, 3, 5, 7)))
