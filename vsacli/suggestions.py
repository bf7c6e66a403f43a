"""The nearest valid word for a mistyped one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(word: str, valid: Iterable[str]) -> str | None:
    """The valid word that is most like this one, or None if none is close."""
    return next(iter(difflib.get_close_matches(word, list(valid), n=1, cutoff=0.6)), None)


def did_you_mean(word: str, valid: Iterable[str]) -> str:
    """A clause to append to an error: `; did you mean 'x'?`, or the list of what is valid."""
    options = list(valid)
    near = nearest(word, options)
    if near is not None:
        return f"; did you mean {near!r}?"
    return f"; valid: {', '.join(options)}" if len(options) <= 40 else ""
