"""Cases of a test that take long, and run only where they are asked for; docs/contributing.md says how."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """One slow case."""
    return pytest.param(*values, marks=pytest.mark.slow)


def slow_but(quick: Collection[Any], cases: Iterable[Any]) -> list[Any]:
    """All cases, of which only some are quick."""
    whole = list(cases)
    assert set(quick) <= set(whole)
    return [case if case in quick else slow(case) for case in whole]
