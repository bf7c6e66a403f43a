"""Records behave as the classes of the standard library do that they stand for."""

from __future__ import annotations

import copy
import dataclasses
import typing
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from vsacli import records

DATACLASSES = pytest.mark.parametrize("dataclass", [dataclasses.dataclass, records.dataclass])
TUPLES = pytest.mark.parametrize("base", [typing.NamedTuple, records.NamedTuple], ids=["typing", "records"])

Maker = Callable[..., Any]


def point(dataclass: Maker, **options: bool) -> Any:
    @dataclass(frozen=True, **options)
    class Point:
        """A point."""

        x: float
        y: float = 2.0
        tags: list[str] = dataclasses.field(default_factory=list, compare=False)
        secret: int = dataclasses.field(default=7, kw_only=True, repr=False)
        size: float = dataclasses.field(init=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "size", self.x + self.y)

    return Point


@DATACLASSES
def test_arguments_and_defaults(dataclass: Maker) -> None:
    made = point(dataclass)(1, secret=3)
    assert (made.x, made.y, made.tags, made.secret, made.size) == (1, 2.0, [], 3, 3.0)
    with pytest.raises(TypeError, match="missing 1 required"):
        point(dataclass)(y=1)
    with pytest.raises(TypeError, match="unexpected keyword argument 'z'"):
        point(dataclass)(x=1, z=2)


@DATACLASSES
@pytest.mark.parametrize("name", ["x", "size", "unheard_of"])
def test_nothing_can_be_changed(dataclass: Maker, name: str) -> None:
    made = point(dataclass)(1)
    with pytest.raises(dataclasses.FrozenInstanceError, match=name):
        setattr(made, name, 5.0)
    with pytest.raises(dataclasses.FrozenInstanceError, match=name):
        delattr(made, name)
    assert (made.x, made.size) == (1, 3.0)


@DATACLASSES
def test_equality(dataclass: Maker) -> None:
    cls = point(dataclass)
    assert cls(1, tags=["a"]) == cls(1, tags=["b"])
    assert hash(cls(1, tags=["a"])) == hash(cls(1, tags=["b"]))
    assert cls(1) != cls(1, secret=8)
    assert cls(1) != (1, 2.0, 7, 3.0)
    assert type("Derived", (cls,), {})(1) != cls(1)


@DATACLASSES
def test_identity_instead_of_equality(dataclass: Maker) -> None:
    cls = point(dataclass, eq=False)
    made = cls(np.zeros(2))
    assert made == made  # arrays have no truth value
    assert made != cls(made.x)
    assert {made: 1}[made] == 1


@DATACLASSES
def test_the_text_of_a_record(dataclass: Maker) -> None:
    assert repr(point(dataclass)(1)) == "point.<locals>.Point(x=1, y=2.0, tags=[], size=3.0)"


@DATACLASSES
def test_a_method_of_the_class_is_kept(dataclass: Maker) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Named:
        name: str

        def __repr__(self) -> str:
            return self.name

    assert repr(Named(name="elbow")) == "elbow"
    with pytest.raises(TypeError, match="positional"):
        Named("elbow")


@DATACLASSES
def test_inheritance(dataclass: Maker) -> None:
    @dataclass(frozen=True)
    class Solid(point(dataclass)):  # type: ignore[misc]
        z: float = 3.0

    made = Solid(1, z=4)
    assert [field.name for field in dataclasses.fields(made)] == ["x", "y", "tags", "secret", "size", "z"]
    assert made == Solid(1, z=4) != Solid(1)
    with pytest.raises(dataclasses.FrozenInstanceError, match="z"):
        made.z = 5


@DATACLASSES
def test_copies(dataclass: Maker) -> None:
    cls = point(dataclass)
    made = cls(1, tags=["a"])
    copied = copy.deepcopy(made)
    assert copied == made
    assert copied.tags is not made.tags
    assert dataclasses.replace(made, x=2, secret=1) == cls(2, secret=1)


@TUPLES
def test_named_tuples(base: Any) -> None:
    class Step(base):  # type: ignore[misc]
        """A step."""

        time: float
        joint: str = "base"

        @property
        def label(self) -> str:
            return f"{self.joint} at {self.time}"

    class Nothing(base):  # type: ignore[misc]
        """Without fields."""

    step = Step(0.5)
    assert step == (0.5, "base") == Step(time=0.5, joint="base")
    assert (step.label, repr(step)) == ("base at 0.5", "Step(time=0.5, joint='base')")
    assert step._replace(time=1.0)._asdict() == {"time": 1.0, "joint": "base"}
    assert (Step._fields, Step._field_defaults) == (("time", "joint"), {"joint": "base"})
    assert list(Step.__annotations__) == ["time", "joint"]
    assert (Step.__doc__, Step.__module__) == ("A step.", __name__)
    assert Step.__qualname__.endswith("<locals>.Step")
    assert Nothing() == ()
    for name in ("time", "other"):
        with pytest.raises(AttributeError, match=f"set attribute|no attribute '{name}'"):
            setattr(step, name, 1.0)
    match step:
        case Step(time, joint):
            assert (time, joint) == (0.5, "base")
