"""A single value of a description, by the path that leads to it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError


def select(content: Any, path: str) -> Any:
    """The value at a dot path, such as `joints.0.link.mass`; entries of a list count from 0.

    An entry of a list that has a name may be given by it: `joints.elbow.link.mass`.

    Raises:
        InputError: naming the first word that leads nowhere, and the nearest one that does.
    """
    for depth, word in enumerate(path.split(".")):
        entries = _entries(content)
        if word not in entries:
            parents = ".".join(path.split(".")[:depth])
            where = f"{parents} has" if parents else "there is"
            hint = did_you_mean(word, entries) if entries else "; it is a single value"
            raise InputError.one(f"--field: {where} no {word!r}{hint}")
        content = entries[word]
    return content


def bare(value: Any) -> str:
    """A value as a script wants it: texts without quotes, everything else as JSON."""
    return value if isinstance(value, str) else json.dumps(value)


def _entries(content: Any) -> dict[str, Any]:
    match content:
        case Mapping():
            return dict(content)
        case list():
            named = {
                str(entry["name"]): entry
                for entry in content
                if isinstance(entry, Mapping) and "name" in entry
            }
            return named | {str(index): entry for index, entry in enumerate(content)}
    return {}
