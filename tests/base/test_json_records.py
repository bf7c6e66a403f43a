"""Records as JSON: published keys and nesting, there and back."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest

from vsacli.base.json_records import Published, Stored, json_value, named


@dataclass(frozen=True)
class Peak(Stored):
    quantity: str
    value: float
    motor: int | None = None

    key: ClassVar = "quantity"
    shape: ClassVar = {"value": "value", "motor?": "motor"}


@dataclass(frozen=True)
class Span(Stored):
    low: float
    high: float


@dataclass(frozen=True)
class Findings(Stored):
    name: str
    ends: tuple[float, float]
    counts: dict[str, int]
    peaks: dict[str, Peak]
    spans: tuple[Span, ...]
    stop: Span | None
    notes: tuple[str, ...] = ()
    plain: tuple[dict[str, Any], ...] = ()

    format: ClassVar = "findings/1"
    shape: ClassVar = {
        **named("format", "name"),
        "found": {"at": {"ends": "ends"}, "total": "total", "spans?": "spans"},
        **named("counts", "peaks", "stop", "notes", "plain"),
    }

    @property
    def total(self) -> int:
        return sum(self.counts.values())


FOUND = Findings(
    name="a",
    ends=(1.0, math.nan),
    counts={"x": 1, "y": 2},
    peaks={"q": Peak("q", 1.5), "tau": Peak("tau", math.nan, motor=2)},
    spans=(Span(0.0, 1.0),),
    stop=None,
    plain=({"knots": [1, math.inf], "each": (Span(1.0, 2.0),)},),
)
CONTENT = {
    "format": "findings/1",
    "name": "a",
    "found": {"at": {"ends": [1.0, None]}, "total": 3, "spans": [{"low": 0.0, "high": 1.0}]},
    "counts": {"x": 1, "y": 2},
    "peaks": {"q": {"value": 1.5}, "tau": {"value": None, "motor": 2}},
    "stop": None,
    "notes": [],
    "plain": [{"knots": [1, None], "each": [{"low": 1.0, "high": 2.0}]}],
}


def test_keys_and_their_order_are_those_of_the_shape() -> None:
    assert json.dumps(FOUND.as_json(), allow_nan=False) == json.dumps(CONTENT)


def test_there_and_back() -> None:
    again = Findings.from_json(json.loads(json.dumps(FOUND.as_json())))
    assert again.as_json() == CONTENT
    assert again.ends[0] == 1.0
    assert math.isnan(again.ends[1])
    assert (again.peaks["q"], again.peaks["tau"].quantity) == (Peak("q", 1.5), "tau")
    assert (again.spans, again.stop, again.counts) == (FOUND.spans, None, FOUND.counts)
    assert Findings.from_json({**CONTENT, "stop": {"low": 1, "high": None}}).stop != FOUND.stop


def test_what_is_empty_may_be_left_out_and_what_is_missing_has_its_default() -> None:
    content = {**CONTENT, "found": {"at": {"ends": [1.0, 2.0]}}}
    del content["notes"]
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'spans'"):
        Findings.from_json(content)
    content["found"] = {**content["found"], "spans": []}
    again = Findings.from_json(content)
    assert (again.spans, again.notes) == ((), ())
    assert "spans" not in again.as_json()["found"]


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"found": None}, TypeError),
        ({"found": {"at": {"ends": [1.0]}, "spans": []}}, ValueError),
        ({"peaks": []}, AttributeError),
        ({"peaks": {"q": {}}}, TypeError),
        ({"stop": 1}, TypeError),
        ({"spans": [1]}, None),
    ],
)
def test_what_is_no_such_record(change: dict[str, Any], error: type[Exception] | None) -> None:
    content = {**CONTENT, **change}
    if error is None:  # an unknown key is one that a later version has added
        assert Findings.from_json(content).as_json() == CONTENT
        return
    with pytest.raises(error):
        Findings.from_json(content)


def test_what_is_only_published() -> None:
    @dataclass(frozen=True)
    class Advice(Published):
        factor: float

        possible: ClassVar = True
        shape: ClassVar = named("possible", "factor")

    assert Advice(math.inf).as_json() == {"possible": True, "factor": None}


def test_json_value() -> None:
    assert json_value({"a": (1, math.nan), "b": [Span(0.0, -math.inf)], "c": "x", "d": None}) == {
        "a": [1, None],
        "b": [{"low": 0.0, "high": None}],
        "c": "x",
        "d": None,
    }
