"""The page `api`: what `vsacli` exports, in the groups of the page on Python, with whole docstrings."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import TYPE_CHECKING, Any

from python_names import GROUPS, METHODS

import vsacli
from vsacli.documents.fields import declared_fields

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SEVERAL = re.compile(r"^:(ivar|param) \w+(, \w+)+:")
"""A field of a docstring for several names, of which the first would be taken for the type of the last."""


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the descriptions when the page is read."""
    app.connect("source-read", _add_descriptions)
    app.connect("autodoc-process-docstring", _add_fields)
    app.connect("autodoc-process-docstring", _escape)
    return {"parallel_read_safe": True}


def descriptions() -> Iterator[str]:
    """A section for each group and each module that a group names, which Sphinx fills."""
    modules: dict[str, ModuleType] = {}
    for title, names in GROUPS.items():
        yield f"## {title}\n"
        for name in names.split():
            thing = getattr(vsacli, name)
            if isinstance(thing, ModuleType):
                modules[f"vsacli.{name}"] = thing
            else:
                yield _description(f"vsacli.{name}", thing)
    for path, module in modules.items():
        yield f"## {path}\n\n{inspect.getdoc(module)}\n"
        yield from (_description(f"{path}.{name}", thing) for name, thing in _own(module))


def _own(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Classes and functions from the module's own room; constants have no docstrings."""
    for name in module.__all__:
        thing = getattr(module, name)
        if getattr(thing, "__module__", "").startswith(module.__name__) and hasattr(thing, "__name__"):
            yield name, thing


def _description(path: str, thing: type | Callable[..., Any]) -> str:
    """A directive of autodoc, within Markdown; of classes to derive from, all that is public."""
    if not inspect.isclass(thing):
        return f"```{{eval-rst}}\n.. autofunction:: {path}\n```\n"
    methods = ", ".join(method for method in METHODS if method in vars(thing))
    members = "   :members:" if inspect.isabstract(thing) else f"   :members: {methods}" if methods else ""
    return f"```{{eval-rst}}\n.. autoclass:: {path}\n{members}\n```\n"


def _add_fields(_app: Sphinx, _what: str, _name: str, thing: Any, _options: Any, lines: list[str]) -> None:
    """Tell of the fields of a record what their declarations say."""
    if inspect.isclass(thing) and dataclasses.is_dataclass(thing):
        lines += [f":ivar {name}: {field.doc}" for name, (field, _default) in declared_fields(thing).items()]


def _escape(_app: Sphinx, _what: str, _name: str, _thing: Any, _options: Any, lines: list[str]) -> None:
    """Let |x| be an absolute value and `q, dq` two names, which reStructuredText takes for something else."""
    lines[:] = [SEVERAL.sub(_joined, line.replace("|", r"\|")) for line in lines]


def _joined(names: re.Match[str]) -> str:
    return names[0].replace(", ", ",")


def _add_descriptions(_app: Sphinx, page: str, source: list[str]) -> None:
    if page == "api":
        source[0] = "\n".join([source[0], *descriptions()])
