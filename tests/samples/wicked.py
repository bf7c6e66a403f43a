"""Texts that would act on what reads them: a terminal, a shell, a compiler, Markdown, a spreadsheet."""

from __future__ import annotations

import json
from typing import Any

PRINTABLE = {
    "comment": '*/ int main(void){return system("id");} /*',
    "preprocessor": "arm \\ ??/ //",
    "markdown": "[a](http://b) <script>x</script> `c` **d** # e | f",
    "mathematics": "$\\frac{a}{b}$ _{",
    "spreadsheet": "=cmd|' /C calc'!A0",
    "format": "%s %n {0} {name}",
    "shell": "$(touch pwned) `touch pwned`; touch pwned & \"'",
    "option": "--overwrite",
    "parent": "..",
    "path": "../../up/and/away",
    "markup": "a&amp;<b/>\"'>]]>",
    "yaml": "a: [b, {c: *d}] # e",
    "letters": "Ärm 腕 🦾",
    "long": "x" * 200,
}
"""Names that are allowed and must do nothing."""

UNPRINTABLE = {
    "escape": "\x1b[2J\x1b[1;1Hall feasible",
    "command": "\x1b]0;title\x07",
    "return": "arm\rINFEASIBLE",
    "break": "arm\n: 4001 steps, 4 s   OK",
    "null": "a\x00b",
    "tab": "a\tb",
    "c1": "a\x9b31mb",
    "bidirectional": "a\u202eelbisaefni",
    "isolate": "a\u2066b\u2069",
    "separator": "a\u2028b",
    "zero width": "a\u200bb",
    "surrogate": "a\ud800b",
    "long": "x" * 201,
    "nothing": "",
}
"""Names that are refused in files, and shown encoded where an older result or the name of a file has them."""

TEXTS = PRINTABLE | {f"unprintable {kind}": text for kind, text in UNPRINTABLE.items()}


def clean(text: str) -> bool:
    """Whether a terminal shows every letter as a letter."""
    return all(letter.isprintable() or letter == "\n" for letter in text)


def as_yaml(content: Any) -> str:
    """JSON that is YAML, too: what cannot be printed stands as an escape, a lone surrogate also."""
    text = json.dumps(content, ensure_ascii=False)
    return "".join(each if each.isprintable() else f"\\u{ord(each):04x}" for each in text)
