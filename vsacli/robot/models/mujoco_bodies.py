"""Bodies as MuJoCo takes them: with mass, and with an inertia that it believes."""

from __future__ import annotations

from collections.abc import Iterator

from vsacli.base.errors import InputError, Problem
from vsacli.robot.joint import INERTIA_ROUNDING, Joint, Link
from vsacli.robot.model import Robot

LEAST = 1e-14
"""Mass, kg, and moment of inertia, kg m^2, that MuJoCo takes: ten times what it holds for nothing."""

ROUNDING = 1e-14
"""Share of the largest moment that is added to all of them where the largest is the sum of both others, as of
flat bodies: MuJoCo turns the tensor to its principal axes, where rounding may find it larger. By trial on two
thousand flat bodies whose moments span six decades, 3e-15 does."""


def check_bodies(robot: Robot) -> None:
    """Refuse links that MuJoCo would.

    Raises:
        InputError: for each link, what is wrong with it.
    """
    reasons = [reason for joint in robot.joints for reason in _reasons(joint)]
    if reasons:
        raise InputError(Problem(file_of(robot), 0, reason) for reason in reasons)


def file_of(robot: Robot) -> str:
    """The file that a robot was read from, empty if there is none."""
    return next((source.path for source in robot.sources), "")


def _reasons(joint: Joint) -> Iterator[str]:
    link = joint.link
    low, middle, high = link.inertia.principal_moments
    whose = f"link of joint {joint.name}"
    if link.mass < LEAST:
        yield f"{whose}: MuJoCo takes no body without mass; give it one, however small"
    elif low < LEAST:
        least = f"its smallest moment of inertia is {low:.3g} kg m^2, and MuJoCo takes none below {LEAST:g}"
        yield f"{whose}: {least}; give it one that makes no difference"
    elif high - low - middle > INERTIA_ROUNDING * high:
        sides = f"{high:.4g} > {low:.4g} + {middle:.4g} kg m^2"
        yield f"{whose}: its inertia breaks the triangle inequality ({sides}), which MuJoCo refuses"


def full_inertia(link: Link) -> tuple[float, ...]:
    """Entries xx, yy, zz, xy, xz, yz about the centre of mass."""
    inertia = link.inertia
    low, middle, high = inertia.principal_moments
    excess, rounding = float(high - low - middle), ROUNDING * float(high)
    added = max(excess, 0.0) + rounding if excess > -rounding else 0.0
    moments = (inertia.xx + added, inertia.yy + added, inertia.zz + added)
    return (*moments, inertia.xy, inertia.xz, inertia.yz)
