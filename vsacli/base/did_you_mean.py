"""The nearest valid word for a mistyped one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(word: str, valid: Iterable[str]) -> str | None:
    """The valid word that is most like this one or alone begins with it, or None if none is close."""
    options = list(valid)
    longer = [option for option in options if option.startswith(word)]
    close = difflib.get_close_matches(word, options, n=1, cutoff=0.6) or (longer if word else [])
    return close[0] if len(close) == 1 else None


def did_you_mean(word: str, valid: Iterable[str]) -> str:
    """A clause to append to an error: `; did you mean 'x'?`, or the list of what is valid."""
    options = list(valid)
    near = nearest(word, options)
    if near is not None:
        return f"; did you mean {near!r}?"
    return f"; valid: {', '.join(options)}" if len(options) <= 40 else ""
