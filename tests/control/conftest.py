"""Limits of generated code."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from vsacli.control.codegen import interface


@pytest.fixture
def most_operations(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Set the largest numbers of operations of functions that are written out, and of those of calls."""

    def limit(written_out: int, of_calls: int = interface.MOST_OF_CALLS) -> None:
        for name, most in (("MOST_WRITTEN_OUT", written_out), ("MOST_OF_CALLS", of_calls)):
            monkeypatch.setattr(interface, name, most)

    return limit
