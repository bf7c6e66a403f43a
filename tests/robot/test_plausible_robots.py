"""What is small, large, fast or weightless may be meant: no rule on plausible numbers finds anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, edited
from samples.robots import random_joint
from samples.shipped import shipped_robot

from vsacli import (
    Antagonistic,
    DenavitHartenberg,
    Elastic,
    Inertia,
    Joint,
    Limits,
    Link,
    Motor,
    Rigid,
    Robot,
    laws,
    load_robot,
    load_trajectory,
)
from vsacli.files.robot_template import robot_template


def rod(mass: float, length: float, radius: float) -> Link:
    """A rod along the x axis of its frame, which is at its far end."""
    along, across = mass * radius**2 / 2, mass * (3 * radius**2 + length**2) / 12
    return Link(mass=mass, com=(-length / 2, 0, 0), inertia=Inertia(xx=along, yy=across, zz=across))


def arm(count: int, mass: float, length: float, radius: float, actuator, gravity=(0, -9.81, 0)) -> Robot:
    """Rods one after the other, all alike."""
    joints = tuple(
        Joint(
            name=f"joint_{number}",
            type="revolute",
            dh=DenavitHartenberg(a=length, alpha=0),
            link=rod(mass, length, radius),
            actuator=actuator,
        )
        for number in range(count)
    )
    return Robot(name="arm", gravity=gravity, joints=joints)


def pair(motor: Motor, spring) -> Antagonistic:
    return Antagonistic(motor=(motor, motor), spring=(spring, spring))


MEANT = {
    "a finger of three phalanges of 10 g": arm(
        3, 0.01, 0.03, 0.006, pair(Motor(inertia=2e-6, max_torque=0.2), laws.Exponential(c=0.02, a=8))
    ),
    "a finger of 1 g": arm(
        2, 1e-3, 0.01, 0.002, Rigid(motor=Motor(inertia=3e-9, gear_ratio=256, side="shaft", max_torque=1e-4))
    ),
    "an excavator": arm(
        3,
        500,
        3.0,
        0.2,
        pair(Motor(inertia=60, damping=2e3, max_torque=2e5), laws.Cubic(k=2e5, k_c=2e6)),
    ),
    "joints behind a spring that hardly hardens": arm(
        2, 2, 0.3, 0.03, Elastic(motor=Motor(inertia=0.2), spring=laws.Cubic(k=400, k_c=5))
    ),
    "a space manipulator": arm(
        6,
        60,
        3.5,
        0.15,
        Elastic(motor=Motor(inertia=1e-3, gear_ratio=1800, side="shaft"), stiffness=1e5),
        (0, 0, 0),
    ),
    "on the Moon": arm(2, 5, 0.4, 0.05, Rigid(motor=Motor(inertia=0.5)), (0, -1.62, 0)),
    "direct drive": arm(2, 3, 0.35, 0.04, Rigid(motor=Motor(inertia=8e-3, gear_ratio=1, max_velocity=50))),
    "stiff gears on a light arm": arm(
        1, 1.0, 0.3, 0.02, Elastic(motor=Motor(inertia=3e-5, gear_ratio=160, side="shaft"), stiffness=1e4)
    ),
    "springs without stiffness at rest": arm(
        2, 1.0, 0.2, 0.02, pair(Motor(inertia=0.05), laws.Quadratic(k=80))
    ),
    "a leg in a wheel": arm(1, 0.2, 0.1, 0.05, Rigid(motor=Motor(inertia=1e-3, max_velocity=40))),
    "a snake of 30 modules": arm(
        30, 0.3, 0.08, 0.03, Rigid(motor=Motor(inertia=2e-6, gear_ratio=300, side="shaft"))
    ),
}


@pytest.mark.parametrize("robot", MEANT.values(), ids=MEANT)
def test_extremes_that_are_built(robot):
    assert robot.warnings == ()


def test_ranges_that_are_meant():
    robot = MEANT["an excavator"]
    for limits in (
        Limits(position=(-20 * np.pi, 20 * np.pi)),
        Limits(position=(-1e9, 1e9), velocity=(-1e3, 1e3)),
        Limits(position=(-12.5, 12.5), velocity=(-50, 50)),
    ):
        joints = tuple(Joint(**{**vars(joint), "limits": limits}) for joint in robot.joints)
        assert Robot(name="arm", joints=joints, gravity=robot.gravity).warnings == ()


@pytest.mark.parametrize("actuator", ["antagonistic", "elastic", "rigid"])
@pytest.mark.parametrize("joints", ["R", "P", "RRPR"])
def test_templates_whose_placeholders_are_taken_for_real(joints, actuator, tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(robot_template(joints, actuator).replace("placeholder: true", "placeholder: false"))
    assert load_robot(path).warnings == ()


@pytest.mark.parametrize("seed", range(4))
def test_random_robots_of_other_tests(seed):
    rng = np.random.default_rng(seed)
    joints = tuple(random_joint(rng, f"joint_{number}", letter) for number, letter in enumerate("RPRRP"))
    warnings = Robot(name="random", joints=joints).warnings
    assert [each for each in warnings if ".com puts" not in each] == []  # centers of mass are anywhere


@pytest.mark.slow
@pytest.mark.parametrize(("column", "factor", "rule"), [(0, 57.3, "half a turn"), (1, 1000, "N mm/rad")])
def test_a_table_of_a_spring_in_other_units(column, factor, rule, tmp_path):
    text = (REPOSITORY / "robots" / "measured_spring.csv").read_text()
    rows = [line.split(",") for line in text.splitlines() if line and line[0] in "-0123456789"]
    table = [
        [repr(float(cell) * (factor if each == column else 1)) for each, cell in enumerate(row)]
        for row in rows
    ]
    (tmp_path / "measured_spring.csv").write_text("\n".join(["deflection,torque", *map(",".join, table)]))
    path = edited(REPOSITORY / "robots" / "measured_1r.yaml", tmp_path / "arm.yaml")
    assert any(rule in warning for warning in load_robot(path).warnings)


def test_hostile_numbers_are_judged_without_an_error(tmp_path):
    text = Path(REPOSITORY / "robots" / "vsa_3r.yaml").read_text()
    path = tmp_path / "arm.yaml"
    for right, wrong in (
        ("mass: 6.7858", "mass: 1e-300"),
        ("mass: 6.7858", "mass: 1e30"),
        ("a: 0.30", "a: 1e30"),
        ("alpha: pi/2", "alpha: -1e30"),
        ("inertia: 3.20", "inertia: 1e-30"),
        ("[0, 0, -9.81]", "[1e30, 0, 1e30]"),
    ):
        path.write_text(text.replace(right, wrong))
        assert load_robot(path).warnings, wrong


def test_the_attainable_stiffness_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the rules of the robot, and by those of all its trajectories."""
    solved = []
    genuine = Antagonistic.solve
    monkeypatch.setattr(Antagonistic, "solve", lambda *args: solved.append(args) or genuine(*args))
    robot = shipped_robot("vsa_3r")
    assert robot.warnings == ()
    for _ in range(2):
        assert load_trajectory(REST_TO_REST, robot).warnings == ()
    assert len(solved) == 3


FINGER = """format: vsacli-robot/1
name: finger
{head}
joints:
  - name: knuckle
    type: revolute
    dh: {{a: {first}, alpha: 0}}
    link: {{mass: 0.05, com: [{knuckle}, 0, 0], inertia: {{xx: 2e-6, yy: 2.1e-5, zz: 2.1e-5}}}}
    actuator: {{type: rigid, motor: {{inertia: 1e-4}}}}
  - name: tip
    type: revolute
    dh: {{a: {second}, alpha: 0}}
    link: {{mass: 0.05, com: [{tip}, 0, 0], inertia: {{xx: 2e-6, yy: 2.1e-5, zz: 2.1e-5}}}}
    actuator: {{type: rigid, motor: {{inertia: 1e-4}}}}
"""
CENTER = ("com: [-0.022, 0, 0]", "com: [0.022, 0, 0]")
STANDING = "gravity: [0, -9.81, 0]"


def finger_warnings(
    tmp_path: Path, knuckle: float, tip: float, head: str = STANDING, rows: tuple[float, float] = (0.07, 0.07)
) -> list[str]:
    """Warnings about a finger whose phalanges are 70 mm long."""
    path = tmp_path / "finger.yaml"
    path.write_text(FINGER.format(knuckle=knuckle, tip=tip, head=head, first=rows[0], second=rows[1]))
    return [warning.removeprefix(f"{path}:") for warning in load_robot(path).warnings]


def test_a_center_of_mass_half_a_link_beyond_the_tip(tmp_path: Path) -> None:
    assert finger_warnings(tmp_path, -0.035, -0.035) == []
    assert finger_warnings(tmp_path, -0.035, +0.035) == [
        "13: joints.tip.link.com puts the center of mass 0.5 link lengths beyond its far end; did "
        "you mean the opposite sign? It is given in the link frame"
    ]


def test_a_center_of_mass_before_the_joint_of_a_modified_row(tmp_path: Path) -> None:
    """The frame of a link is at its own joint: the first phalanx ends at the row of the second."""
    head, rows = f"convention: modified\n{STANDING}", (0, 0.07)
    assert finger_warnings(tmp_path, 0.035, 0.035, head, rows) == []
    (warning,) = finger_warnings(tmp_path, -0.035, 0.035, head, rows)
    assert "joints.knuckle.link.com puts the center of mass 0.5 link lengths beyond its joint" in warning


def test_a_tool_or_a_mount_beyond_the_frame_of_the_link(tmp_path: Path) -> None:
    """The link is as long as what it carries."""
    for beyond in ("tool: {xyz: [0.08, 0, 0]}", "tools: {pad: {joint: tip, xyz: [0.08, 0, 0]}}"):
        assert finger_warnings(tmp_path, -0.035, +0.035, f"{STANDING}\n{beyond}") == []
    beyond = "joints.index_knuckle.link.com puts the center of mass 0.489 link lengths beyond its far end"
    assert any(beyond in warning for warning in hand_with(tmp_path, CENTER).warnings)
    mount = ("  - name: index_middle\n", "  - name: index_middle\n    mount: {xyz: [0.022, 0, 0]}\n")
    assert not any(
        "index_knuckle.link.com" in warning for warning in hand_with(tmp_path, mount, CENTER).warnings
    )


@pytest.mark.parametrize("head", ["", "gravity: [0, 0, -9.81]", "base: {rpy: [pi, 0, 0]}"])
def test_gravity_that_is_forgotten_or_along_all_axes(head: str, tmp_path: Path) -> None:
    (warning,) = finger_warnings(tmp_path, -0.035, -0.035, head)
    assert "gravity = 9.81 m/s^2 is along the axes of all joints, so that it loads none of them" in warning
    for meant in ("gravity: [0, 0, 0]", "base: {rpy: [pi/2, 0, 0]}", "gravity: [0, -0.1, -9.81]"):
        assert finger_warnings(tmp_path, -0.035, -0.035, meant) == []
    (remark,) = finger_warnings(tmp_path, -0.035, -0.035, f"{head}\nplaceholder: true")
    assert "placeholders" in remark


def test_gravity_of_a_single_vertical_joint(tmp_path: Path) -> None:
    """It may be meant if it is written, as in `maccepa_1r`."""
    arm = REPOSITORY / "robots" / "maccepa_1r.yaml"
    assert load_robot(arm).warnings == ()
    written = (
        "gravity: [0, 0, -9.81]            # m/s^2, along the joint's axis: the link carries nothing at rest"
    )
    (warning,) = load_robot(edited(arm, tmp_path / "arm.yaml", (written, ""))).warnings
    assert "gravity = 9.81 m/s^2 is along the axes of all joints" in warning


def hand_with(tmp_path: Path, *changes: tuple[str, str]) -> Robot:
    """The bundled hand with numbers in other units."""
    return load_robot(edited(REPOSITORY / "robots" / "hand_3x2r.yaml", tmp_path / "hand.yaml", *changes))


@pytest.mark.parametrize("joint", ["index_middle", "middle_knuckle"])
def test_a_mount_in_millimeters(joint: str, tmp_path: Path) -> None:
    """On a link it is compared with the links, on the base with the reach of the finger."""
    changes = {
        "index_middle": (
            "  - name: index_middle\n",
            "  - name: index_middle\n    mount: {xyz: [12, 0, 0]}\n",
        ),
        "middle_knuckle": ("mount: {xyz: [0.092, 0, 0]", "mount: {xyz: [92, 0, 0]"),
    }
    (warning,) = hand_with(tmp_path, changes[joint]).warnings
    assert f"joints.{joint}.mount.xyz.0 (x) = " in warning
    assert "did you mean" in warning
    assert "mm, which is" in warning


def test_a_finger_in_millimeters_hides_nothing_of_the_others(tmp_path: Path) -> None:
    lengths = ("dh: &first {a: 0.045, alpha: 0", "dh: {a: 45, alpha: 0")
    others = ("dh: *first", "dh: {a: 0.045, alpha: 0, d: 0, theta: 0}")
    weak = (
        "  - name: thumb_middle",
        "  - name: thumb_middle\n    limits: {position: [-400, 400]}",
    )
    warnings = hand_with(tmp_path, lengths, others, weak).warnings
    alone = hand_with(tmp_path, others, weak).warnings
    assert len(alone) == 1
    assert "limits.position.0 (lower) = -400 rad" in alone[0]
    assert alone[0].endswith("? Also joints.thumb_middle.limits.position.1 (upper)")
    assert {*alone} < {*warnings}
    assert any("joints.index_knuckle.dh.a = 45 m" in warning for warning in warnings)
