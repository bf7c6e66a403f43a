"""`dataclass` and `NamedTuple` made in a third of the time: a command makes a hundred of them as it starts.

`dataclasses` writes and compiles six methods for each frozen class; here only `__init__` is, the others look
the fields up when they are called. `typing` checks the annotations of a named tuple, as a type checker does.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, NoReturn

__all__ = ["NamedTuple", "dataclass"]

if TYPE_CHECKING:
    from dataclasses import dataclass
    from typing import NamedTuple
else:
    from collections import namedtuple

    def dataclass(*, frozen: bool, eq: bool = True, kw_only: bool = False) -> Any:
        """As `dataclasses.dataclass`, of which this is a part; `frozen` is always true."""
        assert frozen
        methods = _METHODS | (_COMPARISON if eq else {})

        def made(cls: type) -> type:
            for name in methods.keys() - vars(cls).keys():
                setattr(cls, name, methods[name])
            return dataclasses.dataclass(repr=False, eq=False, kw_only=kw_only)(cls)

        return made

    class _MakeNamedTuple(type):
        def __new__(cls, name: str, _bases: tuple[type, ...], body: dict[str, Any]) -> type:
            fields = body.get("__annotations__", {})
            defaults = [body.pop(field) for field in fields if field in body]
            made = namedtuple(name, fields, defaults=defaults, module=body.pop("__module__"))
            for key, content in body.items():
                setattr(made, key, content)
            return made

    NamedTuple = type.__new__(_MakeNamedTuple, "NamedTuple", (), {})
    """As `typing.NamedTuple`, for classes that derive from nothing else."""


def _set(self: Any, name: str, content: Any) -> None:
    """Set an attribute for `__init__`, which is the first to do so."""
    if name in vars(self) or name not in self.__dataclass_fields__:
        _refuse(self, name)
    object.__setattr__(self, name, content)


def _refuse(_self: Any, name: str, *_content: Any) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot change field {name!r}")


def _show(self: Any) -> str:
    shown = [
        f"{field.name}={getattr(self, field.name)!r}" for field in dataclasses.fields(self) if field.repr
    ]
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _compared(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, field.name) for field in dataclasses.fields(self) if field.compare)


def _equal(self: Any, other: object) -> bool:
    return _compared(self) == _compared(other) if type(self) is type(other) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_compared(self))


_METHODS = {"__setattr__": _set, "__delattr__": _refuse, "__repr__": _show}
_COMPARISON = {"__eq__": _equal, "__hash__": _hash}
