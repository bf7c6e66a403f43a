"""Escaping of texts from files for each output format, so that they contain no control codes or markup."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

_MARKDOWN = re.compile(r"([\\`*_{}\[\]<>()#+\-!|~&$])")


MOST_LETTERS = 200
"""Maximum length of a name."""


def one_line(text: str) -> str:
    r"""Return a text in one line; control characters such as "\x1b", which can move a cursor, are escaped."""
    if text.isprintable():
        return text
    letters = (each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)
    return "".join(letters)


def as_name(text: str) -> str:
    """Return a text that was not chosen as a name, such as a file name, as a valid one."""
    return one_line(text)[:MOST_LETTERS]


def for_terminal(text: str) -> str:
    """Return a text with each line escaped by `one_line`."""
    return "\n".join(map(one_line, text.split("\n")))


def for_comment(text: str) -> str:
    """Return a text for a comment in C, free of comment delimiters."""
    return one_line(text).replace("*/", "* /").replace("/*", "/ *")


def for_yaml(text: str) -> str:
    """Return a text in double quotes for YAML, which has no surrogate pairs; escape unprintable letters."""
    quoted = json.dumps(text, ensure_ascii=False)
    return "".join(each if each.isprintable() else f"\\U{ord(each):08x}" for each in quoted)


def for_markdown(text: str) -> str:
    """Return a text for Markdown in which all markup is escaped."""
    return _MARKDOWN.sub(r"\\\1", one_line(text))


def sentence(clause: str) -> str:
    """Return a clause as a sentence, with a full stop unless it ends with a question mark."""
    return clause if clause.endswith(("?", ".")) else f"{clause}."


def on_one_line(value: Any) -> str:
    """Return a value as YAML on one line."""
    match value:
        case Mapping():
            return f"{{{', '.join(f'{key}: {on_one_line(entry)}' for key, entry in value.items())}}}"
        case list() | tuple():
            return f"[{', '.join(map(on_one_line, value))}]"
        case bool():
            return "true" if value else "false"
        case None:
            return "null"
        case float():
            return f"{value:.10g}"
    return str(value)


def counted(number: int, noun: str, several: str = "") -> str:
    """Return a number with its noun, in the plural unless it is 1; regular plurals need not be given."""
    return f"{number} {noun if number == 1 else several or noun + 's'}"


EXPONENT = 1e6
"""Absolute value from which on numbers are shown with an exponent."""


def significant(value: float, digits: int = 4, toward: float = 0.0) -> str:
    """Return a number with this many significant digits, or all those before the point.

    It is rounded to the nearest number, or toward +-infinity, except from rounding of floats.
    """
    if abs(value) < EXPONENT:
        digits = max(digits, len(f"{abs(value):.0f}"))
    if toward and math.isfinite(value):
        rounding = ROUND_CEILING if toward > 0 else ROUND_FLOOR
        value = float(Context(prec=digits, rounding=rounding).create_decimal(f"{value:.12g}"))
    return f"{value:.{digits}g}"


def distinguish(value: float, bound: float, *, safely: bool = False) -> tuple[str, str]:
    """Format two numbers with the digits that show their difference, at least four.

    Args:
        value: value.
        bound: bound.
        safely: whether the bound is rounded away from the value.
    """
    toward = bound - value if safely else 0.0
    for digits in range(4, 17):
        shown = significant(value, digits), significant(bound, digits, toward)
        if math.isclose(float(shown[0]) - float(shown[1]), value - bound, rel_tol=0.1):
            return shown
    return repr(value), repr(bound)


def joined(words: Iterable[str], conjunction: str = "and") -> str:
    """Return words joined for a sentence: `a, b and c`, or with another conjunction."""
    *others, last = words
    return f"{', '.join(others)} {conjunction} {last}" if others else last


def listed(names: Sequence[str], most: int) -> str:
    """Return names separated by commas; further ones than `most` are shown as three dots."""
    return ", ".join([*names[:most], *(["..."] if len(names) > most else [])])


def verdict_words(verdict: str) -> str:
    """Return a verdict as the first line of a report shows it."""
    return verdict.upper().replace("_", " ")


FEWEST_IN_A_ROW = 3
"""Length from which a run of consecutive names is shortened to the first and the last."""


def together(numbers: Sequence[int], names: Sequence[str]) -> str:
    """Return the names at ascending indices; a run of consecutive ones is shortened to first and last."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    words = []
    for run in runs:
        several = [names[number] for number in run]
        words += several if len(run) < FEWEST_IN_A_ROW else [f"{several[0]} to {several[-1]}"]
    return ", ".join(words)


def shown(content: Any) -> Any:
    """Return JSON values with each text in one line."""
    match content:
        case str():
            return one_line(content)
        case Mapping():
            return {one_line(str(key)): shown(value) for key, value in content.items()}
        case Sequence():
            return [shown(value) for value in content]
    return content


def warnings_and_notes(warnings: Iterable[str], notes: Iterable[str]) -> Iterator[str]:
    """Yield one line for each warning and each note, labeled."""
    yield from (f"warning: {warning}" for warning in warnings)
    yield from (f"note: {note}" for note in notes)
