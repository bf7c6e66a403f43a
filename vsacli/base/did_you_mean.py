"""The nearest valid word for a mistyped one."""

from __future__ import annotations

from collections.abc import Iterable

from vsacli.base.renamed import now_called

MOST_NEAR = 3
"""Maximum number of proposals; a longer list of words with the same beginning is no help."""


def nearest(word: str, valid: Iterable[str]) -> str | None:
    """Return the most similar valid word, or the only one with this beginning; None if none is close."""
    close = _near(word, list(valid))
    return close[0] if len(close) == 1 else None


def did_you_mean(word: str, valid: Iterable[str]) -> str:
    """Return a clause to append to an error: `; it is now 'x'`, `; did you mean 'x'?`, or all valid words."""
    options = list(valid)
    if hint := now_called(word, options):
        return hint
    if 0 < len(near := _near(word, options)) <= MOST_NEAR:
        return f"; did you mean {' or '.join(map(repr, near))}?"
    return f"; valid: {', '.join(options)}" if len(options) <= 40 else ""


def _near(word: str, options: list[str]) -> list[str]:
    """Return the most similar word, or else all words that begin with this one."""
    import difflib  # loaded for error messages only

    close = difflib.get_close_matches(word, options, n=1, cutoff=0.6)
    return close or [option for option in options if word and option.startswith(word)]
