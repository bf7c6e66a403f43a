"""Reading any declared document: the rules that the robot and trajectory formats rest on."""

import math
from dataclasses import dataclass
from pathlib import Path

import pytest

from vsacli import InputError
from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import (
    NON_NEGATIVE,
    Check,
    Items,
    OneOf,
    PerJoint,
    RecordOf,
    choice,
    declared_fields,
    integer,
    interval,
    number,
    text,
    value,
)
from vsacli.documents.reading import read_document
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.files.file_kinds import DOCUMENTS


@dataclass(frozen=True)
class Wheel(DeclaredRecord):
    radius: float = number(units.POSITION, "radius")

    not_yet = ("tyre",)

    def _problems(self):
        return [FieldProblem(("radius",), "is a bad omen")] if self.radius == 13 else []


@dataclass(frozen=True)
class Cart(DeclaredRecord):
    name: str = text("name", identifier=True)
    kind: str = choice(("revolute", "prismatic"), "kind", default="prismatic", not_yet=("spherical",))
    part: object = value(OneOf({"wheel": Wheel}, not_yet=("ski",)), "part", default=None)
    wheels: tuple = value(Items(RecordOf(Wheel)), "wheels", default=())
    count: int = integer("count", check=NON_NEGATIVE, default=0)
    span: tuple = interval(units.POSITION, "span", lowest=-math.inf, default=(0.0, 1.0))
    loads: tuple = value(PerJoint(units.POSITION), "loads", check=NON_NEGATIVE, default=())

    unit_variant = "kind"
    not_yet = ("brake",)


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def read_text(lines):
        Path("cart.yaml").write_text("format: cart/1\nname: c\n" + lines)
        members = {"left": "revolute", "right": "prismatic"}
        return read_document("cart.yaml", Cart, "cart/1", members)[0]

    return read_text


def problems(read, lines):
    with pytest.raises(InputError) as caught:
        read(lines)
    return str(caught.value).splitlines()


def test_defaults(read):
    assert read("") == Cart(name="c")


@pytest.mark.parametrize(
    ("lines", "field", "expected"),
    [
        ("part: {type: wheel, radius: 1}", "part", Wheel(radius=1.0)),
        ("wheels: [{radius: 1}, {radius: 2}]", "wheels", (Wheel(radius=1.0), Wheel(radius=2.0))),
        ("count: 2 * 3", "count", 6),
        ("span: 3", "span", (-math.inf, 3.0)),
        ("span: [-3, 3]", "span", (-3.0, 3.0)),
        ("loads: 3", "loads", (3.0, 3.0)),
        ("loads: [1, 2]", "loads", (1.0, 2.0)),
        ("loads: {right: 2, left: 1}", "loads", (1.0, 2.0)),
    ],
)
def test_values(read, lines, field, expected):
    assert getattr(read(lines), field) == expected


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ("brake: 1", "3: 'brake' is not supported yet"),
        ("wheels:\n  - radius: 1\n    tyre: 3", "5: 'tyre' is not supported yet"),
        ("kind: spherical", "3: kind: 'spherical' is not supported yet"),
        ("part: {type: ski, radius: on}", "3: part.type: 'ski' is not supported yet"),
        ("part: {type: [wheel]}", "3: part.type: expected one of wheel, found a list of 1 value"),
        ("part: wheel", "3: part: expected a mapping with the key 'type', found 'wheel'"),
        ("wheels:\n  - radius: 1\n  - radius: 13", "5: wheels: radius: is a bad omen"),
        ("count: -1", "3: count: must be zero or positive, not -1"),
        ("count: 1/3", "3: count: expected a whole number, found '1/3'"),
        (
            "count: many",
            "3: count: expected a number, found 'many'",
        ),
        ("loads:\n  left: 1\n  right: -1", "5: loads of joint right: must be zero or positive, not -1 m"),
        (
            "loads: [1]",
            "3: loads: expected 2 values, one for each joint (left, right), found 1; is the file for",
        ),
        ("loads:\n  left: 1", "3: loads: no value for right; each joint needs one"),
    ],
)
def test_one_problem_is_one_line(read, lines, problem):
    (line,) = problems(read, lines)
    assert line.startswith(f"cart.yaml:{problem}")


def test_units_follow_the_variant_also_in_nested_records(read):
    assert read("kind: revolute\nwheels: [{radius: 180 deg}]").wheels[0].radius == math.pi
    (line,) = problems(read, "kind: prismatic\nwheels: [{radius: 180 deg}]")
    assert line.startswith("cart.yaml:4: radius: '180 deg' is an angle; expected a number in m")


def test_units_of_per_joint_values_follow_each_joint(read):
    assert read("loads: {left: 180 deg, right: 1}").loads == (math.pi, 1.0)
    (line,) = problems(read, "loads:\n  left: 180 deg\n  right: 180 deg")
    assert line.startswith("cart.yaml:5: loads: '180 deg' is an angle; expected a number in m")


def test_a_bad_value_does_not_hide_the_others_of_its_record(read):
    lines = problems(read, "count: -1\nloads: [1, x]\nspan: [2, 1]\nwheels: [{radius: 13}, {}]\n")
    assert [line.split(":")[1] for line in lines] == ["3", "4", "5", "6", "6"]


def test_a_value_is_checked_once_in_a_file_and_in_a_constructor(tmp_path):
    checked = []
    once = Check(lambda mass: checked.append(mass) or mass > 0, "positive")

    @dataclass(frozen=True)
    class Stone(DeclaredRecord):
        mass: float = number(units.MASS, "mass", check=once)

    @dataclass(frozen=True)
    class Heap(DeclaredRecord):
        stones: tuple = value(Items(RecordOf(Stone)), "stones")

    path = tmp_path / "heap.yaml"
    path.write_text("format: heap/1\nstones: [{mass: 1}, {mass: 2}]\n")
    heap, _ = read_document(path, Heap, "heap/1")
    assert checked == [1, 2]
    assert heap == Heap(stones=(Stone(mass=1.0), Stone(mass=2.0)))
    assert checked == [1, 2, 1, 2]


def test_a_constructor_refuses_what_a_file_may_not_have(read):
    for radius in (math.nan, math.inf, 1e31, 13.0):
        with pytest.raises(InputError) as constructed:
            Wheel(radius=radius)
        assert str(constructed.value).startswith("Wheel: radius: ")
    assert problems(read, "kind: prismatic\nwheels: [{radius: 1e31}]") == [
        "cart.yaml:4: radius: must be at most 1e+30 in size, not 1e+31 m"
    ]
    with pytest.raises(InputError, match="must be at most 1e\\+30 in size, not 1e\\+31 rad"):
        Wheel(radius=1e31)


def records_in(cls, seen):
    if cls not in seen:
        seen.add(cls)
        for field, _ in declared_fields(cls).values():
            for record in field.kind.records.values():
                records_in(record, seen)
    return seen


@pytest.mark.parametrize("document", DOCUMENTS)
def test_no_record_of_a_file_has_checks_that_only_its_constructor_runs(document):
    records = records_in(DOCUMENTS[document].record, set())
    assert {cls.__post_init__ for cls in records} == {DeclaredRecord.__post_init__}
