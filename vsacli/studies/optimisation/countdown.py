"""Progress of searches whose number is not known before."""

from __future__ import annotations

from collections.abc import Callable

SEARCHES = 10
"""Searches of a joint: a constant, some starts, finer and finer splines; not all of them may be needed."""


class Countdown:
    """Tells of searches as they are done, of `SEARCHES` in all whatever their number."""

    def __init__(self, progress: Callable[[int], object]) -> None:
        self._progress, self._left = progress, SEARCHES

    def count(self) -> None:
        """One is done."""
        if self._left:
            self._left -= 1
            self._progress(1)

    def finish(self) -> None:
        """All are."""
        self._progress(self._left)
        self._left = 0
