"""Conversion of records to JSON under published keys, and back; non-finite numbers become null."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, ClassVar, Self, TypeAlias, Union, get_args, get_origin, get_type_hints

JsonObject: TypeAlias = Mapping[str, Any]
"""A JSON object."""

Shape: TypeAlias = Mapping[str, Union[str, "Shape"]]
"""The keys of a JSON object, each with the name of an attribute in place of its value."""

OPTIONAL = "?"


def named(*attributes: str) -> dict[str, str]:
    """Return the shape of attributes that are published under their own names."""
    return {name: name for name in attributes}


class Published:
    """A dataclass with a published JSON form.

    `shape` has the keys of the JSON object in their order and nesting, each with the attribute whose value it
    holds. A key that ends with `?` is omitted while that value is None, False or empty. Without a shape, all
    fields are published under their own names.
    """

    shape: ClassVar[Shape] = {}

    def as_json(self) -> dict[str, Any]:
        """Return JSON values under the published keys; non-finite numbers are None."""
        return _written(self, _shape_of(type(self)))


class Stored(Published):
    """A published record that can be read back, by the types of its fields.

    `key` names the field that is not part of the JSON object because it is the key of that object in another.
    """

    key: ClassVar[str] = ""

    @classmethod
    def from_json(cls, content: JsonObject, **further: Any) -> Self:
        """Return a record from the result of `as_json` and `further` fields; None for a float becomes NaN.

        Fields added to a format later have defaults, since earlier files lack them.

        Raises:
            LookupError, TypeError, AttributeError, ValueError: the content is not such a record.
        """
        types = _types_of(cls)  # type: ignore[arg-type]  # mypy does not know that classes are hashable
        found = _found(content, _shape_of(cls))
        return cls(**further, **{name: _read(types[name], value) for name, value in found if name in types})


def json_value(content: Any) -> Any:
    """Convert anything to JSON values; non-finite numbers become None."""
    match content:
        case Published():
            return content.as_json()
        case dict():
            return {key: json_value(entry) for key, entry in content.items()}
        case list() | tuple():
            return [json_value(entry) for entry in content]
        case float() if not math.isfinite(content):
            return None
    return content


def _shape_of(cls: Any) -> Shape:
    return cls.shape or named(*(field.name for field in dataclasses.fields(cls)))


@cache
def _types_of(cls: type) -> dict[str, Any]:
    """Return the type of each field of a dataclass."""
    types = get_type_hints(cls)
    return {field.name: types[field.name] for field in dataclasses.fields(cls)}


def _written(record: Published, shape: Shape) -> dict[str, Any]:
    content = {}
    for key, inner in shape.items():
        value = json_value(getattr(record, inner)) if isinstance(inner, str) else _written(record, inner)
        if not (key.endswith(OPTIONAL) and (value is False or value in (None, [], {}))):
            content[key.removesuffix(OPTIONAL)] = value
    return content


def _found(content: JsonObject, shape: Shape) -> Iterator[tuple[str, Any]]:
    """Yield the names of attributes for which there is content, each with its content."""
    for key, inner in shape.items():
        key = key.removesuffix(OPTIONAL)
        if key not in content:
            continue
        if isinstance(inner, str):
            yield inner, content[key]
        else:
            yield from _found(content[key], inner)


def _read(expected: Any, content: Any) -> Any:
    """Convert content to the type of a field: a number, tuple, mapping or record, or an optional one."""
    types = get_args(expected)
    match get_origin(expected) or expected:
        case origin if type(None) in types:
            (some,) = (option for option in types if option is not type(None))
            return None if content is None else _read(some, content)
        case origin if origin is float:
            return math.nan if content is None else content
        case origin if origin is tuple:
            each = types[:1] * len(content) if types[-1] is Ellipsis else types
            return tuple(_read(one, entry) for one, entry in zip(each, content, strict=True))
        case origin if origin is dict:
            return {key: _read_entry(types[-1], key, entry) for key, entry in content.items()}
        case origin if isinstance(origin, type) and issubclass(origin, Stored):
            return origin.from_json(content)
    return content


def _read_entry(expected: Any, key: str, content: Any) -> Any:
    """Convert the value under a key of a mapping; a record may have that key as a field."""
    if isinstance(expected, type) and issubclass(expected, Stored) and expected.key:
        return expected.from_json(content, **{expected.key: key})
    return _read(expected, content)
