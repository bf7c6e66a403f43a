"""Kinds of declared values: what each makes of a value besides reading it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from vsacli.base.units import LENGTH, POSITION
from vsacli.documents.fields import (
    FINITE,
    NON_NEGATIVE,
    Boolean,
    Choice,
    Integer,
    Interval,
    Items,
    Kind,
    NamedNumbers,
    Number,
    OneOf,
    Pair,
    PerJoint,
    Record,
    TableFile,
    Text,
    Vector,
    check_fields,
    choice,
    declared,
    number,
    text,
    value,
)
from vsacli.documents.kinds.nested import refused_in
from vsacli.documents.records import Line, Values
from vsacli.documents.resolved_fields import ResolvedField


@dataclass(frozen=True)
class Wheel:
    radius: float = number(LENGTH, "radius", check=NON_NEGATIVE)
    name: str = text("name", default="")

    not_yet = ("tyre",)

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Ski:
    length: float = number(LENGTH, "length")


@dataclass(frozen=True)
class Sledge:
    run: Wheel = value(Record(Wheel), "what it runs on")
    colour: str = choice(("red", "blue"), "colour", not_yet=("green",))
    part: Wheel | Ski = value(OneOf({"wheel": Wheel, "ski": Ski}, not_yet=("rope",)), "part")


WHEEL, SKI = Wheel(radius=1.0, name="w"), Ski(length=2.0)
PART = OneOf({"wheel": Wheel, "ski": Ski})


def arrays_of(record: Any) -> Iterator[ResolvedField]:
    for name, (field, _) in declared(type(record)).items():
        for part in field.kind.arrays(getattr(record, name), arrays_of):
            yield part._replace(path=(name, *part.path))


def resolved(kind: Kind, content: Any) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Dimensions and values of what a kind makes of a value, by path."""
    parts = kind.arrays(content, arrays_of)
    return {".".join(part.path): (part.dims, part.values.tolist()) for part in parts}


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        (Number(LENGTH), 1, {"": ((), 1.0)}),
        (Boolean(), True, {"": ((), "true")}),
        (Text(), "a", {"": ((), "a")}),
        (Choice(("a", "b")), "b", {"": ((), "b")}),
        (Vector(2, LENGTH), (1, 2), {"": (("axis",), [1.0, 2.0])}),
        (Interval(LENGTH), (1, 2), {"": (("bound",), [1.0, 2.0])}),
        (Record(Wheel), WHEEL, {"radius": ((), 1.0), "name": ((), "w")}),
        (PART, SKI, {"type": ((), "ski"), "length": ((), 2.0)}),
        (Pair(Record(Ski)), (SKI, Ski(length=3.0)), {"length": (("motor",), [2.0, 3.0])}),
    ],
)
def test_arrays(kind: Kind, content: Any, expected: dict[str, Any]) -> None:
    assert resolved(kind, content) == expected


def test_entries_of_a_list_share_the_arrays_whatever_fields_they_have() -> None:
    found = resolved(Items(PART), (WHEEL, SKI))
    assert found["type"] == (("joint",), ["wheel", "ski"])
    assert found["name"] == (("joint",), ["w", ""])
    np.testing.assert_array_equal(found["radius"][1], [1, np.nan])
    np.testing.assert_array_equal(found["length"][1], [np.nan, 2])


@pytest.mark.parametrize("kind", [Integer(), PerJoint(LENGTH), Items(Number(LENGTH))])
def test_kinds_without_arrays_say_so(kind: Kind) -> None:
    with pytest.raises(TypeError, match=r"a field of the kind .* has no array form"):
        kind.arrays((1,), arrays_of)


@pytest.mark.parametrize(
    ("kind", "content", "path", "problem"),
    [
        (Number(LENGTH), -1.0, ("x",), "must be zero or positive, not -1"),
        (PerJoint(LENGTH), (1.0, None, -2.0), ("x", 2), "must be zero or positive, not -2"),
        (Vector(2, LENGTH), (1.0, -2.0), ("x", 1), "must be zero or positive, not -2"),
        (Vector(2, LENGTH), (1.0,), ("x",), "expected 2 numbers, found 1"),
        (Items(Vector(2, LENGTH)), ((1.0, 2.0), (1.0,)), ("x", 1), "expected 2 numbers, found 1"),
        (Items(Number(LENGTH)), (1.0, -2.0), ("x", 1), "must be zero or positive, not -2"),
        (Pair(Number(LENGTH)), (1.0, -2.0), ("x", 1), "must be zero or positive, not -2"),
        (Interval(LENGTH), (2.0, 1.0), ("x",), "the lower bound 2 exceeds the upper bound 1"),
        (Interval(LENGTH), (2.0, 1e31), ("x", 1), "must be at most 1e+30 in size, not 1e+31"),
        (Choice(("a",), not_yet=("b",)), "b", ("x",), "'b' is not supported yet"),
        (Boolean(), 1, ("x",), "must be true or false, not 1"),
        (Text(identifier=True), "1", ("x",), "must be made of letters, digits, _ and -, beginning with"),
        (
            Items(Record(Wheel), unique="name"),
            (WHEEL, WHEEL),
            ("x", 1, "name"),
            "'w' is taken by another entry; each needs its own",
        ),
    ],
)
def test_problems(kind: Kind, content: Any, path: tuple[str | int, ...], problem: str) -> None:
    check = None if isinstance(kind, Interval | Text | Choice | Boolean) else NON_NEGATIVE
    (found,) = kind.problems(("x",), check, content)
    assert found.path == path
    assert found.message.startswith(problem)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (Number(POSITION), "rad (m if prismatic)"),
        (Integer(), "whole number"),
        (Boolean(), "`true` or `false`"),
        (Text(), "text"),
        (Choice(("a", "b")), "`a` or `b`"),
        (Vector(3, LENGTH), "3 numbers, m"),
        (Interval(LENGTH, lowest=-math.inf), "[lower, upper], or one number x (upper), m"),
        (Interval(LENGTH, lowest=0), "[lower, upper], or one number x (0 to x), m"),
        (PerJoint(LENGTH), "per joint, m"),
        (TableFile(("a", "b")), "CSV file with the columns `a`, `b`"),
        (Record(Wheel), "mapping"),
        (PART, "mapping; `type`: `wheel` or `ski`"),
        (Items(PART), "list"),
        (Items(Number(LENGTH)), "list, each m"),
        (Pair(Record(Wheel)), "mapping; or a list of two"),
    ],
)
def test_words(kind: Kind, words: str) -> None:
    assert kind.words == words


def test_what_is_not_supported_yet() -> None:
    assert list(refused_in(Sledge)) == ["run.tyre", "colour: green", "part: {type: rope}"]
    assert list(Items(Record(Wheel)).refused("wheels")) == ["wheels.tyre"]
    assert list(Pair(Record(Wheel)).refused("wheels")) == ["wheels.tyre"]
    assert list(Number(LENGTH).refused("x")) == []


def lines_of(cls: type, values: Values) -> Iterator[Line]:
    for name, (field, _) in declared(cls).items():
        if name in values:
            yield from field.kind.lines(name, values[name], field.doc, lines_of)


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        (Number(LENGTH), 1.5, ["x: 1.5"]),
        (Boolean(), False, ["x: false"]),
        (PerJoint(LENGTH), {"a": 1, "b": "90 deg"}, ["x: {a: 1, b: 90 deg}"]),
        (Vector(2, LENGTH), (1.0, 2), ["x: [1, 2]"]),
        (Record(Wheel), {"radius": 1}, ["x:", "  radius: 1"]),
        (PART, {"type": "ski", "length": 1}, ["x:", "  type: ski", "  length: 1"]),
        (Pair(PART), {"type": "ski", "length": 1}, ["x:", "  type: ski", "  length: 1"]),
        (Items(Number(LENGTH)), [1, 2], ["x: [1, 2]"]),
        (
            Items(Record(Wheel)),
            [{"radius": 1, "name": "w"}, {"radius": 2}],
            ["x:", "  - radius: 1", "    name: w", "  - radius: 2"],
        ),
    ],
)
def test_lines(kind: Kind, content: Any, expected: list[str]) -> None:
    lines = list(kind.lines("x", content, "said of it", lines_of))
    assert [line.text for line in lines] == expected
    assert lines[0].comment == "said of it"


def json_of(record: Any) -> dict[str, Any]:
    return {
        name: field.kind.json_value(getattr(record, name), json_of)
        for name, (field, _) in declared(type(record)).items()
    }


@pytest.mark.parametrize(
    ("kind", "content", "expected"),
    [
        (Number(LENGTH), 1.5, 1.5),
        (Interval(LENGTH), (1, 2), [1, 2]),
        (PerJoint(LENGTH), (1, None), [1, None]),
        (Record(Ski), SKI, {"length": 2.0}),
        (PART, SKI, {"type": "ski", "length": 2.0}),
        (Pair(PART), (SKI, SKI), [{"type": "ski", "length": 2.0}] * 2),
        (Items(Record(Ski)), (SKI,), [{"length": 2.0}]),
    ],
)
def test_plain(kind: Kind, content: Any, expected: Any) -> None:
    assert kind.json_value(content, json_of) == expected


def test_named_numbers_are_pairs_that_go_by_their_names():
    kind, content = NamedNumbers(), (("k", 3.0), ("turn", math.inf))
    assert kind.json_value(content, lambda _: None) == {"k": 3.0, "turn": math.inf}
    arrays = list(kind.arrays(content, lambda _: iter(())))
    assert [(field.path, float(field.values)) for field in arrays] == [(("k",), 3.0), (("turn",), math.inf)]
    problems = list(kind.problems(("constants",), FINITE, content))
    assert [str(problem) for problem in problems] == ["constants.turn: must be finite, not inf"]
