"""Chains of exact fractions: twists and angles at rational points of the circle."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np

from oracles.contact import Contact
from oracles.lagrange import Chain, Link, State


def random_chain(types: str, seed: int) -> Chain:
    """A spatial chain such as "RP", every constant and every rate a random fraction, none of them 0."""
    rng = random.Random(seed)
    links = [_link(rng, letter == "R") for letter in types]
    states = [_state(rng) for _ in types]
    return Chain(links, states, _vector(rng))


def random_contact(seed: int, *, in_base: bool) -> Contact:
    """Force, moment, their derivatives and the point of contact random fractions."""
    rng = random.Random(seed)
    force, moment = ([_vector(rng) for _ in range(3)] for _ in range(2))
    return Contact(force, moment, _vector(rng), in_base)


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
