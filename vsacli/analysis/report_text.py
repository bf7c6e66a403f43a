"""The report of a run as text for a terminal: table, motor positions at both ends, energy, self-check."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.kinds import ACTUATORS
from vsacli.analysis.joint_report import DETERMINED, JointDrift, JointReport, largest_of_motors
from vsacli.analysis.self_check import SHAFT_BOUND, SelfCheck
from vsacli.base.texts import EXPONENT, counted, significant, together
from vsacli.base.units import POSITION, STIFFNESS, TORQUE, VELOCITY, time_text, units_of
from vsacli.dynamics.energy import JointEnergy


def energy_lines(joints: Sequence[tuple[str, str, JointEnergy]]) -> Iterator[str]:
    """Yield the total energies, if all joints have them, and the joints with the largest ones."""
    energies = [energy for _, _, energy in joints]
    incomplete = any(math.isnan(energy.spent) for energy in energies)
    if not incomplete:
        spent, recovered = (
            short_number(sum(works))
            for works in zip(*((e.spent, e.recovered) for e in energies), strict=True)
        )
        name, _, highest = max(joints, key=lambda joint: joint[2].elastic_peak)
        stored_text = (
            f"; springs store up to {short_number(highest.elastic_peak)} J ({name})"
            if highest.elastic_peak
            else ""
        )
        yield f"energy: motors deliver {spent} J and recover {recovered} J{stored_text}"
        yield from _loss_lines(energies)
    paired = [joint for joint in joints if not math.isnan(joint[2].co_contraction)]
    if paired:
        name, joint_type, most = max(paired, key=lambda joint: joint[2].co_contraction)
        unit, among = TORQUE.unit(joint_type), " of joints computed throughout" if incomplete else ""
        effort, load = f"{short_number(most.co_contraction)} {unit}", f"{short_number(most.load)} {unit}"
        yield f"co-contraction{among}: up to {effort} rms per motor ({name}); its load requires {load}"


def _loss_lines(energies: Sequence[JointEnergy]) -> Iterator[str]:
    """Yield the losses by friction and in windings, if the robot file has them."""
    losses_by_words = {
        "friction and damping": [energy.dissipated for energy in energies],
        "motor windings": [energy.copper_loss for energy in energies],
    }
    losses_by_cause = {
        words: [loss for loss in losses if loss is not None] for words, losses in losses_by_words.items()
    }
    sums = [f"{words} {short_number(sum(losses))} J" for words, losses in losses_by_cause.items() if losses]
    if sums:
        yield "losses: " + ", ".join(sums)


JOINTS_PER_LINE = 3
MAX_SEPARATE_JOINTS = 7
"""Largest number of joints that are described one by one."""


FAR_END = 100.0
"""Smallest upper end of an attainable range, relative to its lower end and to the commanded stiffness, that
counts as none: limits of motors and deflections bind before, such as at 519 of 8.95e10 N m/rad."""

INTEGERS_FROM = 1e3
"""Number from which on no decimals are shown."""

RESTING_SHARE = 1e-3
"""Share of its own peak velocity below which a motor counts as resting: recordings of a rest-to-rest motion,
rounded to four digits or with noise of 1e-4 rad, had 1e-4."""

ROUNDING_SHARE = 1e-9
"""Share of the largest velocity of any motor that may be rounding, for a joint held still."""


def joint_rows(joints: Sequence[JointReport]) -> list[tuple[str, ...]]:
    """Return a table of peaks, commanded and attainable stiffness, below its header with units."""
    types = [joint.type for joint in joints]
    torque, stiffness = (units_of(quantity, types) for quantity in (TORQUE, STIFFNESS))
    header = (
        "joint",
        f"peak tau_e\n{torque}",
        f"peak motor 1 / 2\n{torque}",
        f"stiffness\n{stiffness}",
        f"attainable\n{stiffness}",
        "margin\n%",
    )
    columns: tuple[Callable[[JointReport], tuple[float, ...]], ...] = (
        lambda joint: (joint.peak_tau_e, *joint.peak_tau_motor),
        _bounding_range,
    )
    has_exponents = [
        any(EXPONENT <= value < math.inf for joint in joints for value in values_of(joint))
        for values_of in columns
    ]
    return [header, *(_joint_row(joint, *has_exponents) for joint in joints)]


def _joint_row(joint: JointReport, huge: bool, huge_range: bool) -> tuple[str, ...]:
    return (
        joint.name,
        short_number(joint.peak_tau_e, huge=huge),
        " / ".join(short_number(peak, huge=huge) for peak in values_of_motors(joint, joint.peak_tau_motor)),
        _stiffness_range(joint.commanded_min, joint.commanded_max),
        *(
            (
                _attainable_range(*_bounding_range(joint), huge_range),
                short_percent(joint.margin).removesuffix(" %"),
            )
            if "stiffness" in actuator_kind(joint).commanded
            else ("-", "-")
        ),
    )


def actuator_kind(joint: JointReport) -> type[Actuator]:
    """Return the kind of the actuator."""
    kind: type[Actuator] = ACTUATORS[joint.actuator]
    return kind


def values_of_motors(joint: JointReport, pair: tuple[float, float]) -> tuple[float, ...]:
    """Return the values of a pair for the motors that the joint has."""
    return pair[: actuator_kind(joint).motor_count]


def _bounding_range(joint: JointReport) -> tuple[float, float]:
    """Return the attainable range; without an upper end so far away that it bounds no stiffness."""
    lower, upper = joint.attainable
    return lower, math.inf if upper > FAR_END * max(lower, joint.commanded_max) else upper


def _attainable_range(lower: float, upper: float, huge: bool) -> str:
    if math.isnan(lower):
        return "none"
    lower_text = short_number(lower, huge=huge)
    return f"from {lower_text}" if math.isinf(upper) else f"{lower_text}-{short_number(upper, huge=huge)}"


def _stiffness_range(low: float, high: float) -> str:
    if math.isnan(low):
        return "-"
    return "-".join(dict.fromkeys(significant(value) for value in (low, high)))


def short_number(value: float, *, huge: bool = False) -> str:
    """Return a number with three or four digits, or all those before the point.

    Args:
        value: number.
        huge: whether numbers of the same column have exponents; this one then has three digits.
    """
    if math.isnan(value):
        return "-"
    if huge or not 10 <= abs(value) < EXPONENT:
        return f"{value:.3g}"
    return f"{value:.1f}" if abs(value) < INTEGERS_FROM else f"{value:.0f}"


def short_percent(share: float) -> str:
    """Return a share in percent with two decimals; with none if it is large, with one digit if tiny."""
    if math.isnan(share):
        return "none"
    if abs(share) >= 1:
        return f"{100 * share:.0f} %"
    return f"{100 * share:.2f} %" if abs(share) >= 1e-4 or share == 0 else f"{100 * share:.1g} %"


def initial_motor_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the initial motor positions, which motors move, and the largest torque discontinuity."""
    yield from _motor_position_lines("initial", joints, [joint.start_theta for joint in joints], "first")
    deviations = [
        None if (uncertainty := joint.uncertainty) is None else uncertainty.start_dtheta for joint in joints
    ]
    yield from _motor_velocity_lines("initial", joints, [joint.start_dtheta for joint in joints], deviations)
    if discontinuity := largest_of_motors(joints, lambda joint: joint.torque_discontinuity):
        jump, joint = discontinuity
        peak = max(
            (peak for uncertainty in joints for peak in uncertainty.peak_tau_motor if peak > 0), default=0.0
        )
        if jump > ROUNDING_SHARE * peak:
            yield f"initial torque discontinuity: {jump:.3g} {TORQUE.unit(joint.type)} ({joint.name})"


def final_motor_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the final motor positions, and the motors that still move; nothing if not computed."""
    if all(math.isnan(theta) for joint in joints for theta in joint.end_theta):
        return
    yield from _motor_position_lines("final", joints, [joint.end_theta for joint in joints], "last")
    deviations = [
        None if (uncertainty := joint.uncertainty) is None else uncertainty.end_dtheta for joint in joints
    ]
    yield from _motor_velocity_lines("final", joints, [joint.end_dtheta for joint in joints], deviations)


def _motor_position_lines(
    end: str, joints: Sequence[JointReport], positions: Sequence[tuple[float, float]], end_sample: str
) -> Iterator[str]:
    """Yield the motor positions at one end of a motion; once that there are none, if no joint has any."""
    positions_by_joint = [
        values_of_motors(joint, theta) for joint, theta in zip(joints, positions, strict=True)
    ]
    is_undefined = [any(map(math.isnan, theta)) for theta in positions_by_joint]
    if all(is_undefined):
        yield f"{end} motor positions: undefined, since the {end_sample} sample is infeasible at every joint"
        return
    positions_text = {
        index: f"undefined ({end_sample} sample infeasible)"
        if is_undefined[index]
        else f"{_signed_text(positions_by_joint[index])} {POSITION.unit(joint.type)}"
        for index, joint in enumerate(joints)
    }
    yield list_by_joint(f"{end} motor positions: ", positions_text, [joint.name for joint in joints])


def _motor_velocity_lines(
    end: str,
    joints: Sequence[JointReport],
    velocities: Sequence[tuple[float, float]],
    deviations: Sequence[float | None],
) -> Iterator[str]:
    """Yield the joints whose motors do not rest at an end of the motion, with their velocities.

    The standard deviation follows if it is large; it is None if no signal was recorded.
    """
    peak_velocity = max((peak for joint in joints for peak in joint.peak_dtheta if peak > 0), default=0.0)
    moving = {
        index: f"{_signed_text(values_of_motors(joint, dtheta))} {VELOCITY.unit(joint.type)}"
        f"{_deviation_text(dtheta, deviation)}"
        for index, (joint, dtheta, deviation) in enumerate(zip(joints, velocities, deviations, strict=True))
        if any(
            abs(speed) > max(RESTING_SHARE * peak, ROUNDING_SHARE * peak_velocity)
            for speed, peak in zip(dtheta, joint.peak_dtheta, strict=True)
        )
    }
    if moving:
        yield list_by_joint(f"{end} motor velocities: ", moving, [joint.name for joint in joints])


def _deviation_text(velocities: Sequence[float], deviation: float | None) -> str:
    """Return the standard deviation of velocities if twice of it exceeds what is `DETERMINED`."""
    max_velocity = max(abs(velocity) for velocity in velocities if not math.isnan(velocity))
    if deviation is None or 2 * deviation <= DETERMINED * max_velocity:
        return ""
    return " +- unknown" if math.isnan(deviation) else f" +- {deviation:.2g}"


def _signed_text(values: Iterable[float]) -> str:
    return " ".join(f"{value:+.4g}" for value in values)


def integration_stop_lines(joints: Iterable[JointReport], drifts: Iterable[JointDrift]) -> Iterator[str]:
    """Yield from when on deflections could not be integrated."""
    infeasible = {joint.name: joint.samples["infeasible"] for joint in joints}
    for drift in drifts:
        if drift.stop is not None:
            time, reason = time_text(drift.stop.time), drift.stop.reason
            samples = f"infeasible: {counted(infeasible[drift.joint], 'sample')}"
            yield f"{drift.joint}: deflections cannot be integrated beyond t = {time}: {reason} ({samples})"


def drift_lines(drifts: Sequence[JointDrift]) -> Iterator[str]:
    """Yield the drift of integrated deflections, if there are any."""
    if drifts:
        yield wrap_joint_entries("integration drift: ", [_drift_text(drift) for drift in drifts])


def _drift_text(drift: JointDrift) -> str:
    if math.isnan(drift.largest):
        return f"{drift.joint} none (no sample integrated)"
    return f"{drift.joint} {drift.largest:.1e} {drift.unit} at {time_text(drift.time)}"


def wrap_joint_entries(label: str, entries: Sequence[str]) -> str:
    """Return the entries of the joints, several to a line."""
    lines = [
        ", ".join(entries[start : start + JOINTS_PER_LINE])
        for start in range(0, len(entries), JOINTS_PER_LINE)
    ]
    return label + (",\n" + " " * len(label)).join(lines)


def list_by_joint(label: str, texts_by_index: Mapping[int, str], names: Sequence[str]) -> str:
    """Return entries of joints by index; equal entries of many joints are combined."""
    indices_by_text: dict[str, list[int]] = {}
    for index, text in texts_by_index.items():
        indices_by_text.setdefault(text, []).append(index)
    if len(names) <= MAX_SEPARATE_JOINTS or len(indices_by_text) == len(texts_by_index):
        return wrap_joint_entries(label, [f"{names[index]} {text}" for index, text in texts_by_index.items()])
    lines = [f"{together(indices, names)} {text}" for text, indices in indices_by_text.items()]
    return label + (";\n" + " " * len(label)).join(lines)


def self_check_line(check: SelfCheck) -> str:
    """Return whether the self-check passed, and by how much."""
    if check.passed:
        return f"self-check passed ({check.ladder:.1g}, bound {check.ladder_bound:.0e})"
    return (
        f"do not use these torques: the self-check failed; relative residuals are {check.ladder:.1g} of "
        f"derivatives (bound {check.ladder_bound:.0e}), {check.shaft_residual:.1g} of motors (bound "
        f"{SHAFT_BOUND:.0e}), {check.spring_residual:.1g} of springs (bound {check.spring_bound:.0e})"
    )
