"""The report of a run as text for a terminal: headline, table, energy, and what to know before a start."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.kinds import ACTUATORS
from vsacli.analysis.derivative_check import SHAFT_BOUND, SelfCheck
from vsacli.analysis.joint_report import JointDrift, JointReport
from vsacli.base.texts import together
from vsacli.base.units import POSITION, TORQUE, VELOCITY, time_text
from vsacli.dynamics.energy import JointEnergy


def energy_lines(joints: Sequence[tuple[str, str, JointEnergy]]) -> Iterator[str]:
    """Yield sums of energy, if all joints have them, and the joints with the most."""
    energies = [energy for _, _, energy in joints]
    if not any(math.isnan(energy.spent) for energy in energies):
        spent, recovered = (
            number(sum(each)) for each in zip(*((e.spent, e.recovered) for e in energies), strict=True)
        )
        name, _, most = max(joints, key=lambda joint: joint[2].elastic_peak)
        held = f"; springs hold up to {number(most.elastic_peak)} J ({name})" if most.elastic_peak else ""
        yield f"energy: motors spend {spent} J, take back {recovered} J{held}"
        yield from _losses(energies)
    paired = [joint for joint in joints if not math.isnan(joint[2].co_contraction)]
    if paired:
        name, joint_type, most = max(paired, key=lambda joint: joint[2].co_contraction)
        unit = TORQUE.unit(joint_type)
        effort, load = f"{number(most.co_contraction)} {unit}", f"{number(most.load)} {unit}"
        yield f"co-contraction: up to {effort} rms for each motor ({name}), its load takes {load}"


def _losses(energies: Sequence[JointEnergy]) -> Iterator[str]:
    """Yield the losses by friction and in windings, if the robot file has them."""
    taken = {
        "friction and damping take {} J": [energy.dissipated for energy in energies],
        "the windings turn {} J into heat": [energy.copper_loss for energy in energies],
    }
    known = {words: [loss for loss in losses if loss is not None] for words, losses in taken.items()}
    sums = [words.format(number(sum(losses))) for words, losses in known.items() if losses]
    if sums:
        yield "losses: " + ", ".join(sums)


WIDTH = 78
JOINTS_PER_LINE = 3
MOST_APART = 7
"""Joints of a robot up to which each is spoken of on its own."""


HUGE = 1e8
"""Torque or stiffness shown with an exponent, as next to a singular step."""

RESTING_SHARE = 1e-3
"""Share of its own peak velocity below which a motor rests: records of a rest-to-rest motion, rounded to
four digits or with noise of 1e-4 rad, left 1e-4."""

ROUNDING_SHARE = 1e-9
"""Share of the largest velocity of any motor that may be nothing but rounding: that of a joint held still."""

TROUBLE = ("doubtful", "infeasible", "singular", "over_limit")
"""Kinds that make the verdict worse than ok."""


def warnings_and_notes(warnings: Iterable[str], notes: Iterable[str]) -> Iterator[str]:
    """Yield a line each, marked as what it is."""
    yield from (f"warning: {warning}" for warning in warnings)
    yield from (f"note: {note}" for note in notes)


def headline(left: str, verdict: str, joints: Sequence[JointReport]) -> str:
    """Return robot and trajectory at the left, the verdict in capitals at the right."""
    words = verdict.upper().replace("_", " ")
    if verdict in TROUBLE:
        concerned = sum(any(map(joint.shows, TROUBLE)) for joint in joints)
        words = f"{words} ({concerned} of {len(joints)} joints)"
    return f"{left:<{WIDTH - 32}} {words:>31}".rstrip()


def joint_rows(joints: Iterable[JointReport]) -> list[tuple[str, ...]]:
    """Return a table of peaks, stiffness, and what of it can be reached, below its header."""
    header = ("joint", "peak tau_e", "peak motor 1 / 2", "stiffness", "reachable", "margin")
    return [header, *map(_row, joints)]


def _row(joint: JointReport) -> tuple[str, ...]:
    torque = TORQUE.unit(joint.type)
    motors = " / ".join(number(peak) for peak in of_motors(joint, joint.peak_tau_motor))
    return (
        joint.name,
        f"{number(joint.peak_tau_e)} {torque}",
        f"{motors} {torque}",
        _span(joint.commanded_min, joint.commanded_max),
        *(
            (_corridor(*joint.reachable), percent(joint.margin))
            if "stiffness" in kind_of(joint).commanded
            else ("-", "-")
        ),
    )


def kind_of(joint: JointReport) -> type[Actuator]:
    """Return the kind of the actuator."""
    kind: type[Actuator] = ACTUATORS[joint.actuator]
    return kind


def of_motors(joint: JointReport, pair: tuple[float, float]) -> tuple[float, ...]:
    """Return the values of a pair for the motors that the joint has."""
    return pair[: kind_of(joint).motor_count]


def _corridor(lower: float, upper: float) -> str:
    if math.isnan(lower):
        return "nothing"
    return f"from {number(lower)}" if math.isinf(upper) else f"{number(lower)}-{number(upper)}"


def _span(low: float, high: float) -> str:
    if math.isnan(low):
        return "-"
    return f"{low:.6g}" if low == high else f"{low:.6g}-{high:.6g}"


def number(value: float) -> str:
    """One decimal for large numbers, three digits for small ones and for those that no machine has."""
    return "-" if math.isnan(value) else f"{value:.1f}" if 10 <= abs(value) < HUGE else f"{value:.3g}"


def percent(share: float) -> str:
    """Two decimals, or one digit of what is smaller."""
    if math.isnan(share):
        return "none"
    return f"{100 * share:.2f} %" if abs(share) >= 1e-4 or share == 0 else f"{100 * share:.1g} %"


def apart(value: float, bound: float) -> tuple[str, str]:
    """Both with as many digits as it takes to see how far they are apart, at least four."""
    for digits in range(4, 17):
        shown = _rounded(value, digits), _rounded(bound, digits)
        if math.isclose(float(shown[0]) - float(shown[1]), value - bound, rel_tol=0.1):
            return shown
    return repr(value), repr(bound)


def _rounded(value: float, digits: int) -> str:
    """Return a number with this many significant digits, or all those before the point."""
    return f"{value:.{max(digits, len(f'{abs(value):.0f}'))}g}"


def count(steps: int) -> str:
    """Steps by number."""
    return f"{steps} step" if steps == 1 else f"{steps} steps"


def start(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the initial motor positions, which motors move, and the largest torque step."""
    yield _all(
        "start motors at: ", joints, [_positions(joint, joint.start_theta, "first") for joint in joints]
    )
    yield from _moving("motors move at the start: ", joints, [joint.start_dtheta for joint in joints])
    steps = [(max(of_motors(joint, joint.torque_step)), joint) for joint in joints]
    defined = [entry for entry in steps if not math.isnan(entry[0])]
    if defined:
        step, joint = max(defined, key=lambda entry: entry[0])
        yield f"torque step at start: {step:.3g} {TORQUE.unit(joint.type)} ({joint.name})"


def end(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the final motor positions, and which motors still move; nothing if not computed."""
    if all(math.isnan(theta) for joint in joints for theta in joint.end_theta):
        return
    yield _all("end motors at: ", joints, [_positions(joint, joint.end_theta, "last") for joint in joints])
    yield from _moving("motors move at the end: ", joints, [joint.end_dtheta for joint in joints])


def _all(label: str, joints: Sequence[JointReport], said: Sequence[str]) -> str:
    return of_joints(label, dict(enumerate(said)), [joint.name for joint in joints])


def _positions(joint: JointReport, theta: tuple[float, float], step: str) -> str:
    positions = of_motors(joint, theta)
    if any(map(math.isnan, positions)):
        return f"undefined ({step} step infeasible)"
    return f"{_signed(positions)} {POSITION.unit(joint.type)}"


def _moving(
    label: str, joints: Sequence[JointReport], velocities: Sequence[tuple[float, float]]
) -> Iterator[str]:
    """Yield the joints whose motors do not rest at an end of the motion, and how fast they are."""
    fastest = max((peak for joint in joints for peak in joint.peak_dtheta if peak > 0), default=0.0)
    moving = {
        number: f"{_signed(of_motors(joint, dtheta))} {VELOCITY.unit(joint.type)}"
        for number, (joint, dtheta) in enumerate(zip(joints, velocities, strict=True))
        if any(
            abs(speed) > max(RESTING_SHARE * peak, ROUNDING_SHARE * fastest)
            for speed, peak in zip(dtheta, joint.peak_dtheta, strict=True)
        )
    }
    if moving:
        yield of_joints(label, moving, [joint.name for joint in joints])


def _signed(values: Iterable[float]) -> str:
    return " ".join(f"{value:+.4g}" for value in values)


def stops(joints: Iterable[JointReport], drifts: Iterable[JointDrift]) -> Iterator[str]:
    """Yield from when on deflections could not be integrated."""
    infeasible = {joint.name: joint.steps["infeasible"] for joint in joints}
    for drift in drifts:
        if drift.stop is not None:
            time, reason = time_text(drift.stop.time), drift.stop.reason
            steps = f"infeasible: {count(infeasible[drift.joint])}"
            yield f"{drift.joint}: its deflections cannot be followed beyond t = {time}: {reason} ({steps})"


def drift_lines(drifts: Sequence[JointDrift]) -> Iterator[str]:
    """Yield the drift of integrated deflections, if there are any."""
    if drifts:
        yield by_joint("drift of the integration: ", [_drift_of(drift) for drift in drifts])


def _drift_of(drift: JointDrift) -> str:
    if math.isnan(drift.largest):
        return f"{drift.joint} none (no step followed)"
    return f"{drift.joint} {drift.largest:.1e} {drift.unit} at {time_text(drift.time)}"


def by_joint(label: str, entries: Sequence[str]) -> str:
    """Return an entry for each joint, a few to a line."""
    lines = [
        ", ".join(entries[first : first + JOINTS_PER_LINE])
        for first in range(0, len(entries), JOINTS_PER_LINE)
    ]
    return label + (",\n" + " " * len(label)).join(lines)


def of_joints(label: str, said: Mapping[int, str], names: Sequence[str]) -> str:
    """Return entries of joints by number; equal ones of many joints are listed together."""
    alike: dict[str, list[int]] = {}
    for number, words in said.items():
        alike.setdefault(words, []).append(number)
    if len(names) <= MOST_APART or len(alike) == len(said):
        return by_joint(label, [f"{names[number]} {words}" for number, words in said.items()])
    lines = [f"{together(numbers, names)} {words}" for words, numbers in alike.items()]
    return label + (";\n" + " " * len(label)).join(lines)


def self_check_line(check: SelfCheck) -> str:
    """Return whether the self-check passed, and by how much."""
    if check.passed:
        return f"self-check passed ({check.ladder:.1g}, bound {check.ladder_bound:.0e})"
    return (
        f"SELF-CHECK FAILED: derivatives are off by {check.ladder:.1e} (bound {check.ladder_bound:.0e}), "
        f"motors by {check.shaft_residual:.1e} (bound {SHAFT_BOUND:.0e}), "
        f"springs by {check.spring_residual:.1e} (bound {check.spring_bound:.0e}); do not use these torques"
    )
