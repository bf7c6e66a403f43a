"""Every word that may stand in a URDF: used, without effect, named in the report, or refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
from samples.command_line import REPOSITORY
from samples.urdf import INERTIAL, joint, link, robot, write

from vsacli import InputError, Placeholders, Robot, import_urdf
from vsacli.robot.urdf.vocabulary import ROBOT, ElementRule

CHILDREN = (
    '<dynamics damping="1"/><limit lower="-1" upper="2" velocity="3" effort="4"/>'
    '<safety_controller k_velocity="1"/>'
)
GEAR = '<joint name="{joint}"/><actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>'
SIMPLE = "SimpleTransmission"
TYPE_OF_TRANSMISSION = ("@type", "type", "plugin")
WHOLE = robot(
    link("base"),
    link("arm"),
    link("hand"),
    link("left"),
    link("right"),
    joint("turn", "base", "arm", rest=CHILDREN),
    joint("bend", "arm", "hand", rpy="1 0 0", rest=CHILDREN),
    joint("open", "hand", "left", "P"),
    joint("follow", "hand", "right", "P", rest='<mimic joint="open" multiplier="2" offset="0.1"/>'),
    f'<transmission name="a"><type>{SIMPLE}</type>{GEAR.format(joint="turn")}</transmission>',
    f'<ros2_control name="b" type="system"><transmission name="c"><plugin>{SIMPLE}</plugin>'
    f"{GEAR.format(joint='bend')}</transmission></ros2_control>",
    '<gazebo reference="turn"><dampingFactor>1</dampingFactor></gazebo>',
)
"""A robot with every element that the reader uses."""


def ruled(
    element: ElementTree.Element, rule: ElementRule
) -> Iterator[tuple[ElementTree.Element, ElementRule]]:
    yield element, rule
    for child in element:
        if child.tag in rule.children:
            yield from ruled(child, rule.children[child.tag])


def places() -> dict[str, int]:
    """The number of the first place in WHOLE at which each rule applies, by tag and number."""
    firsts: dict[int, tuple[str, int]] = {}
    for number, (element, rule) in enumerate(ruled(ElementTree.fromstring(WHOLE), ROBOT)):
        firsts.setdefault(id(rule), (f"{element.tag}-{number}", number))
    return dict(firsts.values())


def put(element: ElementTree.Element, word: str, value: str) -> None:
    """Write an attribute, or replace the first child with this tag, or add one.

    The type of a transmission can be given in three ways, of which one is left.
    """
    if element.tag == "transmission" and word in TYPE_OF_TRANSMISSION:
        element.attrib.pop("type", None)
        for child in [child for child in element if child.tag in TYPE_OF_TRANSMISSION]:
            element.remove(child)
    if word.startswith("@"):
        element.set(word[1:], value)
    elif (child := element.find(word)) is not None:
        child.text = value
    else:
        ElementTree.SubElement(element, word).text = value


@dataclasses.dataclass
class Report:
    """The robot of a file and the lines of the report on it; or the error."""

    robot: Robot | None = None
    lines: list[str] = dataclasses.field(default_factory=list)
    error: str = ""


def report(text: str, folder: Path) -> Report:
    try:
        path = write(folder / "arm.urdf", text)
        conversion = import_urdf(path, tip="hand", placeholders=Placeholders("rigid"))
        return Report(conversion.robot, str(conversion).splitlines())
    except InputError as error:
        return Report(error=str(error).replace(f"{folder}/", ""))


@pytest.fixture
def changed(tmp_path):
    """The report on WHOLE, with words written into the element of this number."""

    def of(number: int = 0, words: Iterable[str] = (), value: str = "7") -> Report:
        root = ElementTree.fromstring(WHOLE)
        for word in words:
            put(list(ruled(root, ROBOT))[number][0], word, value)
        return report(ElementTree.tostring(root, encoding="unicode"), tmp_path)

    return of


@pytest.mark.parametrize("number", places().values(), ids=places())
def test_words_act_as_their_list_says(changed, number):
    """What a word does when a value is written into it, or for words that are used, nonsense."""
    _, rule = list(ruled(ElementTree.fromstring(WHOLE), ROBOT))[number]
    plain = changed()
    assert plain.error == ""
    assert (
        changed(number, [f"{word}any" if word[-1] == ":" else word for word in rule.without_effect]) == plain
    )
    named = changed(number, rule.left_out)
    assert named.robot == plain.robot
    further = "\n".join(line for line in named.lines if line not in plain.lines)
    for word, entry in rule.left_out.items():
        assert (entry.phrase or word.strip("@")) in further
    for word in rule.refused:
        assert word.strip("@") in changed(number, [word]).error
    for word in (*rule.used, *(tag for tag, child in rule.children.items() if child.has_text)):
        assert changed(number, [word], "x") != plain


@pytest.mark.parametrize("number", places().values(), ids=places())
def test_unknown_words_are_reported(changed, number):
    tag = list(ruled(ElementTree.fromstring(WHOLE), ROBOT))[number][0].tag
    attribute, element = changed(number, ["@qqqq"]), changed(number, ["qqqq"])
    assert f"unknown attribute 'qqqq' of <{tag}> is ignored" in "\n".join(attribute.lines)
    if tag == "robot":
        assert "unknown element <qqqq> of <robot> may stand for links, joints or masses" in element.error
    else:
        assert f"unknown element <qqqq> of <{tag}> is ignored" in "\n".join(element.lines)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("<origin xyz", "<orgin xyz"), "2: unknown element <orgin> of <inertial>; did you mean <origin>?"),
        (("<limit lower", "<limit uper"), "7: unknown attribute 'uper' of <limit>; did you mean 'upper'?"),
        (("rpy=", "RPY="), "7: unknown attribute 'RPY' of <origin>; did you mean 'rpy'?"),
        (("rpy=", "quat="), "7: attribute 'quat' of <origin> is not read; write the quaternion as quat_xyzw"),
        (("</joint>", '<link name="x"/></joint>'), "7: element <link> of <joint> is not read; it must stand"),
    ],
)
def test_words_that_cannot_be_ignored_are_refused(tmp_path, change, problem):
    assert f"arm.urdf:{problem}" in report(WHOLE.replace(*change), tmp_path).error


def test_text_is_not_ignored_in_silence(tmp_path):
    text = WHOLE.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1">1 0 0</axis>', 1)
    assert any("arm.urdf:7: text of <axis> is ignored" in line for line in report(text, tmp_path).lines)


def test_a_repeated_warning_is_one_line(tmp_path):
    lines = report(WHOLE.replace('velocity="3"', 'velocity="3" current="1"'), tmp_path).lines
    (line,) = [line for line in lines if "current" in line]
    assert line.endswith("arm.urdf:7: unknown attribute 'current' of <limit> is ignored (and 1 more below)")


MACRO = '<default_inertial mass="2"/>'


def test_a_macro_in_place_of_inertial_data_is_refused(tmp_path):
    """Without it the link would have no mass."""
    text = WHOLE.replace(link("arm"), link("arm", MACRO))
    problem = "unknown element <default_inertial> of <link> may stand for links, joints or masses"
    assert f"arm.urdf:3: {problem}" in report(text, tmp_path).error
    beside = WHOLE.replace(link("arm"), link("arm", MACRO + INERTIAL))
    assert any("<default_inertial> of <link> is ignored" in line for line in report(beside, tmp_path).lines)


@pytest.mark.parametrize(("number", "tag", "place"), [(7, "joint", "<origin"), (3, "link", "<inertial")])
def test_links_within_unknown_elements_are_not_ignored(tmp_path, number, tag, place):
    lines = WHOLE.splitlines()
    lines[number - 1] = lines[number - 1].replace(place, f'<group><link name="n"/></group>{place}')
    problem = f"arm.urdf:{number}: unknown element <group> of <{tag}> may stand for links, joints or masses"
    assert problem in report("\n".join(lines), tmp_path).error


def test_a_macro_left_over_is_named_before_what_is_missing(vsacli, tmp_path):
    write(tmp_path / "arm.urdf", WHOLE.replace(link("hand"), '<arm_link name="hand" length="0.2"/>'))
    done = vsacli("import-urdf", "arm.urdf", "--tip", "hand")
    assert done.code == 2
    first = done.err.splitlines()[0]
    assert first.startswith(
        "arm.urdf:4: unknown element <arm_link> of <robot> may stand for links, joints or masses"
    )
    assert first.endswith("expand it first: xacro arm.urdf > arm_expanded.urdf, or remove it")


def test_validation_warns_as_import_does(vsacli, tmp_path):
    write(tmp_path / "arm.urdf", WHOLE.replace('velocity="3"', 'velocity="3" current="1"'))
    done = vsacli("validate", "arm.urdf")
    assert done.code == 0
    assert "arm.urdf:7: warning: unknown attribute 'current' of <limit> is ignored" in done.out


def test_an_exported_urdf_has_only_known_words(vsacli):
    done = vsacli("export", REPOSITORY / "robots" / "ur5_6r.yaml", "--format", "urdf", "-o", "arm.urdf")
    assert done.code == 0
    assert vsacli("validate", "arm.urdf").out == "arm.urdf: ok, URDF of ur5-6r, 7 joints\n"
