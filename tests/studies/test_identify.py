"""Identification of motors and springs: right within standard errors that are right, or not told."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from samples.excited import TORQUE_NOISE, Excitation, Recorded, excited
from samples.marks import slow_but
from samples.shipped import shipped_robot, shipped_run

from vsacli import InputError, Robot, identify, inverse_dynamics
from vsacli.studies.identification.fitted_system import fit_system
from vsacli.studies.identification.motor_equations import GROUPS, motor_systems, with_friction

ARM = Excitation(position=[0, 0, 0], reach=[0.4] * 3, stiffness=[1400] * 3, swing=[300] * 3)

CUBIC, STIFFER, SINH = (
    {"type": "cubic", "k": 400, "k_c": 2000},
    {"type": "cubic", "k": 300, "k_c": 3000},
    {"type": "sinh", "k": 20, "a": 15},
)
DIFFERENT = {
    "joints.base.actuator.spring": [CUBIC, STIFFER],
    "joints.base.actuator.motor": [{"inertia": 3, "damping": 0.5}, {"inertia": 2, "damping": 0.3}],
    "joints.elbow.actuator.spring": [SINH, CUBIC],
}
RUBBING = {
    "joints.*.actuator.motor.friction": {"coulomb": 2, "offset": 0.5},
    "joints.*.actuator.motor.damping": 1.0,
}

SEEDS = 20


def arm(changes: object = ()) -> Robot:
    return shipped_robot("vsa_3r").replace(dict(changes))  # type: ignore[call-overload,no-any-return]


def joint(changes: object = ()) -> Robot:
    """The first joint of the arm alone, which is quicker."""
    return dataclasses.replace(arm(changes), joints=arm(changes).joints[:1])


JOINT = Excitation(position=[0], reach=[0.4], stiffness=[1400], swing=[300])

ROBOTS = {
    "3R": (arm(), ARM),
    "different sides": (arm(DIFFERENT), ARM._replace(swing=[250] * 3)),
    "friction": (arm(RUBBING), ARM),
    "R-P": (
        shipped_robot("rp_2"),
        Excitation(position=[0, 0.3], reach=[0.4, 0.1], stiffness=[1400, 12000], swing=[300, 2000]),
    ),
    "AwAS": (
        shipped_robot("awas_1r"),
        Excitation(position=[0], reach=[0.5], stiffness=[300], swing=[150]),
    ),
}
"""Robots by what is special about them, and motions within their reach."""


def found(robot: Robot, record: Recorded) -> dict[str, tuple[float, float, float]]:
    """Of each number that is told: what is found, its standard error, and what it is.

    The search begins where all springs and motors are a tenth off.
    """
    sought, signals = with_friction(robot, range(len(robot.joints))), record.signals
    told = {}
    for system in motor_systems(sought, range(len(robot.joints)), GROUPS, [signals]):
        truth = system.before
        system.before = 1.1 * truth
        fitted = fit_system(system, [signals])
        for at, number in enumerate(fitted.free):
            if np.isfinite(fitted.fit.standard_errors[at]):
                figures = fitted.fit.values[at], fitted.fit.standard_errors[at], truth[number]
                told[system.names[number]] = tuple(map(float, figures))
    return told


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", slow_but(["AwAS"], ROBOTS))
def test_springs_and_motors_come_out(name: str) -> None:
    robot, motion = ROBOTS[name]
    told = found(robot, excited(robot, motion).noisy(seed=1))
    for path, (value, error, truth) in told.items():
        assert abs(value - truth) < 5 * error, path
        if path.endswith(("inertia", "k", "k_c")) and robot is ROBOTS["3R"][0]:
            assert value == pytest.approx(truth, rel=0.01), path
            assert error < 0.01 * abs(truth)


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_standard_errors_say_how_far_off_numbers_are(name: str) -> None:
    """Of normal numbers 95 % are within two of them; 20 seeds leave that uncertain by a percent or two."""
    robot, motion = ROBOTS[name]
    truth = excited(robot, motion)
    errors = [
        (value - true) / error
        for seed in range(SEEDS)
        for value, error, true in found(robot, truth.noisy(seed)).values()
    ]
    within = np.mean(np.abs(errors) < 2)
    assert 0.9 < within < 0.995
    assert len(errors) > 5 * SEEDS


@pytest.mark.slow
def test_identify_reports_what_a_record_tells(tmp_path: Path) -> None:
    lab = arm({"joints.*.actuator.spring.k": 380, "joints.elbow.actuator.motor.inertia": 2.2})
    record = excited(lab, ARM).noisy(seed=2).write(tmp_path / "record.csv", lab)
    told = identify(arm(), record, fit=["springs", "motors"])
    assert told.verdict == "ok"
    changed = {number.path: number.value for number in told.numbers if number.changed}
    expected = {f"joints.{joint}.actuator.spring.k": 380 for joint in lab.joint_names}
    expected["joints.elbow.actuator.motor.inertia"] = 2.2
    assert changed == pytest.approx(expected, rel=0.005)
    assert told.fitted.joints[2].actuator.motors[0].inertia == changed["joints.elbow.actuator.motor.inertia"]
    assert np.isnan(told.records[0].delay) or abs(told.records[0].delay) < 4e-4
    for system in told.systems:
        for residual in system.residuals:
            # of some 100 rows, whose root mean square is uncertain by a fourteenth, and 20 held out
            assert residual.noise == pytest.approx(
                TORQUE_NOISE * np.sqrt(2 * told.records[0].bandwidth / 250), rel=0.1
            )
            assert residual.residual == pytest.approx(residual.noise, rel=0.3)
            assert residual.held_out < 2 * residual.noise
            assert residual.residual < 0.01 * residual.torque


@pytest.mark.slow
def test_at_constant_stiffness_both_numbers_of_a_spring_are_one(tmp_path: Path) -> None:
    record = excited(joint(), JOINT._replace(swing=[0])).noisy(seed=3).write(tmp_path / "record.csv", joint())
    told = identify(joint({"joints.*.actuator.spring.k": 350}), record, fit=["springs", "motors"])
    assert told.verdict == "unidentifiable"
    base = told.systems[0]
    assert [number.note for number in base.numbers if ".spring." in number.path] == ["not distinguished"] * 2
    assert [number.value for number in base.numbers if ".spring." in number.path] == [350, 2000]
    assert "spring.k + 0.0" in base.combinations[0]
    assert all(residual.residual < 1.5 * residual.noise for residual in base.residuals)


@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("rows", [5, 1, 10, -5])
def test_late_torques_are_told_and_fixed(rows: int, tmp_path: Path) -> None:
    exact = excited(joint(), JOINT)
    late = exact._replace(tau_motor=np.roll(exact.tau_motor, rows, axis=0))
    told = identify(
        joint(), late.noisy(seed=4).write(tmp_path / "record.csv", joint()), fit=["springs", "motors"]
    )
    assert told.verdict == "ok"
    assert told.records[0].delay == pytest.approx(0.004 * rows, abs=3 * told.records[0].delay_error)
    assert told.records[0].corrected
    # beyond the last torque there is nothing to compare; residuals are uncertain as above
    assert all(each.residual < 1.3 * each.noise for system in told.systems for each in system.residuals)
    assert not any(number.changed for number in told.numbers if ".spring." in number.path)


@pytest.mark.slow
def test_several_records_are_fitted_together_and_each_is_predicted_by_the_others(tmp_path: Path) -> None:
    records = [
        excited(joint(), JOINT._replace(duration=12), seed)
        .noisy(seed)
        .write(tmp_path / f"{seed}.csv", joint())
        for seed in (5, 6)
    ]
    together = identify(joint(), records, fit=["springs"])
    alone = identify(joint(), records[0], fit=["springs"])
    assert together.verdict == "ok"
    for one, both in zip(alone.numbers, together.numbers, strict=True):
        assert both.standard_error < one.standard_error
    assert all(
        0.5 < each.held_out / each.noise < 2 for system in together.systems for each in system.residuals
    )


def test_a_record_counts_once_whatever_its_files_are_called(tmp_path: Path) -> None:
    record = excited(joint(), JOINT._replace(duration=12), 5).noisy(5)
    paths = [record.write(tmp_path / name, joint()) for name in ("one.csv", "copy.csv")]
    with pytest.raises(InputError, match=r"copy.csv: equals .*one.csv; give each recording once"):
        identify(joint(), paths, fit=["springs"])
    with pytest.raises(InputError, match=r"one.csv: is given twice; give each recording once"):
        identify(joint(), [paths[0], paths[0]], fit=["springs"])
    header, *rows = paths[1].read_text().splitlines()
    rounded = [",".join(f"{float(cell):.9g}" for cell in row.split(",")) for row in rows]
    paths[1].write_text("\n".join([header, *rounded]) + "\n")
    with pytest.raises(InputError, match=r"copy.csv: equals .*one.csv"):
        identify(joint(), paths, fit=["springs"])


@pytest.mark.slow
def test_joints_of_all_kinds_are_read_and_those_with_springs_found(tmp_path: Path) -> None:
    """A motor that sets springs may turn far; a rigid joint has its motor in the equations of links."""
    mixed, trajectory = shipped_run("mixed_3r", "mixed_3r")
    run = inverse_dynamics(mixed, trajectory)
    exact = Recorded(run.time, run.q, run.theta, run.tau_motor)
    told = identify(mixed, exact.noisy(seed=7).write(tmp_path / "mixed.csv", mixed), fit=["motors"])
    sprung = [joint.name for joint in mixed.joints if joint.actuator.sprung]
    assert [system.title for system in told.systems] == [*sprung, "links"]
    rigid = [joint.name for joint in mixed.joints if not joint.actuator.sprung]
    assert {number.path.split(".")[1] for number in told.systems[-1].numbers} == set(rigid)
    assert told.verdict in ("ok", "unidentifiable")
    serial, motion = ROBOTS["AwAS"]
    record = excited(serial, motion).noisy(seed=8, torque=0.05).write(tmp_path / "awas.csv", serial)
    assert identify(serial, record, fit=["motors", "joints.*.mechanism.k"]).verdict == "ok"


@pytest.mark.slow
def test_a_wrong_zero_is_told_from_a_biased_torque(tmp_path: Path) -> None:
    exact = excited(joint(), JOINT)
    turned, biased = (
        exact._replace(theta=exact.theta.copy()),
        exact._replace(tau_motor=exact.tau_motor.copy()),
    )
    turned.theta[:, 0, 1] += 0.02
    biased.tau_motor[:, 0, 0] -= 4
    expected = {
        ("motor 2 of base: a position off by", "as by a wrong zero of its encoder"): (turned, 0.02),
        ("motor 1 of base: a torque off by", "would explain most"): (biased, -4.0),
    }
    for (start, end), (record, size) in expected.items():
        path = record.noisy(seed=9).write(tmp_path / "record.csv", joint())
        told = identify(joint(), path, fit=["springs", "motors"])
        assert told.verdict == "poor_fit"
        note, *corrected = told.notes
        assert note.startswith(start)
        assert all(each.startswith("base: with that, joints.base") for each in corrected)
        assert end in note
        off, _, error = note.removeprefix(start).split()[:3]
        # of springs that are not linear, an error is found to first order
        assert abs(float(off) - size) < 3 * float(error)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("torque", ["torques of shafts", "currents"])
def test_records_may_be_of_the_other_side_of_the_gear(torque: str, tmp_path: Path) -> None:
    ratio, constant = -50, 0.1
    motor = {
        "inertia": 3.2 / ratio**2,
        "damping": 1e-4,
        "gear_ratio": ratio,
        "side": "shaft",
        "torque_constant": constant,
    }
    geared = joint({"joints.base.actuator.motor": motor})
    record = excited(geared, JOINT).noisy(seed=10)
    columns = {"time": record.time, "base.q [deg]": np.degrees(record.q[:, 0])}
    for number in (1, 2):
        columns[f"base.theta_shaft_{number}"] = ratio * record.theta[:, 0, number - 1]
        on_shaft = record.tau_motor[:, 0, number - 1] / ratio
        if torque == "currents":
            columns[f"base.current_{number}"] = on_shaft / constant
        else:
            columns[f"base.tau_motor_shaft_{number} [mN m]"] = 1000 * on_shaft
    path, header = tmp_path / "record.csv", ",".join(columns)
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=header, comments="")
    told = identify(geared, path, fit=["springs", "motors"])
    assert told.verdict == "ok"
    assert {number.path.rpartition(".")[2] for number in told.numbers} == {"inertia", "damping", "k", "k_c"}
    for number in told.numbers:
        assert abs(number.value - number.before) < 4 * number.standard_error
