"""The nearest valid word for a mistyped one."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from vsacli.base.texts import joined

MOST_NEAR = 3
"""Maximum number of proposals; a longer list of words with the same beginning is no help."""

FILE_CUTOFF = 0.75
"""Similarity of stems from which a file is proposed: `vsa_3r` for `vsa_3`, but not for `abb_6r`."""


def nearest(word: str, valid: Iterable[str]) -> str | None:
    """Return the most similar valid word, or the only one with this beginning; None if none is close."""
    close = _near(word, list(valid))
    return close[0] if len(close) == 1 else None


def did_you_mean(word: str, valid: Iterable[str]) -> str:
    """Return a clause to append to an error: `; it is now 'x'`, `; did you mean 'x'?`, or all valid words."""
    from vsacli.base.renamed import now_called  # loaded for error messages only

    options = list(valid)
    if hint := now_called(word, options):
        return hint
    if 0 < len(near := _near(word, options)) <= MOST_NEAR:
        return f"; did you mean {joined(map(repr, near), 'or')}?"
    return f"; valid: {', '.join(options)}" if len(options) <= 40 else ""


def near_file(path: Path) -> str:
    """Return a clause that proposes an existing file for a missing one; empty if none is close.

    Stems are compared, of files with the same ending, without regard to case; of a missing folder its name.
    """
    if not path.parent.is_dir():
        folder = _similar(path.parent)
        if folder is None:
            return f"; there is no folder {str(path.parent)!r} either"
        return _proposal(folder / path.name)
    near = _similar(path)
    return "" if near is None else _proposal(near)


def _proposal(path: Path) -> str:
    return f"; did you mean {str(path)!r}?"


def _similar(missing: Path) -> Path | None:
    """Return the entry of the same folder with the most similar name; None if none is close."""
    import difflib  # loaded for error messages only

    if not missing.parent.is_dir():
        return None
    stems = {
        entry.stem.lower(): entry
        for entry in missing.parent.iterdir()
        if entry.suffix.lower() == missing.suffix.lower()
    }
    close = difflib.get_close_matches(missing.stem.lower(), stems, n=1, cutoff=FILE_CUTOFF)
    return missing.parent / stems[close[0]].name if close else None


def _near(word: str, options: list[str]) -> list[str]:
    """Return the word itself, or the few words that begin with it, or else the most similar word."""
    import difflib  # loaded for error messages only

    if word in options:
        return [word]
    longer = [option for option in options if word and option.startswith(word)]
    if 0 < len(longer) <= MOST_NEAR:
        return longer
    return difflib.get_close_matches(word, options, n=1, cutoff=0.6) or longer
