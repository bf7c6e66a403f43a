"""Serial actuators in robot files: what is refused, where, and why."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from vsacli import InputError, load_robot

HEAD = """
format: vsacli-robot/1
name: arm
joints:
  - name: elbow
    type: revolute
    dh: {a: 0.3, alpha: 0}
    link: {mass: 2, inertia: {xx: 0.002, yy: 0.015, zz: 0.015}, com: [-0.15, 0, 0]}
    actuator:
      type: serial
      motor: [{inertia: 0.3}, {inertia: 0.02}]
"""
AWAS = "mechanism: {type: awas, k: 60000, arm: [0.02, 0.1], lead: 0.01}"
LEVER = "mechanism: {type: lever, k: 500, length: 0.1, pivot: [0.02, 0.1], lead: 1}"
RATIO = "mechanism: {type: variable_ratio, setting: [0, 2], torque: {type: sine, k: 300}, scale: "
OF_CUBIC = RATIO.replace("sine, k: 300", "cubic, k: 300, k_c: 9, max_deflection: 1")
LIMITED = OF_CUBIC + "{type: power, exponent: 1, offset: 1}}"


def load(*lines: str) -> object:
    Path("arm.yaml").write_text(HEAD.lstrip() + "".join(f"      {line}\n" for line in lines))
    return load_robot("arm.yaml").joints[0].actuator


@pytest.mark.usefixtures("own_folder")
@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ((AWAS.replace("0.02, 0.1", "0, 0.1"),), "mechanism: arm: must have two ends above zero"),
        ((AWAS.replace("[0.02, 0.1]", "0.1"),), "mechanism: arm: must have two ends above zero"),
        ((AWAS.replace("[0.02, 0.1]", "[0.02, .inf]"),), "arm: "),
        ((AWAS.replace("lead: 0.01", "lead: 0"),), "lead: must be finite and not zero, not 0"),
        ((AWAS.replace("k: 60000", "k: 0"),), "k: must be positive, not 0"),
        ((LEVER,), "mechanism: pivot: must have two ends between zero and the length 0.1 m"),
        ((f"{RATIO}{{type: power, exponent: 2}}}}",), "scale: is not positive at theta_2 = 0"),
        ((f"{RATIO}{{type: power, exponent: -1, lead: -1, offset: 1}}}}",), "not positive at theta_2 = 1"),
        ((f"{RATIO}{{type: polynomial, c0: 1, c1: 2, c2: -1}}}}",), "it has no slope near theta_2 = 1"),
        ((f"{RATIO}{{type: polynomial, c0: 1}}}}",), "scale: must rise or fall over all of `setting`"),
        ((LIMITED,), "torque.max_deflection: is not a limit of a serial actuator"),
        ((AWAS.replace("awas", "awass"),), "mechanism.type: unknown word 'awass'; did you mean 'awas'?"),
        ((AWAS, "coupled_inertia: -0.2"), "is -0.2 on the joint side of the gears; its size must be below"),
        ((AWAS, "branch: negative"), "unknown key 'branch'"),
        (("coupled_inertia: 0",), "actuator: missing key 'mechanism'"),
    ],
)  # fmt: skip
def test_what_is_refused(lines: tuple[str, ...], reason: str) -> None:
    with pytest.raises(InputError, match=rf"arm\.yaml:\d+: .*{re.escape(reason)}"):
        load(*lines)


@pytest.mark.usefixtures("own_folder")
def test_two_motors_and_their_coupling_are_read() -> None:
    actuator = load(AWAS, "coupled_inertia: 0.004")
    assert [motor.inertia for motor in actuator.motors] == [0.3, 0.02]
    assert actuator.coupled_rotors == 0.004


@pytest.mark.usefixtures("own_folder")
@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ("0,3\n1,2.5\n2,1.5\n", "the table needs 4 rows or more"),
        ("0,3\n0.5,2.8\n1,2.5\n1.5,1.5\n", "the table goes from 0 to 1.5, `setting` farther"),
        ("0,3\n0.5,2.8\n1,2.9\n2,1.5\n", "scale: must rise or fall over all of `setting`"),
    ],
)
def test_a_table_of_scales_that_is_none_is_refused(rows: str, reason: str) -> None:
    Path("scale.csv").write_text(f"setting,scale\n{rows}")
    with pytest.raises(InputError, match=rf"arm\.yaml:\d+: .*{re.escape(reason)}"):
        load(f"{RATIO}{{type: table, file: scale.csv}}}}")


@pytest.mark.usefixtures("own_folder")
def test_a_table_of_scales_is_among_the_sources() -> None:
    Path("scale.csv").write_text("setting,scale\n0,3\n0.5,2.8\n1,2.5\n2,1.5\n")
    actuator = load(f"{RATIO}{{type: table, file: scale.csv}}}}")
    assert [Path(source.path).name for source in actuator.sources] == ["scale.csv"]


@pytest.mark.usefixtures("own_folder")
def test_a_motor_that_sets_the_springs_is_held_against_no_link() -> None:
    """Its size follows from its screw; that of the motor which carries the load does not."""
    small = "{inertia: 2e-6, max_velocity: 900, max_torque: 0.05}"
    standing = HEAD.replace("joints:", "gravity: [0, -9.81, 0]\njoints:")
    text = standing.replace("{inertia: 0.02}", small) + f"      {AWAS}\n"
    Path("arm.yaml").write_text(text.lstrip())
    assert load_robot("arm.yaml").warnings == ()
    Path("arm.yaml").write_text(text.lstrip().replace("{inertia: 0.3}", small))
    assert len(load_robot("arm.yaml").warnings) == 2  # of inertia and torque
