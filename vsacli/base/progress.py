"""How long work shows its progress and passes sentences to the user, if anybody listens."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeAlias


class Bar(Protocol):
    """What steps are counted on, as those of click and tqdm."""

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
    """Return a bar for work of so many steps that nobody watches."""
    del steps
    return nullcontext(NoBar())


Tell: TypeAlias = Callable[[str], object]
"""Receives a sentence for the user."""


def unheard(_sentence: str) -> None:
    """Drop the sentence: nobody listens."""
