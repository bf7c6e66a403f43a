"""Interfaces for progress bars and notes to the user, with silent defaults."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeAlias


class Bar(Protocol):
    """A counter of steps, as the progress bars of click and tqdm are."""

    def update(self, steps: int, /) -> object:
        """Count steps that are done."""


Progress: TypeAlias = Callable[[int], AbstractContextManager[Bar]]
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


def unseen(steps: int) -> AbstractContextManager[NoBar]:
    """Return a bar that is not shown, for any number of steps."""
    del steps
    return nullcontext(NoBar())


Tell: TypeAlias = Callable[[str], object]
"""Callable that receives a sentence for the user."""


def unheard(_sentence: str) -> None:
    """Discard the sentence."""
