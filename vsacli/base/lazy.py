"""Things that are imported when they are first asked for, so that a command waits only for what it needs."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from typing import Any


class LazyRegistry(Mapping[str, Any]):
    """Things by name, each imported when it is looked up; the names alone import nothing.

    Args:
        homes: where each thing is, "module:name".
    """

    def __init__(self, homes: Mapping[str, str]) -> None:
        self.homes = dict(homes)

    def __getitem__(self, name: str) -> Any:
        module, _, thing = self.homes[name].partition(":")
        return getattr(importlib.import_module(module), thing)

    def name_of(self, cls: type) -> str:
        """The name of a class that is one of the things; imports nothing.

        Raises:
            KeyError: it is none of them.
        """
        home = f"{cls.__module__}:{cls.__qualname__}"
        for name, other in self.homes.items():
            if other == home:
                return name
        raise KeyError(home)

    def __contains__(self, name: object) -> bool:
        return name in self.homes

    def __iter__(self) -> Iterator[str]:
        return iter(self.homes)

    def __len__(self) -> int:
        return len(self.homes)
