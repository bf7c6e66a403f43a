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


def slow_but(quick: Collection[Any], cases: Iterable[Any], most: int | None = None) -> list[Any]:
    """All cases, of which only some are quick.

    Of the others `most` are slow, spread over them, and the rest exhaustive; without `most` all are slow.
    """
    whole = list(cases)
    assert set(quick) <= set(whole)
    rest = [case for case in whole if case not in quick]
    count = len(rest) if most is None else min(most, len(rest))
    chosen = [rest[place * len(rest) // count] for place in range(count)]
    exhaustive = [pytest.mark.slow, pytest.mark.exhaustive]
    return [
        case if case in quick else slow(case) if case in chosen else pytest.param(case, marks=exhaustive)
        for case in whole
    ]


def needs(command: str, package: str) -> Any:
    """A test that is skipped without a command; `.ci/run` tells which Debian packages are missing."""
    return _skipped_unless(bool(shutil.which(command)), package)


def _skipped_unless(there: bool, package: str) -> Any:
    return pytest.mark.skipif(not there, reason=f"needs the Debian package {package}")


needs_compiler = _skipped_unless(
    bool(COMPILERS and shutil.which("cc") and shutil.which("make")), "build-essential"
)
