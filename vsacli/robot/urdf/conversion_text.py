"""What a conversion did, as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from vsacli.robot.urdf.conversion import Conversion
from vsacli.robot.urdf.residual import Residual

EXACT = 1e-9
"""m and rad; kinematics that stray less are called the same."""

ROUNDING = 1e-12
"""m and rad; smaller residuals differ between machines, and are not told apart."""

_HEADER = ("joint", "a/m", "alpha/rad", "d/m", "theta/rad", "mass/kg", "links")


def render(conversion: Conversion) -> str:
    """The Denavit-Hartenberg table, what was left out or changed, and how exact the result is."""
    return "\n".join(_lines(conversion))


def _lines(conversion: Conversion) -> Iterator[str]:
    robot, chain = conversion.robot, conversion.chain
    count = len(robot.joints)
    yield f"{robot.name}: {count} joint{'s' if count > 1 else ''} from {chain.base} to {chain.tip}"
    yield from _aligned(_table(conversion))
    yield f"total mass of the moving links: {sum(joint.link.mass for joint in robot.joints):.6g} kg"
    yield _exactness(conversion.residual)
    yield from conversion.notes()


def _exactness(residual: Residual) -> str:
    verdict = "the same as" if max(residual) <= EXACT else "not quite"
    position, orientation = (max(error, ROUNDING) for error in residual)
    errors = f"{position:.1e} m and {orientation:.1e} rad"
    return f"forward kinematics: {verdict} the URDF's, the tip within {errors}"


def _table(conversion: Conversion) -> Iterator[tuple[str, ...]]:
    yield _HEADER
    for joint, origin in zip(conversion.robot.joints, conversion.chain.joints, strict=True):
        row = (joint.dh.a, joint.dh.alpha, joint.dh.d, joint.dh.theta, joint.link.mass)
        others = len(origin.links) - 1
        carried = origin.links[0].name + (f" + {others}" if others else "")
        yield (joint.name, *(f"{number:.6g}" for number in row), carried)


def _aligned(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Columns of one width, numbers to the right."""
    table = list(rows)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for first, *numbers, last in table:
        cells = [f"{cell:>{width}}" for cell, width in zip(numbers, widths[1:-1], strict=True)]
        yield "  ".join([f"{first:<{widths[0]}}", *cells, last])
