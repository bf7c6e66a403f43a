"""Causes that could explain residuals: a sensor that is off, or a law missing in the file.

Each is some columns that would be added to the equations if it were true. Friction and springs of unknown
laws are sums of a few functions of velocity and deflection, enough to see that something is missing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import Signals
from vsacli.studies.identification.estimation import Equations, least_squares
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.link_equations import LINKS
from vsacli.studies.identification.motor_equations import motor_names
from vsacli.studies.identification.recordings import MOTOR, TORQUE

STEP = 1e-4
"""Error of a position, rad (m), with which the search for it begins."""

FARTHEST = 0.1
"""Largest error of a position, rad (m), that is plausible: six degrees are seen when an arm is set up."""

SMALL = 0.1
"""Largest bias of a torque that is plausible, over the largest that was measured, and half of the largest
error of a gain. Larger ones are told as columns that are something else; otherwise a large one is a stopgap
for a spring of another law."""

PASSES = 3
"""Times the error is found; the second differs from the third by less than its standard error."""

SLOW = 0.1
"""Share of the largest speed within which Stribeck's friction has fallen by a factor e: of bearings and gears
it falls within the slowest tenth of their speed (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit,
Automatica 30 (1994))."""

DEGREE = 4
"""Degree of the polynomial of the deflection.

Together with the linear and cubic terms of most files, other kinds of hardening or softening springs show in
terms of even degree.
"""


class Cause(NamedTuple):
    """Something that is not in the equations.

    Attributes:
        name: the motor, or link, whose equations it changes.
        words: sentence with places for name and size; of several columns it has no size.
        columns: of each record, (rows, columns).
        unit: of the size.
        largest: size up to which it is plausible.
        neutral: size added to the result: a gain is a ratio to 1.
    """

    name: str
    words: str
    columns: Sequence[FloatArray]
    unit: str = ""
    largest: float = np.inf
    neutral: float = 0.0

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.columns[0].shape[1])


OFF = "{name}: a position off by {size}, as by a wrong zero of its encoder, {would}"
BIASED = "{name}: a torque off by {size} {would}"
GAIN = "{name}: torques that read {size} times what the rest of the equations asks for {would}"
FRICTION = "{name}: what is left depends on its velocity: its friction has another law"
SPRING = "{name}: what is left depends on its deflection: its spring has another law"
PLACE = "{name}: what is left depends on its position: a cable, a stop or a weight is not in the file"


def causes(
    robot: Robot, found: Solution, records: Sequence[Signals], equations: Sequence[Equations]
) -> list[Cause]:
    """Return possible causes of residuals of a joint's motors, or of all links.

    Args:
        robot: the robot.
        found: solution of the equations.
        records: to which they were fitted.
        equations: of these, at the result.
    """
    if found.system.title == LINKS:
        return list(_of_links(robot, records, equations))
    return list(_of_motors(robot, found, records, equations))


def _of_motors(
    robot: Robot, found: Solution, records: Sequence[Signals], equations: Sequence[Equations]
) -> Iterator[Cause]:
    index = robot.joint_names.index(found.system.title)
    joint = robot.joints[index]
    position, torque = (VARIABLES[each].quantity.unit(joint.type) for each in (MOTOR, TORQUE))
    names = motor_names(robot, index)
    recorded = {name: motor for motor, name in enumerate(names) if name in found.fit.residual_rms}
    behind = joint.actuator.has(VARIABLES["phi"])[: len(names)]
    deflections = [_deflections(behind, each, index) for each in records]
    pulls = np.where(np.mean(np.hstack(deflections), axis=1) < 0, -1.0, 1.0)  # of a pair, against each other
    pulled = [pulls[:, None] * each for each in deflections]
    alike: dict[int, list[Cause]] = {}
    for name, motor in recorded.items():
        own = [each.group == name for each in equations]
        zero = _by_zero(found, records, equations, index, motor)
        yield Cause(name, OFF, zero, position, FARTHEST)
        yield _bias(name, own, equations, torque)
        of_both = [
            _gain(name, own, equations),
            *_frictions(name, own, records, [each.dtheta[:, index, motor] for each in records]),
            _law(SPRING, name, own, records, _polynomial_terms(pulled, motor, float(pulls[motor]))),
        ]
        yield from of_both
        for kind, each in enumerate(of_both):
            alike.setdefault(kind, []).append(each)
    if len(recorded) > 1:
        for first, second in alike.values():
            columns = [one + other for one, other in zip(first.columns, second.columns, strict=True)]
            yield first._replace(name=f"both motors of {joint.name}", columns=columns)


def _deflections(behind: Sequence[bool], signals: Signals, index: int) -> FloatArray:
    """Deflections of motors behind a spring, of others the positions, (motors, samples)."""
    theta, q = signals.theta[:, index, : len(behind)].T, signals.q[:, index]
    return np.where(np.array(behind)[:, None], theta - q, theta)


def _of_links(robot: Robot, records: Sequence[Signals], equations: Sequence[Equations]) -> Iterator[Cause]:
    for index, joint in enumerate(robot.joints):
        name = f"link of {joint.name}"
        own = [each.group == name for each in equations]
        if any(each.any() for each in own):
            yield _gain(name, own, equations)
            yield from _frictions(name, own, records, [each.dq[:, index] for each in records])
            positions = [each.q[:, index][None] for each in records]
            yield _law(PLACE, name, own, records, _polynomial_terms(positions, 0, 1.0))


def _bias(name: str, own: Sequence[BoolArray], equations: Sequence[Equations], unit: str) -> Cause:
    largest = max(
        float(np.max(np.abs(each.measured[there]))) for each, there in zip(equations, own, strict=True)
    )
    columns = [each[:, None].astype(float) for each in own]
    return Cause(name, BIASED, columns, unit, SMALL * largest)


def _gain(name: str, own: Sequence[BoolArray], equations: Sequence[Equations]) -> Cause:
    columns = [(each.predicted * there)[:, None] for each, there in zip(equations, own, strict=True)]
    return Cause(name, GAIN, columns, largest=2 * SMALL, neutral=1.0)


def _frictions(
    name: str, own: Sequence[BoolArray], records: Sequence[Signals], speeds: Sequence[FloatArray]
) -> Iterator[Cause]:
    """Quadratic friction, and dry and Stribeck's: apart, since fewer columns show less more surely."""
    largest = max(float(np.max(np.abs(each), initial=0.0)) for each in speeds) or 1.0
    scaled = [each / largest for each in speeds]
    yield _law(FRICTION, name, own, records, [(v * np.abs(v))[None] for v in scaled])
    dry = [np.sign(v) for v in scaled]  # as of the file, so that it adds nothing where that is fitted
    falling = [sign * np.exp(-np.abs(v) / SLOW) for sign, v in zip(dry, scaled, strict=True)]
    yield _law(FRICTION, name, own, records, [np.stack(each) for each in zip(dry, falling, strict=True)])


def _law(
    words: str,
    name: str,
    own: Sequence[BoolArray],
    records: Sequence[Signals],
    terms: Sequence[FloatArray],
) -> Cause:
    """Return a cause by functions of the motion, (terms, samples) a recording, filtered like all columns."""
    columns = []
    for there, signals, of_record in zip(own, records, terms, strict=True):
        rows = np.zeros((len(there), len(of_record)))
        if there.any():
            rows[there] = signals.filter.applied(of_record.T)
        columns.append(rows)
    return Cause(name, words, columns)


def _polynomial_terms(positions: Sequence[FloatArray], place: int, sign: float) -> list[FloatArray]:
    """Legendre polynomials of one of some positions over the range of all, (terms, samples) of each record.

    Args:
        positions: (positions, samples) of each record.
        place: of the one.
        sign: with which the torque acts.
    """
    low, high = min(float(each.min()) for each in positions), max(float(each.max()) for each in positions)
    half = (high - low) / 2 or 1.0
    scaled = [(each[place] - low) / half - 1 for each in positions]
    return [sign * legendre.legvander(each, DEGREE)[:, 1:].T for each in scaled]


def _by_zero(
    found: Solution, records: Sequence[Signals], equations: Sequence[Equations], index: int, motor: int
) -> list[FloatArray]:
    """Return the effect of an error of a motor's position on the prediction, over that error, (rows, 1).

    Springs are not linear in it, and the numbers found are wrong by it: so it is a secant over the error that
    fits best, with the numbers that go with it.
    """
    values, error = found.predicting, STEP
    columns: list[FloatArray] = []
    for _ in range(PASSES):
        columns = [_secant(found, values, each, (index, motor), error) for each in records]
        longer = [
            each._replace(slopes=np.hstack((each.slopes[:, found.free], column)))
            for each, column in zip(equations, columns, strict=True)
        ]
        fit = least_squares(longer, np.zeros(len(found.free) + 1))
        if not np.isfinite(fit.standard_errors[-1]) or abs(fit.values[-1]) > FARTHEST:
            break
        values = found.predicting
        values[list(found.free)] += fit.solution[:-1]
        error = float(fit.values[-1]) or STEP
    return columns


def _secant(
    found: Solution, values: FloatArray, signals: Signals, place: tuple[int, int], error: float
) -> FloatArray:
    theta = signals.theta.copy()
    theta[:, *place] -= error
    there, here = (
        found.system.equations(values, each).predicted for each in (signals._replace(theta=theta), signals)
    )
    return np.asarray((there - here) / error)[:, None]
