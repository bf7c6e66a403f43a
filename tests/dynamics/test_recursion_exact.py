"""The recursion (36)-(60) in exact rational arithmetic: a difference is zero or not, without a tolerance.

The recursion is a polynomial in its inputs. Two different polynomials of degree n agree at a point drawn from
s values per input with a probability of at most n / s (Schwartz, Zippel), so a few random points decide.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import cache
from operator import add

import numpy as np
import pytest
from oracles.contact import Contact, contact_torques
from oracles.jets import Jet, Scalar, circle
from oracles.lagrange import Array, Chain, Link, Place, State
from oracles.mutants import Mutant, mutants_of
from oracles.rational import random_chain, random_contact, random_tree
from samples.marks import slow, slow_but

from vsacli.compute.vector import Matrix, SymmetricTensor, Vector
from vsacli.dynamics import recursion as recursion_module
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import (
    Carrier,
    JointState,
    LinkConstants,
    RecursionInputs,
    Seat,
    ToolLoad,
)

type_chains = pytest.mark.parametrize("types", ["R", "P", "RR", "RP", "PR", "PP", "RPR", "RRP"])
contacts = pytest.mark.parametrize(
    "contact",
    [(), (random_contact(1, in_base=False),), (random_contact(2, in_base=True),)],
    ids=["free", "contact in the last frame", "contact in the base frame"],
)
seeds = pytest.mark.parametrize("seed", [1, slow(2)])

Recursion = Callable[..., Sequence[tuple[Scalar, Scalar, Scalar]]]
RICHEST_CHAIN = random_chain("RPR", 1)
"""A chain in which, with a contact in either frame, every term of every equation of a chain is at work."""

RICHEST_TREE = random_tree("RPRR", (-1, 0, 0, 1), (0, 2, 3), 1)
"""A tree in which that of every seat and every sum of reactions is at work, too."""

TREE_CONTACTS = (
    random_contact(3, in_base=False, link=2),
    random_contact(4, in_base=True, link=3),
    random_contact(5, in_base=True, link=0),
)
"""At both tips, and at the link that carries both."""

RICH_CASES: tuple[tuple[Chain, tuple[Contact, ...]], ...] = (
    (RICHEST_CHAIN, (random_contact(3, in_base=False),)),
    (RICHEST_CHAIN, (random_contact(4, in_base=True),)),
    (RICHEST_TREE, TREE_CONTACTS),
)

TREES = {
    "two on the base": ("RP", (-1, -1), ()),
    "one on a seat of the base": ("RR", (-1, 0), (0,)),
    "one on a seat": ("PR", (-1, 0), (1,)),
    "a fork": ("RRP", (-1, 0, 0), (1,)),
    "a fork of seats": ("PRR", (-1, 0, 0), (1, 2)),
    "two on the base, one a chain": ("RPR", (-1, -1, 0), (0, 2)),
    "a fork behind a joint": ("RRPR", (-1, 0, 1, 1), (1, 3)),
}
"""Types, parents and joints on seats."""

NO_RATES = ((0, 0, 0), (0, 0, 0))

trees = pytest.mark.parametrize("shape", TREES.values(), ids=TREES)

MUTANTS = mutants_of(recursion_module, "recursion")
COEFFICIENTS = [mutant for mutant in MUTANTS if mutant.coefficient]


def link_constants(link: Link) -> LinkConstants:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
    return LinkConstants(
        revolute=link.revolute,
        a=link.a,
        cos_alpha=link.cos_alpha,
        sin_alpha=link.sin_alpha,
        mass=link.mass,
        com=Vector(*link.com),
        inertia=SymmetricTensor(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz),
        viscous_damping=link.damping,
    )


def joint_state(state: State) -> JointState:
    dq, ddq, d3q, d4q = state.rates
    return JointState(state.cos, state.sin, state.d, (dq, ddq, d3q, d4q))


def joint_state_jets(link: Link, state: State) -> JointState:
    """The state with its first two derivatives, along the path whose rates beyond q'''' are zero."""
    rates = [*state.rates, 0, 0]
    turning, sliding = (rates, [0, 0]) if link.revolute else ([0, 0], rates)
    cosines, sines = circle(state.cos, state.sin, turning[:2])
    dq, ddq, d3q, d4q = (Jet(*rates[order : order + 3]) for order in range(4))
    return JointState(Jet(*cosines), Jet(*sines), Jet(state.d, *sliding[:2]), (dq, ddq, d3q, d4q))


def tool_load(contact: Contact, links: int) -> ToolLoad:
    force, moment = ([Vector(*row) for row in rows] for rows in (contact.force, contact.moment))
    return ToolLoad(contact.link % links, force, moment, Vector(*contact.point), contact.in_base)


def tool_load_jets(contact: Contact, links: int) -> ToolLoad:
    """The load with its first two derivatives; those beyond the second of a component are zero."""
    force, moment = (_jets([*rows, *NO_RATES]) for rows in (contact.force, contact.moment))
    return ToolLoad(contact.link % links, force, moment, Vector(*contact.point), contact.in_base)


def seat_of(pose: Array) -> Seat:
    return Seat(Matrix(*(Vector(*row) for row in pose[:3, :3])), Vector(*pose[:3, 3]))


def _jets(rows: Sequence[Sequence[Scalar]]) -> list[Vector]:
    """A vector and its two derivatives, from five derivatives of it."""
    axes = list(zip(*rows, strict=True))
    return [Vector(*(Jet(*axis[order : order + 3]) for axis in axes)) for order in range(3)]


def inputs_of(chain: Chain, states: Sequence[JointState], loads: Sequence[ToolLoad]) -> RecursionInputs:
    links = [link_constants(link) for link in chain.links]
    carriers = [Carrier(parent, None if seat is None else seat_of(seat)) for parent, seat in chain.places]
    return RecursionInputs(links, states, carriers, Vector(*chain.gravity[:3]), loads)


def torques(
    chain: Chain, contacts: Sequence[Contact] = (), run: Recursion = recursion
) -> list[tuple[Scalar, ...]]:
    """(tau_e, dtau_e, ddtau_e) of each joint."""
    states = [joint_state(state) for state in chain.states]
    loads = [tool_load(contact, len(states)) for contact in contacts]
    return [tuple(joint) for joint in run(inputs_of(chain, states, loads))]


def ladder_gaps(chain: Chain, contacts: Sequence[Contact] = (), run: Recursion = recursion) -> list[Scalar]:
    """d/dt tau_e - dtau_e, d2/dt2 tau_e - ddtau_e and d/dt dtau_e - ddtau_e of each joint."""
    states = [joint_state_jets(*pair) for pair in zip(chain.links, chain.states, strict=True)]
    loads = [tool_load_jets(contact, len(states)) for contact in contacts]
    gaps = []
    for tau, dtau, ddtau in run(inputs_of(chain, states, loads)):
        _, tau_1, tau_2 = tau.derivatives
        dtau_0, dtau_1, _ = dtau.derivatives
        gaps += [tau_1 - dtau_0, tau_2 - ddtau.derivatives[0], dtau_1 - ddtau.derivatives[0]]
    return gaps


@cache
def torques_of_rich_cases() -> list[list[tuple[Scalar, ...]]]:
    """Torques by Lagrange's equations of the cases that tell mutants apart."""
    return [lagrange_torques(*case) for case in RICH_CASES]


def lagrange_torques(chain: Chain, contacts: Sequence[Contact]) -> list[tuple[Scalar, ...]]:
    orders = [chain.torques(order) for order in range(3)]
    for contact in contacts:
        of_contact = [contact_torques(chain, contact, order) for order in range(3)]
        orders = [list(map(add, *pair)) for pair in zip(orders, of_contact, strict=True)]
    return list(zip(*orders, strict=True))


@type_chains
@contacts
@seeds
def test_derivatives_of_the_torque_are_its_derivatives(
    types: str, contact: tuple[Contact, ...], seed: int
) -> None:
    gaps = ladder_gaps(random_chain(types, seed), contact)
    assert gaps == [0] * len(gaps)


@type_chains
@contacts
def test_torques_and_derivatives_satisfy_lagranges_equations(
    types: str, contact: tuple[Contact, ...]
) -> None:
    chain = random_chain(types, seed=3)
    assert torques(chain, contact) == lagrange_torques(chain, contact)


@trees
@pytest.mark.parametrize("loaded", [False, True], ids=["free", "contacts at two links"])
def test_trees_satisfy_lagranges_equations(
    shape: tuple[str, Sequence[int], Collection[int]], loaded: bool
) -> None:
    tree = random_tree(*shape, seed=4)
    loads = (random_contact(6, in_base=True, link=0), random_contact(7, in_base=False)) if loaded else ()
    assert torques(tree, loads) == lagrange_torques(tree, loads)
    gaps = ladder_gaps(tree, loads)
    assert gaps == [0] * len(gaps)


def test_a_seat_at_the_frame_of_the_link_changes_nothing() -> None:
    free, at_frame = (
        Chain(RICHEST_TREE.links, RICHEST_TREE.states, RICHEST_TREE.gravity[:3], places)
        for places in (
            [Place(parent) for parent, _ in RICHEST_TREE.places],
            [Place(parent, np.eye(4, dtype=int)) for parent, _ in RICHEST_TREE.places],
        )
    )
    assert torques(free, TREE_CONTACTS) == torques(at_frame, TREE_CONTACTS)


@pytest.mark.parametrize("mutant", slow_but(MUTANTS[::4], MUTANTS), ids=lambda mutant: mutant.label)
def test_every_changed_term_contradicts_lagranges_equations(mutant: Mutant) -> None:
    run = mutant.load().recursion
    cases = zip(RICH_CASES, torques_of_rich_cases(), strict=True)
    assert any(torques(*case, run) != expected for case, expected in cases)


@pytest.mark.parametrize("mutant", slow_but(COEFFICIENTS[::3], COEFFICIENTS), ids=lambda mutant: mutant.label)
def test_every_changed_coefficient_breaks_the_ladder(mutant: Mutant) -> None:
    run = mutant.load().recursion
    assert any(any(ladder_gaps(*case, run)) for case in RICH_CASES)


def test_the_binomial_coefficients_of_every_order_are_among_the_changed() -> None:
    assert {mutant.coefficient for mutant in MUTANTS} == {None, 2, 3, 4, 6}
