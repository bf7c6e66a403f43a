"""Marks of tests: what takes long, and what the machine must have."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterable
from typing import Any

import pytest

COMPILERS = tuple(name for name in ("gcc", "clang") if shutil.which(name))


def slow(*values: Any) -> Any:
    """One case of a test that only runs where slow ones are asked for."""
    return pytest.param(*values, marks=pytest.mark.slow)


def exhaustive(*values: Any) -> Any:
    """One case of a test, of which other cases cover the kind, that only runs before a release."""
    return pytest.param(*values, marks=[pytest.mark.slow, pytest.mark.exhaustive])


def slow_but(quick: Collection[Any], cases: Iterable[Any]) -> list[Any]:
    """All cases, of which only some are quick."""
    whole = list(cases)
    assert set(quick) <= set(whole)
    return [case if case in quick else slow(case) for case in whole]


def spread(items: list[Any], count: int) -> list[Any]:
    """Return `count` items at equal distances, or all if there are fewer."""
    return [items[place * len(items) // count] for place in range(min(count, len(items)))]


def needs(command: str, package: str) -> Any:
    """A test that is skipped without a command; `.ci/run` tells which Debian packages are missing."""
    return _skipped_unless(bool(shutil.which(command)), package)


def _skipped_unless(there: bool, package: str) -> Any:
    return pytest.mark.skipif(not there, reason=f"needs the Debian package {package}")


needs_compiler = _skipped_unless(
    bool(COMPILERS and shutil.which("cc") and shutil.which("make")), "build-essential"
)
