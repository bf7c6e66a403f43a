"""Interfaces for progress bars and notes to the user, with silent defaults."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeAlias


class ProgressBar(Protocol):
    """A counter of steps, as the progress bars of click and tqdm are."""

    def update(self, steps: int, /) -> object:
        """Count steps that are done."""


Progress: TypeAlias = Callable[[int], AbstractContextManager[ProgressBar]]
"""Callable that gets the number of steps before work begins; returns a context manager of a bar."""


class NoBar:
    """A bar that is not shown.

    Attributes:
        pos: steps counted so far.
    """

    pos = 0

    def update(self, steps: int, /) -> None:
        """Count steps that are done."""
        self.pos += steps


class Countdown:
    """A counter of an expected number of steps, of which there may be fewer or more.

    Args:
        progress: function to call with the number of further steps.
        steps: number of steps that it is told in all.
    """

    def __init__(self, progress: Callable[[int], object], steps: int) -> None:
        self._progress, self._left = progress, steps

    def count(self) -> None:
        """Report one step."""
        if self._left:
            self._left -= 1
            self._progress(1)

    def finish(self) -> None:
        """Report the steps that were not needed, if any."""
        if self._left:
            self._progress(self._left)
            self._left = 0


def unseen(steps: int) -> AbstractContextManager[NoBar]:
    """Return a bar that is not shown, for any number of steps."""
    del steps
    return nullcontext(NoBar())


Tell: TypeAlias = Callable[[str], object]
"""Callable that receives a sentence for the user."""


def unheard(_sentence: str) -> None:
    """Discard the sentence."""
