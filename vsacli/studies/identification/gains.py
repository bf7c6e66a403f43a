"""Gain of recorded torques: numbers that are all by one factor not those of the file.

Equations of motors are linear in inertias, dampings, friction and the sizes of springs: torques that read 3 %
too large make all of these 3 % too large, and leave nothing. No motion tells such a gain from a joint whose
numbers differ so from the file. What the file says of the links does: what springs carry by the numbers found
is held against the torque that links of these masses need.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.robot.model import Robot
from vsacli.robot.parameters import parameters
from vsacli.studies.identification.estimation.equations import Equations
from vsacli.studies.identification.estimation.independence import independence
from vsacli.studies.identification.estimation.least_squares import SEPARABLE, least_squares
from vsacli.studies.identification.estimation.solution import Solution
from vsacli.studies.identification.identification_report import significant
from vsacli.studies.identification.links.link_system import LINKS, link_system, without_links
from vsacli.studies.identification.motors.unknowns import MOTORS, group_of
from vsacli.studies.identification.records.signals import Signals

CERTAIN = 4.0
"""Standard errors from which on a factor is not 1, or not another one."""

WITHIN = 3.0
"""Standard errors, root mean square, by which numbers may be off from a common factor."""


class Factor(NamedTuple):
    """A ratio of what was found to what the file has, with its standard error."""

    value: float
    error: float

    def differs(self, other: float) -> bool:
        """Whether it is certainly another one."""
        return abs(self.value - other) > CERTAIN * self.error

    def __str__(self) -> str:
        return f"{significant(self.value, self.error)} +- {self.error:.2g}"


class Gain(NamedTuple):
    """What is said of the gain of a joint's torques.

    Attributes:
        sentence: on it.
        doubtful: whether it is the torques, rather than the robot, that differ from the file.
    """

    sentence: str
    doubtful: bool


def gains(
    robot: Robot, joints: Sequence[int], motors: Sequence[Solution], signals: Sequence[Signals]
) -> list[Gain]:
    """Return what is to be said of joints all of whose numbers are by one factor not those of the file.

    Args:
        robot: as its file has it.
        joints: indices of those that were recorded.
        motors: what was found, joint by joint.
        signals: records.
    """
    factors = {each.system.title: factor for each in motors if (factor := _common_factor(each, signals))}
    if not factors:
        return []
    by_links = _by_links(robot, joints, motors, signals)
    found = {each.system.title: each for each in motors}
    return [
        _said(found[name], factor, by_links.get(name), rotor=_rotor_differs(robot, found[name]))
        for name, factor in factors.items()
    ]


def _common_factor(found: Solution, signals: Sequence[Signals]) -> Factor | None:
    """That by which all numbers of a joint's motors and springs differ from the file; None if none does."""
    equations = [found.equations(each) for each in signals]
    slopes = np.concatenate([each.slopes[:, found.free] for each in equations])
    predicted = np.concatenate([each.predicted for each in equations])
    weight = np.concatenate([[1 / found.fit.residual_rms[name] for name in each.group] for each in equations])
    told = np.flatnonzero(np.isfinite(found.fit.standard_errors))
    if not told.size or found.fit.inseparable:
        return None
    split = independence(slopes * weight[:, None], SEPARABLE)
    share = split.q.T @ (predicted * weight)
    left = predicted * weight - split.q @ share
    if np.linalg.norm(left) > SEPARABLE * np.linalg.norm(share):
        return None  # equations have other numbers, which a gain does not change: so it leaves something
    by_gain = np.zeros(slopes.shape[1])
    by_gain[split.kept] = np.linalg.solve(split.r, share) / split.scale[split.kept]
    return _fitted_factor(found, by_gain[told], told)


def _fitted_factor(found: Solution, by_gain: FloatArray, told: IndexArray) -> Factor | None:
    """The factor with which numbers come nearest to the file, if they then agree with it."""
    of_file = found.system.before[list(found.free)][told]
    difference = found.fit.values[told] - of_file
    covariance = found.fit.covariance[np.ix_(told, told)]
    weighted = np.linalg.solve(covariance, np.column_stack((by_gain, difference)))
    information = float(by_gain @ weighted[:, 0])
    share, error = float(by_gain @ weighted[:, 1]) / information, information**-0.5
    rest = difference - share * by_gain
    off = float(rest @ np.linalg.solve(covariance, rest)) / max(len(told) - 1, 1)
    factor = Factor(1 / (1 - share), error / (1 - share) ** 2)
    return factor if factor.differs(1.0) and off < WITHIN**2 else None


def _by_links(
    robot: Robot, joints: Sequence[int], motors: Sequence[Solution], signals: Sequence[Signals]
) -> dict[str, Factor]:
    """What springs carry by the numbers found, over what links as in the file need, by joint."""
    if without_links(robot, joints, (LINKS,), signals):
        return {}
    system = link_system(robot, (), motors)
    count = len(system.base.kept)
    equations = [system.equations(system.before, each) for each in signals]
    found = {}
    for each in motors:
        title = each.system.title
        own = [at for at, name in enumerate(system.names) if at >= count and name.split(".")[1] == title]
        of_link = [_of_link(one, f"link of {title}", system.before[:count], own) for one in equations]
        fit = least_squares(of_link, np.zeros(1 + len(own)))
        if np.isfinite(fit.standard_errors[0]):
            found[title] = Factor(float(fit.values[0]), float(fit.standard_errors[0]))
    return found


def _of_link(equations: Equations, group: str, base: FloatArray, own: Sequence[int]) -> Equations:
    """Equations of a joint's torque in units of that of its links; resistance of the joint is free."""
    here = equations.group == group
    slopes = equations.slopes[here]
    assert equations.errors is not None, "as of links"
    return equations._replace(
        measured=equations.measured[here],
        predicted=np.zeros(int(here.sum())),
        slopes=np.column_stack((slopes[:, : len(base)] @ base, slopes[:, own])),
        group=equations.group[here],
        sample=equations.sample[here],
        errors=equations.errors[here],
        noise=None,
    )


def _rotor_differs(robot: Robot, found: Solution) -> bool:
    """Whether numbers of motors are certainly others than in the file, not those of springs alone."""
    known = {str(each): each for each in parameters(robot)}
    return any(
        abs(found.fit.values[at] - found.system.before[number]) > CERTAIN * found.fit.standard_errors[at]
        for at, number in enumerate(found.free)
        if found.system.names[number] in known and group_of(known[found.system.names[number]]) == MOTORS
    )


def _said(found: Solution, factor: Factor, by_links: Factor | None, *, rotor: bool) -> Gain:
    """Which of both it is, as far as the links, or the rotor, tell."""
    size = "large" if factor.value > 1 else "small"
    alike = f"{found.system.title}: the numbers found are {factor} times those of the file, all of them"
    carried = f"what springs carry by these numbers is {by_links} times what links as in the file need"
    if by_links and by_links.differs(1.0) and not by_links.differs(factor.value):
        return Gain(f"{alike}, and {carried}: the torques read too {size}", doubtful=True)
    if by_links and by_links.differs(factor.value) and not by_links.differs(1.0):
        return Gain(f"{alike}, but {carried}: it is springs and motors that differ", doubtful=False)
    beside = f"{carried}, which does not decide it" if by_links else "the links tell nothing of it"
    if rotor:
        reason = "a rotor and springs hardly differ alike, torques that read too {size} make them"
        return Gain(f"{alike}: {reason.format(size=size)}; {beside}", doubtful=True)
    return Gain(f"{alike}: torques that read too {size} look the same; {beside}", doubtful=False)
