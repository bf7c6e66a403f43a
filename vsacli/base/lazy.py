"""Imports at first use, so that a command waits only for the modules it needs."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any


def import_from(home: str) -> Any:
    """Import an object from its home, "module:name"."""
    module, _, name = home.partition(":")
    return getattr(importlib.import_module(module), name)


class LazyRegistry(Mapping[str, Any]):
    """Objects by name, each imported when it is looked up; listing the names imports nothing.

    Args:
        homes: location of each object, "module:name".
    """

    def __init__(self, homes: Mapping[str, str]) -> None:
        self.homes = dict(homes)

    def __getitem__(self, name: str) -> Any:
        return import_from(self.homes[name])

    def name_of(self, cls: type) -> str:
        """Return the name of a registered class, without importing anything.

        Raises:
            KeyError: the class is not registered.
        """
        home = f"{cls.__module__}:{cls.__qualname__}"
        for name, registered_home in self.homes.items():
            if registered_home == home:
                return name
        raise KeyError(home)

    def __contains__(self, name: object) -> bool:
        return name in self.homes

    def __iter__(self) -> Iterator[str]:
        return iter(self.homes)

    def __len__(self) -> int:
        return len(self.homes)


class _MissingNameError(AttributeError):
    """A name that a package does not export; the message is composed when it is shown.

    Imports of submodules ask for names that are missing, and drop the error.
    """

    def __init__(self, package: str, name: str) -> None:
        super().__init__(package, name)

    def __str__(self) -> str:
        from vsacli.base.renamed import now_called

        package, name = self.args
        exported = sys.modules[package].__all__
        return f"module {package!r} has no attribute {name!r}{now_called(name, exported)}"


def lazy_exports(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package that imports its exports at first use (PEP 562).

    Its `__init__.py` lists the exports as imports under `if TYPE_CHECKING:`, one list for type checkers and
    for the running program; `import *` stands for all exports of a package.

    Args:
        package: name of the package.
    """

    @cache
    def homes() -> dict[str, str]:
        path = sys.modules[package].__file__
        assert path is not None
        return dict(_type_checking_imports(path))

    def get(name: str) -> Any:
        exported = vars(sys.modules[package]).get("__all__")
        if name == "__all__":
            return sorted(homes())
        if name not in (homes() if exported is None else exported):
            raise _MissingNameError(package, name)
        home = homes()[name]
        if home == package:  # a submodule
            return importlib.import_module(f"{package}.{name}")
        return getattr(importlib.import_module(home), name)

    return get, lambda: sorted(homes())


def _type_checking_imports(path: str) -> Iterator[tuple[str, str]]:
    """Yield each name that a module imports under `if TYPE_CHECKING:`, with the module it comes from."""
    with open(path, encoding="utf-8") as file:
        statements = ast.parse(file.read()).body
    block = next(statement for statement in statements if isinstance(statement, ast.If))
    for statement in block.body:
        assert isinstance(statement, ast.ImportFrom)
        assert statement.module is not None
        for alias in statement.names:
            names = importlib.import_module(statement.module).__all__ if alias.name == "*" else [alias.name]
            yield from ((name, statement.module) for name in names)
