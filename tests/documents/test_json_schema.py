"""JSON Schemas: they accept what the reader accepts, and refuse its common mistakes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import make_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from samples.command_line import REPOSITORY
from samples.studies import DRAWN, GRID, HEAD

from vsacli import InputError, load_robot
from vsacli.base.units import ANGLE, MASS, POSITION
from vsacli.documents import fields
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import Check, OwnKind, ValueKind, declared_fields
from vsacli.documents.json_schema import json_schema
from vsacli.documents.number import evaluate
from vsacli.documents.tree import Node, Scope
from vsacli.files.file_kinds import DOCUMENTS, FileKind

ROBOTS = sorted((REPOSITORY / "robots").glob("*.yaml"))
TRAJECTORIES = sorted((REPOSITORY / "trajectories").glob("*.yaml"))
ROBOT_TEXT = (REPOSITORY / "robots" / "vsa_3r.yaml").read_text()


@cache
def validator(kind: str) -> Draft202012Validator:
    schema = DOCUMENTS[kind].schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def messages(kind: str, text: str) -> list[str]:
    return [error.message for error in validator(kind).iter_errors(yaml.safe_load(text))]


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_every_robot_that_comes_along_is_valid(path: Path) -> None:
    assert messages("robot", path.read_text()) == []


@pytest.mark.parametrize("path", TRAJECTORIES, ids=lambda path: path.stem)
def test_every_trajectory_that_comes_along_is_valid(path: Path) -> None:
    assert messages("trajectory", path.read_text()) == []


def test_studies() -> None:
    for text in (GRID, DRAWN, "vary: {a.b: {linked: c.d, factor: 2}, e: [{type: x}]}\nkeep: [margin]\n"):
        assert messages("study", HEAD + text) == []
    for text in (
        "vary: {a: 3}",
        "vary: {a: {linspce: [1, 2, 3]}}",
        "vary: {a: []}",
        "keep: [x]",
        "methd: grid",
    ):
        assert messages("study", HEAD + text) != []


def test_poles() -> None:
    text = "format: vsacli-poles/1\njoints:\n - {name: a, position: -20}\n"
    assert messages("poles", text) == []
    assert messages("poles", text.replace("name", "nam")) != []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("format: vsacli-robot/1", "format: vsacli-robot/2"),
        ("mass: 9.0478", "mas: 9.0478"),
        ("mass: 9.0478", "mass: -1"),
        ("mass: 9.0478", "mass: 1.0e+31"),
        ("com: [0, 0, 0]", "com: [0, 0, -1.0e+31]"),
        ("mass: 9.0478", "mass: heavy"),
        ("mass: 9.0478", "mass: on"),
        ("mass: 9.0478", "mass: 90 deg"),
        ("com: [0, 0, 0]", "com: [0, 0]"),
        ("type: revolute", "type: rotary"),
        ("type: antagonistic", "type: agonistic"),
        ("type: antagonistic", "tipe: antagonistic"),
        ("name: base", "name: base joint"),
        ("joints:", "joints: []\nothers:"),
        ("gravity: [0, 0, -9.81]", "gravity: -9.81"),
    ],
)
def test_schema_and_reader_refuse_the_same_mistakes(old: str, new: str, tmp_path: Path) -> None:
    assert old in ROBOT_TEXT
    broken = ROBOT_TEXT.replace(old, new, 1)
    assert messages("robot", broken) != []
    (tmp_path / "robot.yaml").write_text(broken)
    with pytest.raises(InputError):
        load_robot(tmp_path / "robot.yaml")


@pytest.mark.parametrize(
    "change",
    [
        {"position": {"type": "polynomial", "degree": 8, "start": 0, "end": 1}},
        {"position": {"type": "polynomial", "degree": 7, "start": 0}},
        {"position": {"type": "polynomial", "degree": 7, "start": "x", "end": 1}},
        {"position": {"type": "constant", "value": {"a b": 1}}},
        {"position": {"type": "spline"}},
        {"position": {"type": "constant", "value": 0, "degree": 7}},
        {"stiffness": {"type": "constant", "value": [-1, 2]}},
        {"stiffness": {"type": "constant", "value": "90 deg"}},
        {"duration": -1},
    ],
)
def test_mistakes_in_a_trajectory(change: dict[str, Any]) -> None:
    good = {
        "format": "vsacli-trajectory/1",
        "name": "t",
        "duration": "2*pi",
        "position": {
            "type": "polynomial",
            "degree": 7,
            "start": [0, "-(90/2) deg"],
            "end": {"a": 1, "b": "1e-3"},
        },
        "stiffness": {"type": "constant", "value": [None, 2]},
    }
    assert list(validator("trajectory").iter_errors(good)) == []
    assert list(validator("trajectory").iter_errors({**good, **change})) != []


@cache
def schema_of(kind: ValueKind) -> Draft202012Validator:
    """The schema of a document with a single value `x`."""
    record = make_dataclass("Record", [("x", Any, fields.value(kind, "x"))], frozen=True)
    return Draft202012Validator(json_schema(record, "f/1", "t"))


def checks(cls: type, seen: set[type]) -> Iterator[Check]:
    """Every condition on a number that a record, and the records in it, declare."""
    for field, _ in declared_fields(cls).values() if cls not in seen else ():
        if isinstance(field.kind, fields.NumberWithUnit | fields.Integer | fields.PerJoint) and field.check:
            yield field.check
        for record in field.kind.records.values():
            yield from checks(record, seen | {cls})


CHECKS = {
    check.requirement: check for document in DOCUMENTS.values() for check in checks(document.record, set())
}


@pytest.mark.parametrize("requirement", sorted(CHECKS))
def test_the_keywords_of_a_condition_say_nothing_that_it_does_not(requirement: str) -> None:
    check = CHECKS[requirement]
    schema = Draft202012Validator({**check.keywords})
    for value in (-1e300, -7, -1, -0.5, 0, 1e-300, 0.5, 1, *range(2, 20), 21, 1e300):
        if check.holds(value):
            assert schema.is_valid(value), value


def test_conditions_that_have_keywords_refuse_what_they_refuse() -> None:
    for check in CHECKS.values():
        if "enum" in check.keywords or "exclusiveMinimum" in check.keywords or "minimum" in check.keywords:
            assert not Draft202012Validator({**check.keywords}).is_valid(-1)
            assert not check.holds(-1)
    assert {"exclusiveMinimum", "minimum", "enum"} <= {
        word for check in CHECKS.values() for word in check.keywords
    }


numbers = st.floats(-1e3, 1e3).map(lambda value: f"{value:.3g}")
expressions = st.recursive(
    numbers | st.just("pi"),
    lambda inner: (
        st.tuples(inner, st.sampled_from([" + ", "-", "*", "/ "]), inner).map("".join)
        | inner.map("({})".format)
        | inner.map("-{}".format)
    ),
    max_leaves=6,
)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    expressions
    | expressions.map("({}) deg".format)
    | numbers.map("{} deg".format)
    | st.text("0123456789.eE+-*/() pideg")
)
def test_every_expression_that_is_read_is_accepted(text: str) -> None:
    for unit in (MASS, ANGLE, POSITION):
        try:
            evaluate(text, unit.revolute)
        except ExpressionError:
            continue
        assert schema_of(fields.NumberWithUnit(unit)).is_valid({"format": "f/1", "x": text})


def test_a_kind_without_a_schema_is_noticed() -> None:
    class Novel(OwnKind):
        words = "something new"

        def read(self, node: Node, _label: str, _scope: Scope) -> Any:
            return node

    with pytest.raises(TypeError, match=r"abstract method '?schema"):
        Novel()  # type: ignore[abstract]


@pytest.mark.parametrize("kind", list(DOCUMENTS))
def test_the_command_prints_it(vsacli: Any, kind: str) -> None:
    outcome = vsacli("schema", kind)
    assert outcome.code == 0
    assert json.loads(outcome.out) == DOCUMENTS[kind].schema()
    assert FileKind(kind)


def test_another_kind_is_refused_with_those_there_are(vsacli: Any) -> None:
    outcome = vsacli("schema", "robots")
    assert outcome.code == 2
    assert ", ".join(map(repr, DOCUMENTS)) in outcome.err


def test_keys_tell_unit_default_and_meaning() -> None:
    schema = DOCUMENTS["robot"].schema()
    assert schema["properties"]["gravity"]["default"] == [0.0, 0.0, -9.81]
    assert schema["properties"]["gravity"]["description"] == "gravity acceleration in the base frame, m/s^2"
    assert schema["$defs"]["Link"]["required"] == ["mass", "com", "inertia"]


def test_a_mapping_by_name_has_no_list_as_its_default() -> None:
    tools = DOCUMENTS["robot"].schema()["properties"]["tools"]
    assert tools["type"] == "object"
    assert "default" not in tools
