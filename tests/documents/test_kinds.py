"""Kinds of declared values: what each makes of a value besides reading it."""

from __future__ import annotations

import dataclasses
import importlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY

from vsacli.base.units import LENGTH, POSITION
from vsacli.documents.commented import commented_document
from vsacli.documents.fields import (
    FINITE,
    NON_NEGATIVE,
    Boolean,
    Integer,
    Interval,
    Items,
    NamedNumbers,
    NumberList,
    NumberWithUnit,
    OneOf,
    PairOf,
    PerJoint,
    RecordOf,
    TablePath,
    Text,
    ValueKind,
    WordChoice,
    choice,
    declared_fields,
    number,
    text,
    value,
)
from vsacli.documents.record_checks import DeclaredRecord, value_problems
from vsacli.documents.record_values import ResolvedField, resolve_values, value_as_json


@dataclass(frozen=True)
class Wheel(DeclaredRecord):
    radius: float = number(LENGTH, "radius", check=NON_NEGATIVE)
    name: str = text("name", default="")

    not_yet = ("tyre",)


@dataclass(frozen=True)
class Ski:
    length: float = number(LENGTH, "length")


@dataclass(frozen=True)
class Sledge:
    run: Wheel = value(RecordOf(Wheel), "what it runs on")
    color: str = choice(("red", "blue"), "color", not_yet=("green",))
    part: Wheel | Ski = value(OneOf({"wheel": Wheel, "ski": Ski}, not_yet=("rope",)), "part")


@dataclass(frozen=True)
class Light:
    run: Wheel = value(RecordOf(Wheel), "what it runs on")


@dataclass(frozen=True)
class Train:
    sledges: tuple[Light, ...] = value(Items(RecordOf(Light)), "sledges")
    wheels: tuple[Wheel, Wheel] = value(PairOf(RecordOf(Wheel)), "front and rear")
    gauge: float = number(LENGTH, "gauge")


@pytest.fixture
def of_docs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What the documentation is generated with."""
    monkeypatch.syspath_prepend(REPOSITORY / "docs")
    return importlib.import_module("field_tables")


WHEEL, SKI = Wheel(radius=1.0, name="w"), Ski(length=2.0)
PART = OneOf({"wheel": Wheel, "ski": Ski})


def arrays_of(record: Any) -> Iterator[ResolvedField]:
    for name, (field, _) in declared_fields(type(record)).items():
        for part in resolve_values(field.kind, getattr(record, name), arrays_of):
            yield part._replace(path=(name, *part.path))


def resolved(kind: ValueKind, content: Any) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Dimensions and values of what a kind makes of a value, by path."""
    parts = resolve_values(kind, content, arrays_of)
    return {".".join(part.path): (part.dims, part.values.tolist()) for part in parts}


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        (NumberWithUnit(LENGTH), 1, {"": ((), 1.0)}),
        (Boolean(), True, {"": ((), "true")}),
        (Text(), "a", {"": ((), "a")}),
        (WordChoice(("a", "b")), "b", {"": ((), "b")}),
        (NumberList(2, LENGTH), (1, 2), {"": (("axis",), [1.0, 2.0])}),
        (Interval(LENGTH), (1, 2), {"": (("bound",), [1.0, 2.0])}),
        (RecordOf(Wheel), WHEEL, {"radius": ((), 1.0), "name": ((), "w")}),
        (PART, SKI, {"type": ((), "ski"), "length": ((), 2.0)}),
        (PairOf(RecordOf(Ski)), (SKI, Ski(length=3.0)), {"length": (("motor",), [2.0, 3.0])}),
    ],
)
def test_arrays(kind: ValueKind, content: Any, expected: dict[str, Any]) -> None:
    assert resolved(kind, content) == expected


def test_entries_of_a_list_share_the_arrays_whatever_fields_they_have() -> None:
    found = resolved(Items(PART), (WHEEL, SKI))
    assert found["type"] == (("joint",), ["wheel", "ski"])
    assert found["name"] == (("joint",), ["w", ""])
    np.testing.assert_array_equal(found["radius"][1], [1, np.nan])
    np.testing.assert_array_equal(found["length"][1], [np.nan, 2])


@pytest.mark.parametrize("kind", [Integer(), PerJoint(LENGTH), Items(NumberWithUnit(LENGTH))])
def test_kinds_without_arrays_say_so(kind: ValueKind) -> None:
    with pytest.raises(TypeError, match=r"a field of the kind .* has no array form"):
        list(resolve_values(kind, (1,), arrays_of))


@pytest.mark.parametrize(
    ("kind", "content", "path", "problem"),
    [
        (NumberWithUnit(LENGTH), -1.0, ("x",), "must be zero or positive, not -1 {}"),
        (PerJoint(LENGTH), (1.0, None, -2.0), ("x", 2), "must be zero or positive, not -2 {}"),
        (NumberList(2, LENGTH), (1.0, -2.0), ("x", 1), "must be zero or positive, not -2 {}"),
        (NumberList(2, LENGTH), (1.0,), ("x",), "expected 2 numbers in {}, found 1"),
        (Items(NumberList(2, LENGTH)), ((1.0, 2.0), (1.0,)), ("x", 1), "expected 2 numbers in {}, found 1"),
        (Items(NumberWithUnit(LENGTH)), (1.0, -2.0), ("x", 1), "must be zero or positive, not -2 {}"),
        (PairOf(NumberWithUnit(LENGTH)), (1.0, -2.0), ("x", 1), "must be zero or positive, not -2 {}"),
        (
            Interval(LENGTH),
            (2.0, 1.0),
            ("x",),
            "the lower limit 2 {} exceeds the upper limit 1 {}; swap them",
        ),
        (Interval(LENGTH), (2.0, 1e31), ("x", 1), "must be at most 1e+30 in size, not 1e+31 {}"),
        (WordChoice(("a",), not_yet=("b",)), "b", ("x",), "'b' is not supported yet"),
        (Boolean(), 1, ("x",), "must be true or false, not 1"),
        (Text(identifier=True), "1", ("x",), "must be made of letters, digits, _ and -, beginning with"),
        (
            Items(RecordOf(Wheel), unique="name"),
            (WHEEL, WHEEL),
            ("x", 1, "name"),
            "'w' is already used by entry 0; choose another one",
        ),
    ],
)
def test_problems(kind: ValueKind, content: Any, path: tuple[str | int, ...], problem: str) -> None:
    check = None if isinstance(kind, Interval | Text | WordChoice | Boolean) else NON_NEGATIVE
    (found,) = value_problems(kind, check, content, ("x",))
    assert found.path == path
    assert found.message.startswith(problem)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (NumberWithUnit(POSITION), "rad (m if prismatic)"),
        (Integer(), "whole number"),
        (Boolean(), "`true` or `false`"),
        (Text(), "text"),
        (WordChoice(("a", "b")), "`a` or `b`"),
        (NumberList(3, LENGTH), "3 numbers, m"),
        (Interval(LENGTH, lowest=-math.inf), "[lower, upper], or one number x (upper), m"),
        (Interval(LENGTH, lowest=0), "[lower, upper], or one number x (0 to x), m"),
        (PerJoint(LENGTH), "per joint, m"),
        (TablePath(("a", "b")), "CSV file with the columns `a`, `b`"),
        (RecordOf(Wheel), "mapping"),
        (PART, "mapping; `type`: `wheel` or `ski`"),
        (Items(PART), "list"),
        (Items(NumberWithUnit(LENGTH)), "list, each m"),
        (PairOf(RecordOf(Wheel)), "mapping; or a list of two"),
    ],
)
def test_words(of_docs: Any, kind: ValueKind, words: str) -> None:
    assert of_docs.words_of(kind) == words


def test_what_is_not_supported_yet(of_docs: Any) -> None:
    assert list(of_docs.refused_in(Sledge)) == ["run.tyre", "color: green", "part: {type: rope}"]
    assert list(of_docs.refused_in(Train)) == ["sledges.run.tyre", "wheels.tyre"]


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        (NumberWithUnit(LENGTH), 1.5, ["x: 1.5"]),
        (Boolean(), False, ["x: false"]),
        (PerJoint(LENGTH), {"a": 1, "b": "90 deg"}, ["x: {a: 1, b: 90 deg}"]),
        (NumberList(2, LENGTH), (1.0, 2), ["x: [1, 2]"]),
        (RecordOf(Ski), {"length": 1}, ["x:", "  length: 1"]),
        (PART, {"type": "ski", "length": 1}, ["x:", "  type: ski", "  length: 1"]),
        (PairOf(PART), {"type": "ski", "length": 1}, ["x:", "  type: ski", "  length: 1"]),
        (Items(NumberWithUnit(LENGTH)), [1, 2], ["x: [1, 2]"]),
        (Items(Items(NumberWithUnit(LENGTH))), [[1, 2], [3]], ["x:", "  - [1, 2]", "  - [3]"]),
        (
            Items(RecordOf(Wheel)),
            [{"radius": 1, "name": "w"}, {"radius": 2}],
            ["x:", "  - radius: 1", "    name: w", "  - radius: 2"],
        ),
    ],
)
def test_lines(kind: ValueKind, content: Any, expected: list[str]) -> None:
    document = dataclasses.make_dataclass("Document", [("x", Any, value(kind, "said of it"))])
    first, *lines = commented_document("f/1", document, {"x": content}).splitlines()
    assert first == "format: f/1"
    assert [line.partition("#")[0].rstrip() for line in lines] == expected
    assert "said of it" in lines[0]


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        (NumberWithUnit(LENGTH), 1.5, 1.5),
        (Interval(LENGTH), (1, 2), [1, 2]),
        (PerJoint(LENGTH), (1, None), [1, None]),
        (RecordOf(Ski), SKI, {"length": 2.0}),
        (PART, SKI, {"type": "ski", "length": 2.0}),
        (PairOf(PART), (SKI, SKI), [{"type": "ski", "length": 2.0}] * 2),
        (Items(RecordOf(Ski)), (SKI,), [{"length": 2.0}]),
    ],
)
def test_plain(kind: ValueKind, content: Any, expected: Any) -> None:
    assert value_as_json(kind, content) == expected


def test_named_numbers_are_pairs_that_go_by_their_names():
    kind, content = NamedNumbers(), (("k", 3.0), ("turn", math.inf))
    assert value_as_json(kind, content) == {"k": 3.0, "turn": math.inf}
    found = resolve_values(kind, content, lambda _: iter(()))
    assert [(field.path, float(field.values)) for field in found] == [(("k",), 3.0), (("turn",), math.inf)]
    problems = list(value_problems(kind, FINITE, content, ("constants",)))
    assert [str(problem) for problem in problems] == ["constants.turn: must be finite, not inf"]
