"""The recursion (36)-(60) in exact rational arithmetic: a difference is zero or not, without a tolerance.

The recursion is a polynomial in its inputs. Two different polynomials of degree n agree at a point drawn from
s values per input with a probability of at most n / s (Schwartz, Zippel), so a few random points decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from operator import add

import pytest
from oracles.contact import Contact, contact_torques
from oracles.jets import Jet, Scalar, circle
from oracles.lagrange import Chain, Link, State
from oracles.mutants import Mutant, mutants_of
from oracles.rational import random_chain, random_contact
from samples.marks import slow, slow_but
from samples.serial_links import serial_links

from vsacli.compute.vector import SymmetricTensor, Vector
from vsacli.dynamics import recursion as recursion_module
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import JointState, LinkConstants, ToolLoad

type_chains = pytest.mark.parametrize("types", ["R", "P", "RR", "RP", "PR", "PP", "RPR", "RRP"])
contacts = pytest.mark.parametrize(
    "contact",
    [None, random_contact(1, in_base=False), random_contact(2, in_base=True)],
    ids=["free", "contact in the last frame", "contact in the base frame"],
)
seeds = pytest.mark.parametrize("seed", [1, slow(2)])

Recursion = Callable[..., Sequence[tuple[Scalar, Scalar, Scalar]]]
RICHEST_CHAIN = ("RPR", 1)
"""Type and seed of a chain in which, with `RICH_CONTACTS`, every term of every equation is at work."""

RICH_CONTACTS = (random_contact(3, in_base=False), random_contact(4, in_base=True))

NO_RATES = ((0, 0, 0), (0, 0, 0))

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


def tool_load(contact: Contact, joint: int) -> ToolLoad:
    force, moment = ([Vector(*row) for row in rows] for rows in (contact.force, contact.moment))
    return ToolLoad(joint, force, moment, Vector(*contact.point), contact.in_base)


def tool_load_jets(contact: Contact, joint: int) -> ToolLoad:
    """The load with its first two derivatives; those beyond the second of a component are zero."""
    force, moment = (_jets([*rows, *NO_RATES]) for rows in (contact.force, contact.moment))
    return ToolLoad(joint, force, moment, Vector(*contact.point), contact.in_base)


def _jets(rows: Sequence[Sequence[Scalar]]) -> list[Vector]:
    """A vector and its two derivatives, from five derivatives of it."""
    axes = list(zip(*rows, strict=True))
    return [Vector(*(Jet(*axis[order : order + 3]) for axis in axes)) for order in range(3)]


def torques(
    chain: Chain, contact: Contact | None = None, run: Recursion = recursion
) -> list[tuple[Scalar, ...]]:
    """(tau_e, dtau_e, ddtau_e) of each joint."""
    links = [link_constants(link) for link in chain.links]
    states = [joint_state(state) for state in chain.states]
    load = contact and tool_load(contact, len(links) - 1)
    return [tuple(joint) for joint in run(serial_links(links, states, Vector(*chain.gravity[:3]), load))]


def ladder_gaps(chain: Chain, contact: Contact | None = None, run: Recursion = recursion) -> list[Scalar]:
    """d/dt tau_e - dtau_e, d2/dt2 tau_e - ddtau_e and d/dt dtau_e - ddtau_e of each joint."""
    links = [link_constants(link) for link in chain.links]
    states = [joint_state_jets(*pair) for pair in zip(chain.links, chain.states, strict=True)]
    load = contact and tool_load_jets(contact, len(links) - 1)
    gaps = []
    for tau, dtau, ddtau in run(serial_links(links, states, Vector(*chain.gravity[:3]), load)):
        _, tau_1, tau_2 = tau.derivatives
        dtau_0, dtau_1, _ = dtau.derivatives
        gaps += [tau_1 - dtau_0, tau_2 - ddtau.derivatives[0], dtau_1 - ddtau.derivatives[0]]
    return gaps


@cache
def richest_cases() -> list[tuple[Chain, Contact, list[tuple[Scalar, ...]]]]:
    """The chain with the contacts that tell mutants apart, and its torques by Lagrange's equations."""
    chain = random_chain(*RICHEST_CHAIN)
    return [(chain, contact, lagrange_torques(chain, contact)) for contact in RICH_CONTACTS]


def lagrange_torques(chain: Chain, contact: Contact | None) -> list[tuple[Scalar, ...]]:
    orders = [chain.torques(order) for order in range(3)]
    if contact is not None:
        of_contact = [contact_torques(chain, contact, order) for order in range(3)]
        orders = [list(map(add, *pair)) for pair in zip(orders, of_contact, strict=True)]
    return list(zip(*orders, strict=True))


@type_chains
@contacts
@seeds
def test_derivatives_of_the_torque_are_its_derivatives(
    types: str, contact: Contact | None, seed: int
) -> None:
    gaps = ladder_gaps(random_chain(types, seed), contact)
    assert gaps == [0] * len(gaps)


@type_chains
@contacts
def test_torques_and_derivatives_satisfy_lagranges_equations(types: str, contact: Contact | None) -> None:
    chain = random_chain(types, seed=3)
    assert torques(chain, contact) == lagrange_torques(chain, contact)


@pytest.mark.parametrize("mutant", slow_but(MUTANTS[::4], MUTANTS), ids=lambda mutant: mutant.label)
def test_every_changed_term_contradicts_lagranges_equations(mutant: Mutant) -> None:
    run = mutant.load().recursion
    assert any(torques(chain, contact, run) != expected for chain, contact, expected in richest_cases())


@pytest.mark.parametrize("mutant", slow_but(COEFFICIENTS[::3], COEFFICIENTS), ids=lambda mutant: mutant.label)
def test_every_changed_coefficient_breaks_the_ladder(mutant: Mutant) -> None:
    run = mutant.load().recursion
    assert any(any(ladder_gaps(chain, contact, run)) for chain, contact, _ in richest_cases())


def test_the_binomial_coefficients_of_every_order_are_among_the_changed() -> None:
    assert {mutant.coefficient for mutant in MUTANTS} == {None, 2, 3, 4, 6}
