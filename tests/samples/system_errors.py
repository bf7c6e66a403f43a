"""Errors that the operating system reports."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any


def fail_with(code: int, condition: Callable[..., bool] = lambda *_: True) -> Callable[..., None]:
    """Return a function that raises the error of a code of `errno`, if its arguments meet a condition."""

    def fail(*arguments: Any) -> None:
        if condition(*arguments):
            raise OSError(code, os.strerror(code))

    return fail
