"""Receivers of progress and of sentences for the user, with silent ones as defaults."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeAlias


class Bar(Protocol):
    """A counter of steps, as the progress bars of click and tqdm are."""

    def update(self, steps: int, /) -> object:
        """Count steps that are done."""


Progress: TypeAlias = Callable[[int], AbstractContextManager[Bar]]
"""Called with the number of steps before work begins: a bar for as long as it lasts."""


class NoBar:
    """A bar that nobody sees.

    Attributes:
        pos: steps counted so far.
    """

    pos = 0

    def update(self, steps: int, /) -> None:
        """Count steps that are done."""
        self.pos += steps


def unseen(steps: int) -> AbstractContextManager[NoBar]:
    """Return a bar for work of this many steps that nobody watches."""
    del steps
    return nullcontext(NoBar())


Tell: TypeAlias = Callable[[str], object]
"""Receives a sentence for the user."""


def unheard(_sentence: str) -> None:
    """Drop the sentence: nobody listens."""
