"""The kinds of actuator by name, and examples of each for new robot files.

To add a kind, derive a class from `vsacli.actuators.actuator.Actuator` and add a line to `ACTUATORS`, and to
`mechanisms_of` if its springs may be of several laws or mechanisms.
"""

from __future__ import annotations

from typing import Any

from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.lazy import LazyRegistry

ACTUATORS = LazyRegistry(
    {
        "antagonistic": "vsacli.actuators.antagonistic:Antagonistic",
        "elastic": "vsacli.actuators.elastic:Elastic",
        "rigid": "vsacli.actuators.rigid:Rigid",
        "serial": "vsacli.actuators.serial:Serial",
    }
)
"""Kinds of actuator by their name in a robot file."""

TENDONS = ("exponential", "quadratic")
"""Laws of springs that only pull, of which a joint needs two."""


def mechanisms_of(kind: str) -> tuple[str, ...]:
    """Return the mechanisms or spring laws of which new actuators of a kind can be made."""
    from vsacli.actuators.laws import LAWS  # imports NumPy, which a help text does not need

    mechanisms_by_kind = {
        "antagonistic": tuple(LAWS),
        "elastic": tuple(law for law in LAWS if law not in TENDONS),
        "serial": tuple(MECHANISMS),
    }
    return mechanisms_by_kind.get(kind, ())


def kind_and_mechanism(text: str) -> tuple[str, str | None]:
    """Return a kind of actuator and its mechanism or spring law; None for the usual one.

    Args:
        text: `KIND` or `KIND:MECHANISM`; a mechanism alone is one of a serial actuator.

    Raises:
        InputError: There is no such kind, or it has no such mechanism.
    """
    kind, colon, mechanism = text.partition(":")
    if kind in MECHANISMS and not colon:
        return "serial", kind
    if kind not in ACTUATORS:
        suggestions = [f"{owner}:{kind}" for owner in ACTUATORS if kind in mechanisms_of(owner)]
        hint = (
            f"; write {' or '.join(suggestions)}"
            if suggestions
            else did_you_mean(kind, (*ACTUATORS, *MECHANISMS))
        )
        raise InputError.one(f"{kind!r} is not a kind of actuator{hint}")
    names = mechanisms_of(kind) if colon else ()
    if colon and mechanism not in names:
        hint = did_you_mean(mechanism, names) if names else f"; write {kind} alone"
        raise InputError.one(f"{mechanism!r} is not a mechanism or spring law of {kind} actuators{hint}")
    return kind, mechanism or None


def example(text: str, joint_type: str) -> dict[str, Any]:
    """Return plausible values of a joint's key `actuator`.

    Args:
        text: Kind of actuator and its mechanism, as in `kind_and_mechanism`.
        joint_type: Type of the joint.

    Raises:
        InputError: There is no such kind or mechanism, or it does not drive such joints.
    """
    kind, mechanism = kind_and_mechanism(text)
    if mechanism is not None and not _has_example(mechanism, joint_type):
        if mechanism in MECHANISMS and joint_type not in MECHANISMS[mechanism].joint_types:
            reason = f"{mechanism} turns about an axis, and drives no {joint_type} joint"
        else:
            reason = f"there is no example of {mechanism} for a {joint_type} joint"
        alternatives = [other for other in mechanisms_of(kind) if _has_example(other, joint_type)]
        raise InputError.one(f"{reason}; choose {' or '.join(alternatives)}")
    return {"type": kind, **ACTUATORS[kind].example(joint_type, mechanism)}


def _has_example(mechanism: str, joint_type: str) -> bool:
    """Return whether a mechanism or spring law has an example for such joints."""
    from vsacli.actuators.laws import LAWS

    if mechanism in LAWS:
        return joint_type in LAWS[mechanism].examples
    mechanism_class = MECHANISMS[mechanism]
    return joint_type in mechanism_class.joint_types and bool(mechanism_class.example(joint_type))
