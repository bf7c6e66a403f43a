"""Possible causes of residuals: a wrong sensor, or a law that is missing in the file.

Each cause is a set of columns to add to the equations. Unknown laws of friction and springs are sums of a few
functions of velocity and deflection, which suffice to detect that something is missing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.variables import VARIABLES
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import ConditionedRecording
from vsacli.studies.identification.estimation import Equations, least_squares
from vsacli.studies.identification.fitted_system import Solution
from vsacli.studies.identification.motor_equations import LINKS, motor_names
from vsacli.studies.identification.recording_faults import MOTOR, TORQUE

STEP = 1e-4
"""Initial error of a position, rad (m), in the search for it."""

FARTHEST = 0.1
"""Largest plausible error of a position, rad (m): six degrees are noticed when an arm is set up."""

SMALL = 0.1
"""Largest plausible bias of a torque relative to the largest measured torque, and half of the largest
plausible gain error. Other checks find larger ones; here a large one would mask a spring with another law."""

PASSES = 3
"""Number of estimates of the error; the second differs from the third by less than its standard error."""

SLOW = 0.1
"""Share of the largest speed at which Stribeck friction has fallen by a factor e: in bearings and gears it
falls within the slowest tenth of their speed (B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica
30 (1994))."""

DEGREE = 4
"""Degree of the polynomial of the deflection.

Most files have linear and cubic terms; terms of even degree detect other kinds of hardening and softening.
"""


class Cause(NamedTuple):
    """A possible cause of residuals that is not in the equations.

    Attributes:
        name: motor or link whose equations it changes.
        words: sentence with placeholders for name and size; a cause with several columns has no size.
        columns: columns for each recording, (rows, columns).
        unit: unit of the size.
        largest: largest plausible size.
        neutral: value added to the size in the sentence: 1 for a gain, which is a ratio.
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
GAIN = "{name}: torques that read {size} times the torque that the rest of the equations requires {would}"
FRICTION = "{name}: what is left depends on its velocity: its friction has another law"
SPRING = (
    "{name}: what is left depends on its deflection: its spring has another law, or positions were resampled"
)
DAMPING = (
    "{{name}}: what is left is proportional to its velocity, and its damping, {damping:g} in the file, is "
    "not identified: name {path} in --fit"
)
PLACE = "{name}: what is left depends on its position: a cable, a stop or a weight is not in the file"


def residual_causes(
    robot: Robot, found: Solution, records: Sequence[ConditionedRecording], equations: Sequence[Equations]
) -> list[Cause]:
    """Return possible causes of residuals of a joint's motors, or of all links.

    Args:
        robot: robot as in its file.
        found: solution of the equations.
        records: fitted recordings.
        equations: equations of the recordings at the solution.
    """
    if found.system.title == LINKS:
        return list(_of_links(robot, records, equations))
    return list(_motor_causes(robot, found, records, equations))


def _motor_causes(
    robot: Robot, found: Solution, records: Sequence[ConditionedRecording], equations: Sequence[Equations]
) -> Iterator[Cause]:
    index = robot.joint_names.index(found.system.title)
    joint = robot.joints[index]
    position, torque = (VARIABLES[each].quantity.unit(joint.type) for each in (MOTOR, TORQUE))
    names = motor_names(robot, index)
    recorded = {name: motor for motor, name in enumerate(names) if name in found.fit.residual_rms}
    behind = joint.actuator.has_columns(VARIABLES["phi"])[: len(names)]
    deflections = [_deflections(behind, each, index) for each in records]
    pulls = np.where(np.mean(np.hstack(deflections), axis=1) < 0, -1.0, 1.0)  # opposite signs in a pair
    pulled = [pulls[:, None] * each for each in deflections]
    alike: dict[int, list[Cause]] = {}
    for name, motor in recorded.items():
        own = [each.group == name for each in equations]
        zero = _by_zero(found, records, equations, index, motor)
        yield Cause(name, OFF, zero, position, FARTHEST)
        yield _bias(name, own, equations, torque)
        of_both = [
            _gain_cause(name, own, equations),
            *_frictions(
                name,
                own,
                records,
                [each.dtheta[:, index, motor] for each in records],
                DAMPING.format(
                    damping=joint.actuator.motors[motor].damping,
                    path=f"joints.{joint.name}.actuator.motor*.damping",
                ),
            ),
            _law(SPRING, name, own, records, _polynomial_terms(pulled, motor, float(pulls[motor]))),
        ]
        yield from of_both
        for kind, each in enumerate(of_both):
            alike.setdefault(kind, []).append(each)
    if len(recorded) > 1:
        for first, second in alike.values():
            columns = [one + other for one, other in zip(first.columns, second.columns, strict=True)]
            yield first._replace(name=f"both motors of {joint.name}", columns=columns)


def _deflections(behind: Sequence[bool], signals: ConditionedRecording, index: int) -> FloatArray:
    """Return the deflections of motors behind a spring and the positions of others, (motors, samples)."""
    theta, q = signals.theta[:, index, : len(behind)].T, signals.q[:, index]
    return np.where(np.array(behind)[:, None], theta - q, theta)


def _of_links(
    robot: Robot, records: Sequence[ConditionedRecording], equations: Sequence[Equations]
) -> Iterator[Cause]:
    for index, joint in enumerate(robot.joints):
        name = f"link of {joint.name}"
        own = [each.group == name for each in equations]
        if any(each.any() for each in own):
            yield _gain_cause(name, own, equations)
            words = DAMPING.format(damping=joint.damping, path=f"joints.{joint.name}.damping")
            yield from _frictions(name, own, records, [each.dq[:, index] for each in records], words)
            positions = [each.q[:, index][None] for each in records]
            yield _law(PLACE, name, own, records, _polynomial_terms(positions, 0, 1.0))


def _bias(name: str, own: Sequence[BoolArray], equations: Sequence[Equations], unit: str) -> Cause:
    largest = max(
        float(np.max(np.abs(each.measured[there]))) for each, there in zip(equations, own, strict=True)
    )
    columns = [each[:, None].astype(float) for each in own]
    return Cause(name, BIASED, columns, unit, SMALL * largest)


def _gain_cause(name: str, own: Sequence[BoolArray], equations: Sequence[Equations]) -> Cause:
    columns = [(each.predicted * there)[:, None] for each, there in zip(equations, own, strict=True)]
    return Cause(name, GAIN, columns, largest=2 * SMALL, neutral=1.0)


def _frictions(
    name: str,
    own: Sequence[BoolArray],
    records: Sequence[ConditionedRecording],
    speeds: Sequence[FloatArray],
    undamped: str,
) -> Iterator[Cause]:
    """Yield damping, then quadratic friction, then dry and Stribeck friction.

    Damping that is identified leaves nothing to explain; `undamped` words the other case.
    """
    # separate causes, since a test with fewer columns detects smaller effects
    largest = max(float(np.max(np.abs(each), initial=0.0)) for each in speeds) or 1.0
    scaled = [each / largest for each in speeds]
    yield _law(undamped, name, own, records, [v[None] for v in scaled])
    yield _law(FRICTION, name, own, records, [(v * np.abs(v))[None] for v in scaled])
    dry = [np.sign(v) for v in scaled]  # the law of the file, so that it adds nothing where that is fitted
    falling = [sign * np.exp(-np.abs(v) / SLOW) for sign, v in zip(dry, scaled, strict=True)]
    yield _law(FRICTION, name, own, records, [np.stack(each) for each in zip(dry, falling, strict=True)])


def _law(
    words: str,
    name: str,
    own: Sequence[BoolArray],
    records: Sequence[ConditionedRecording],
    terms: Sequence[FloatArray],
) -> Cause:
    """Return a cause from functions of the motion, (terms, samples) for each recording, filtered."""
    columns = []
    for there, signals, of_record in zip(own, records, terms, strict=True):
        rows = np.zeros((len(there), len(of_record)))
        if there.any():
            rows[there] = signals.filter.applied(of_record.T)
        columns.append(rows)
    return Cause(name, words, columns)


def _polynomial_terms(positions: Sequence[FloatArray], place: int, sign: float) -> list[FloatArray]:
    """Return Legendre polynomials of one position over the range of all, (terms, samples) per recording.

    Args:
        positions: positions in each recording, (positions, samples).
        place: index of the position.
        sign: sign with which the torque acts.
    """
    low, high = min(float(each.min()) for each in positions), max(float(each.max()) for each in positions)
    half = (high - low) / 2 or 1.0
    scaled = [(each[place] - low) / half - 1 for each in positions]
    return [sign * legendre.legvander(each, DEGREE)[:, 1:].T for each in scaled]


def _by_zero(
    found: Solution,
    records: Sequence[ConditionedRecording],
    equations: Sequence[Equations],
    index: int,
    motor: int,
) -> list[FloatArray]:
    """Return the change of the prediction per error of a motor's position, (rows, 1) for each recording.

    Springs are nonlinear in the error, and it makes identified parameters wrong. So the slope is a secant
    over the best-fitting error, at the parameters that belong to it.
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
    found: Solution, values: FloatArray, signals: ConditionedRecording, place: tuple[int, int], error: float
) -> FloatArray:
    theta = signals.theta.copy()
    theta[:, *place] -= error
    there, here = (
        found.system.equations(values, each).predicted for each in (signals._replace(theta=theta), signals)
    )
    return np.asarray((there - here) / error)[:, None]
