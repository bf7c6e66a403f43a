"""The modules that a call visits, in order, and how often it comes back to one that it has left."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from samples.sources import PACKAGE


def visited(call: Callable[[], object]) -> list[str]:
    """Return the modules of the package in the order of a warm call's function calls, without repetition.

    Comprehensions and generator expressions are part of the function that holds them.
    """
    path: list[str] = []
    root = f"{PACKAGE}/"

    def note(frame: FrameType, event: str, _argument: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(root) and not code.co_name.startswith("<"):
            module = str(Path(code.co_filename).relative_to(PACKAGE))
            if path[-1:] != [module]:
                path.append(module)

    call()  # fills caches, imports
    call()
    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return path


def returns(path: list[str]) -> int:
    """Return how often a path comes back to a module that it has left."""
    return len(path) - len({*path})
