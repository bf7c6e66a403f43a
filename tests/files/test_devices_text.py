"""What `vsacli info` says of springs, mechanisms and motors."""

from __future__ import annotations

from pathlib import Path

import pytest
from samples.marks import slow_but

from vsacli.files.info import describe_file, render

ROBOTS = Path(__file__).parents[2] / "robots"


def devices(name: str) -> list[str]:
    """The lines on devices of a robot that comes along, which stand last, before warnings."""
    text = render(describe_file(str(ROBOTS / f"{name}.yaml")))
    lines = text.rpartition("\n\n")[2].splitlines()
    return [line for line in lines if not line.startswith(("warning:", "dampers:"))]


def test_joints_alike_stand_together() -> None:
    assert devices("lwr_7r_vsa")[-3:] == [
        "forearm_roll to flange: antagonistic",
        "  motors 1 and 2: inertia 0.4 kg m^2, damping 0.0005 N m s/rad",
        "  springs 1 and 2: cubic, k 100 N m/rad, k_c 800 N m/rad^3",
    ]


def test_a_motor_on_its_shaft_has_rotary_units() -> None:
    assert devices("scara_4")[-5:] == [
        "slide: elastic",
        "  motor: inertia 2e-05 kg m^2, damping 0.0001 N m s/rad, max_torque 0.5 N m, "
        "max_velocity 300 rad/s, gear_ratio 314.16 rad/m, side shaft",
        "  stiffness 40000 N/m",
        "wrist: rigid",
        "  motor: inertia 3e-06 kg m^2, damping 2e-06 N m s/rad, max_torque 0.3 N m, max_velocity 600 rad/s, "
        "gear_ratio 30, side shaft",
    ]


def test_a_mechanism_has_its_ranges_and_what_is_beside_it() -> None:
    assert devices("awas_1r") == [
        "elbow: serial",
        "  motor 1: inertia 0.3 kg m^2, damping 0.3 N m s/rad, max_torque 60 N m, max_velocity 6 rad/s",
        "  motor 2: inertia 0.01 kg m^2, damping 0.02 N m s/rad, max_torque 8 N m, max_velocity 20 rad/s",
        "  mechanism: awas, k 60000 N/m, arm [0.02, 0.1] m, lead 0.01 m/rad",
        "  coupled_inertia 0.001 kg m^2",
    ]


def test_friction_stands_in_its_motor() -> None:
    assert any("friction (coulomb [0.395, 0.435] N m)" in line for line in devices("puma_560"))


NAMES = sorted(
    str(path.relative_to(ROBOTS).with_suffix(""))
    for path in (*ROBOTS.glob("*.yaml"), *ROBOTS.glob("devices/*.yaml"))
)


@pytest.mark.cases(8)
@pytest.mark.parametrize("name", slow_but(("coupled_1r", "mixed_3r"), NAMES))
def test_every_robot_that_comes_along_can_be_described(name: str) -> None:
    lines = devices(name)
    assert lines
    assert not any("{" in line or "None" in line or "null" in line for line in lines)
