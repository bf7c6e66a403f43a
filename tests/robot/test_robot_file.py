"""Robot files: what is read, and one line with file and line number for each problem."""

import dataclasses
import hashlib
import math
import re
from pathlib import Path

import pytest

from vsacli import (
    Antagonistic,
    DenavitHartenberg,
    Inertia,
    InputError,
    Joint,
    Limits,
    Link,
    Motor,
    Robot,
    laws,
    load_robot,
)

ROBOTS = Path(__file__).parents[2] / "robots"

TEXT = """\
format: vsacli-robot/1
name: rig
gravity: [0, 0, -9.81]
joints:
  - name: swing
    type: revolute
    dh: {a: 0.2, alpha: 90 deg}
    link:
      mass: 2
      com: [0.1, 0, 0]
      inertia: {xx: 0.1, yy: 0.2, zz: 0.2}
    damping: 1e-5
    actuator:
      type: antagonistic
      motor: {inertia: 3.2, damping: 1e-4}
      spring: {type: cubic, k: 400, k_c: 2000}
    limits: {position: [-pi, 90 deg], velocity: 3, stiffness: 2000}
  - name: slide
    type: prismatic
    dh: {a: 0, alpha: 0, d: 0.1, theta: pi/4}
    link: {mass: 1, com: [0, 0, 0.05], inertia: {xx: 0.1, yy: 0.1, zz: 0.1, yz: -0.01}}
    actuator:
      type: antagonistic
      motor: [{inertia: 10}, {inertia: 11, max_torque: 90}]
      spring: [{type: cubic, k: 4e3, k_c: 1e6}, {type: cubic, k: 5e3, k_c: 1e6, max_deflection: 0.02}]
      branch: negative
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load a robot from a text, in a folder of its own, as `rig.yaml`."""
    monkeypatch.chdir(tmp_path)

    def load_text(text):
        Path("rig.yaml").write_text(text)
        return load_robot("rig.yaml")

    return load_text


@pytest.fixture
def problems(load):
    """The problems of TEXT after one change."""

    def problems_after(old, new):
        assert TEXT.count(old) == 1
        with pytest.raises(InputError) as caught:
            load(TEXT.replace(old, new))
        return str(caught.value).splitlines()

    return problems_after


def test_every_field_is_read(load):
    swing = Joint(
        name="swing",
        type="revolute",
        dh=DenavitHartenberg(a=0.2, alpha=math.pi / 2),
        link=Link(mass=2.0, com=(0.1, 0.0, 0.0), inertia=Inertia(xx=0.1, yy=0.2, zz=0.2)),
        damping=1e-5,
        actuator=Antagonistic(
            motor=(Motor(inertia=3.2, damping=1e-4),) * 2, spring=(laws.Cubic(k=400, k_c=2000),) * 2
        ),
        limits=Limits(position=(-math.pi, math.pi / 2), velocity=(-3, 3), stiffness=(-math.inf, 2000)),
    )
    slide = Joint(
        name="slide",
        type="prismatic",
        dh=DenavitHartenberg(a=0.0, alpha=0.0, d=0.1, theta=math.pi / 4),
        link=Link(mass=1.0, com=(0.0, 0.0, 0.05), inertia=Inertia(xx=0.1, yy=0.1, zz=0.1, yz=-0.01)),
        actuator=Antagonistic(
            motor=(Motor(inertia=10.0), Motor(inertia=11.0, max_torque=90.0)),
            spring=(laws.Cubic(k=4000, k_c=1e6), laws.Cubic(k=5000, k_c=1e6, max_deflection=0.02)),
            branch="negative",
        ),
    )
    robot = load(TEXT)
    assert robot == Robot(name="rig", gravity=(0, 0, -9.81), joints=(swing, slide))
    assert (
        robot.joints[1].actuator.spring[1].max_deflection == 0.02
    )  # takes no part in the equality of springs


def test_the_source_is_kept(load):
    (source,) = load(TEXT).sources
    assert (source.path, source.text) == ("rig.yaml", TEXT)
    assert source.sha256 == hashlib.sha256(TEXT.encode()).hexdigest()


def test_gravity_points_down_unless_given(load):
    assert load(TEXT.replace("gravity: [0, 0, -9.81]\n", "")).gravity == (0, 0, -9.81)


def test_a_byte_order_mark_and_windows_line_ends_do_not_matter(load):
    assert load("\ufeff" + TEXT.replace("\n", "\r\n")) == load(TEXT)


def test_a_spring_shared_by_an_alias(load):
    text = TEXT.replace("spring: {type: cubic, k: 400", "spring: &s {type: cubic, k: 400")
    robot = load(re.sub(r"spring: \[.*\]", "spring: *s", text))
    assert robot.joints[1].actuator.spring == robot.joints[0].actuator.spring


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        # the document
        ("format: vsacli-robot/1\n", "", "1: missing key 'format'; the file must begin with `format: "),
        ("vsacli-robot/1", "vsacli-robot/2", "1: format: expected 'vsacli-robot/1', found 'vsacli-robot/2'"),
        # keys
        (
            "      mass: 2\n",
            "",
            "8: link: missing key 'mass' (mass of the link with the motors mounted on it)",
        ),
        ("      mass: 2\n", "      mas: 2\n      mass: 2\n", "9: unknown key 'mas'; did you mean 'mass'?"),
        (
            "      mass: 2\n",
            "      mass: 2\n      mass: 3\n",
            "10: duplicate key 'mass'; it is already on line 9",
        ),
        # words
        ("name: rig", "name: on", "2: name: expected a text, found 'on', a boolean in YAML"),
        ("name: rig", "name:", "2: name: expected a text, found nothing"),
        ("name: slide", "name: a b", "18: name: must be made of letters, digits, _ and -"),
        (
            "name: slide",
            "name: swing",
            "18: joints.name: 'swing' is already used in line 5; choose another one",
        ),
        ("type: revolute", "type: rotary", "6: type: unknown word 'rotary'; valid: revolute, prismatic"),
        ("branch: negative", "branch: {}", "26: branch: expected one of positive, negative"),
        (
            "      type: antagonistic\n      motor: {",
            "      motor: {",
            "13: actuator: missing key 'type', one of antagonistic",
        ),
        ("type: cubic, k: 400", "type: cubik, k: 400", "16: spring.type: unknown word 'cubik'; did you mean"),
        # numbers
        ("mass: 2", "mass: on", "9: mass: expected a number in kg, found 'on'; YAML reads this"),
        ("mass: 2", "mass: 'on'", "9: mass: expected a number in kg, found 'on'"),
        ("mass: 2", "mass:", "9: mass: expected a number in kg, found nothing"),
        ("mass: 2", "mass: .nan", "9: mass: expected a number in kg, found '.nan'; only finite"),
        ("mass: 2", "mass: .inf", "9: mass: expected a number in kg, found '.inf'; only finite"),
        ("mass: 2", "mass: 1:30", "9: mass: expected a number in kg, found '1:30'; base 60 is not read"),
        (
            "mass: 2",
            "mass: 010",
            "9: mass: expected a number in kg, found '010'; write the number without a leading zero",
        ),
        ("mass: 2", "mass: [2]", "9: mass: expected a number in kg, found a list of 1"),
        ("mass: 2", "mass: -2", "9: mass: must be zero or positive, not -2"),
        ("inertia: 3.2", "inertia: 0", "15: inertia: must be positive, not 0"),
        ("k: 400", "k: -400", "16: k: must be positive, not -400"),
        ("k: 400", "k: 1e300", "16: k: must be at most 1e+30 in size, not 1e+300"),
        ("inertia: 3.2", "inertia: 1e-40", "15: inertia: must be at least 1e-30 in size, not 1e-40"),
        ("a: 0.2", "a: 10 deg", "7: a: '10 deg' is an angle; expected a number in m"),
        # vectors, tensors, intervals
        ("[0.1, 0, 0]", "[0.1, 0]", "10: com: expected 3 numbers in m, found 2"),
        ("[0.1, 0, 0]", "0.1", "10: com: expected a list of 3 numbers in m, found '0.1'"),
        ("yy: 0.2", "yy: -0.2", "11: inertia: the tensor has the negative eigenvalue -0.2 kg m^2"),
        ("yz: -0.01", "yz: -0.2", "21: inertia: the tensor has the negative eigenvalue -0.1 kg m^2"),
        ("[-pi, 90 deg]", "[90 deg, -pi]", "17: position: the lower limit 1.5708 rad exceeds"),
        ("[-pi, 90 deg]", "[-pi, 1e31]", "17: position: must be at most 1e+30 in size, not 1e+31"),
        ("[-pi, 90 deg]", "[1, 2, 3]", "17: position: expected [lower, upper] or one number"),
        (
            "velocity: 3",
            "velocity: -3",
            "17: velocity: the lower limit 3 rad/s exceeds the upper limit -3 rad/s",
        ),
        # nesting
        (
            "link: {mass: 1,",
            "link: 3\n    links: {mass: 1,",
            "21: link: expected a mapping with the keys mass, com, inertia, found '3'",
        ),
        (
            "motor: [{inertia: 10}, ",
            "motor: [{inertia: 10}, {inertia: 10}, ",
            "24: motor: expected one value for both",
        ),
        (
            "{type: cubic, k: 400, k_c: 2000}",
            "{flexor: {type: cubic, k: 400, k_c: 2000}, extensor: {type: cubic, k: 400, k_c: 2000}}",
            "16: spring: expected one mapping for both sides or a list of two, found the keys 'flexor', 'ext",
        ),
        ("{inertia: 3.2, damping: 1e-4}", "{}", "15: motor: missing key 'inertia'"),
    ],
)
def test_a_problem_is_named_with_its_line(problems, old, new, problem):
    assert any(line.startswith(f"rig.yaml:{problem}") for line in problems(old, new))


def test_one_mistake_is_one_line(problems):
    assert len(problems("mass: 2", "mass: on")) == 1
    expected = "rig.yaml:15: motor: expected one mapping for both sides or a list of two, found the keys"
    named_sides = problems("{inertia: 3.2, damping: 1e-4}", "{left: {inertia: 3}, right: {inertia: 4}}")
    assert named_sides == [f"{expected} 'left', 'right'"]


@pytest.mark.parametrize("joints", ["", " []", " {a: 1}", " 3"])
def test_joints_are_a_list_of_one_or_more(load, joints):
    with pytest.raises(
        InputError, match=r"^rig.yaml:2: joints: expected a list with at least one entry, found"
    ):
        load("format: vsacli-robot/1\njoints:" + joints + "\nname: rig\n")


@pytest.mark.parametrize("text", ["[1, 2]", "word"])
def test_a_document_is_a_mapping(load, text):
    with pytest.raises(InputError, match=r"^rig.yaml:1: expected a YAML file that begins with `format: "):
        load(text)


@pytest.mark.parametrize(("field", "value"), [("position", "90 deg"), ("velocity", "90 deg")])
def test_degrees_follow_the_type_of_the_joint(load, field, value):
    limits = f"    limits: {{{field}: {value}}}\n"
    revolute = TEXT[: TEXT.index("    limits")] + limits
    assert getattr(load(revolute).joints[0].limits, field) == (-math.pi / 2, math.pi / 2)
    with pytest.raises(
        InputError, match=rf"^rig.yaml:27: {field}: '90 deg' is an angle; expected a number in m"
    ):
        load(TEXT + limits)


def test_an_unknown_type_makes_no_problems_of_units(load):
    with pytest.raises(InputError) as caught:
        load(TEXT.replace("type: revolute", "type: rotational"))
    assert [problem.line for problem in caught.value.problems] == [6]


def test_all_problems_come_at_once_in_the_order_of_lines(load):
    text = TEXT + "color: red\n"
    for old, new in [("-9.81]", "]"), ("mass: 2", "mass: -2"), ("k: 400", "k: hard"), ("slide", "swing")]:
        text = text.replace(old, new)
    with pytest.raises(InputError) as caught:
        load(text)
    assert [problem.line for problem in caught.value.problems] == [3, 9, 16, 18, 27]


def test_a_problem_behind_an_alias_is_reported_once_where_it_stands(load):
    text = TEXT.replace("spring: {type: cubic, k: 400", "spring: &s {type: cubic, k: 0")
    with pytest.raises(InputError) as caught:
        load(re.sub(r"spring: \[.*\]", "spring: *s", text))
    assert str(caught.value) == "rig.yaml:16: k: must be positive, not 0 N m/rad"


def test_implausible_physics_is_a_warning(load):
    robot = load(TEXT.replace("zz: 0.2", "zz: 0.5").replace("mass: 1,", "mass: 0,"))
    assert robot.warnings == (
        "rig.yaml:11: joints.swing.link.inertia: zz = 0.5 kg m^2 exceeds xx + yy = 0.3 kg m^2 by 0.2 kg m^2, "
        "which no rigid body allows; check the entries",
        "rig.yaml:21: joints.slide.link.mass is zero; give the mass of the link, in kg",
    )


def test_table_one_of_the_paper():
    robot = load_robot(ROBOTS / "vsa_3r.yaml")
    assert [joint.link.mass for joint in robot.joints] == [9.0478, 6.7858, 5.0894]
    assert [joint.dh for joint in robot.joints] == [
        DenavitHartenberg(a=0.0, alpha=math.pi / 2),
        DenavitHartenberg(a=0.3, alpha=0.0),
        DenavitHartenberg(a=0.3, alpha=0.0),
    ]
    moments = [dataclasses.astuple(joint.link.inertia)[:3] for joint in robot.joints]
    assert moments == [(0.1299, 0.0185, 0.1299), (0.0139, 0.0578, 0.0578), (0.0104, 0.0434, 0.0434)]
    assert [joint.actuator.motor[1].inertia for joint in robot.joints] == [3.20, 3.05, 1.98]
    assert {spring for joint in robot.joints for spring in joint.actuator.spring} == {
        laws.Cubic(k=400, k_c=2000)
    }


@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_shipped_robots_give_no_warnings_but_those_that_were_published(path):
    published = {
        "puma_560": (
            "joints.waist.link.mass is zero; give the mass of the link, in kg",
            "joints.waist.link.inertia: yy = 0.35 kg m^2 exceeds xx + zz = 0 kg m^2 by 0.35 kg m^2, which no "
            "rigid body allows; check the entries",
            "joints.elbow.link.inertia: yy = 0.086 kg m^2 exceeds xx + zz = 0.0785 kg m^2 by 0.0075 kg m^2, "
            "which no rigid body allows; check the entries",
        ),
        "panda_7r_manufacturer": (
            "joints.joint4.link.inertia: the largest principal moment 0.01274 kg m^2 exceeds the sum of the "
            "others 0.01164 kg m^2 by 0.001101 kg m^2, which no rigid body allows; check the entries",
        ),
    }
    robot = load_robot(path)
    warnings = [each for each in robot.located_warnings if each.message.startswith("joints.")]
    assert tuple(each.message for each in warnings) == published.get(path.stem, ())
    assert all((each.file, each.line > 0) == (str(path), True) for each in warnings)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "inertia: {xx: 0.1, yy: 0.2, zz: 0.2}",
            "inertia: {xx: 0, yy: 0, zz: 0}",
            "rig.yaml:11: joints.swing.link.inertia is zero; give the inertia of the link about its center "
            "of mass, in kg m^2",
        ),
        (
            "inertia: {xx: 0.1, yy: 0.2, zz: 0.2}",
            "inertia: {xx: 0.1, yy: 0.1, zz: 0.3, xy: 0.05}",
            "rig.yaml:11: joints.swing.link.inertia: the largest principal moment 0.3 kg m^2 exceeds",
        ),
    ],
)
def test_links_that_no_body_is_like_have_a_line(load, old, new, message):
    assert old in TEXT
    (found,) = load(TEXT.replace(old, new)).warnings
    assert found.startswith(message)


def test_a_mass_that_was_changed_to_zero_has_no_line(load):
    robot = load(TEXT).replace("joints.swing.link.mass", 0)
    assert robot.warnings == ("joints.swing.link.mass is zero; give the mass of the link, in kg",)
