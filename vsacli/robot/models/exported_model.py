"""What an export of a robot gives."""

from __future__ import annotations

from typing import NamedTuple


class ExportedModel(NamedTuple):
    """A robot in the words of another program.

    Attributes:
        text: the model.
        forces: text of a Python file with the forces that the model has no place for; None if there are none.
        notes: what it leaves out, sentences.
    """

    text: str
    forces: str | None
    notes: tuple[str, ...]
