"""What a page says of a file in words: how it was made, and what it was made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from vsacli.base.texts import one_line
from vsacli.results.pages.document import LARGEST_SHOWN, InputText
from vsacli.results.store.inputs import StoredInput


def provenance_rows(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Pairs of a word and what it says of how a file was made; inputs are left out."""
    rows = []
    for name, value in provenance.items():
        if name != "inputs" and value not in ("", {}):
            text = value if isinstance(value, str) else json.dumps(value)
            rows.append((name.replace("_", " "), text))
    changed = {each["path"]: each["changes"] for each in provenance["inputs"] if "changes" in each}
    return rows + [(f"--set of {path}", json.dumps(changes)) for path, changes in changed.items()]


def input_text(file: StoredInput) -> InputText:
    """An input as a page shows it."""
    text = None if file.content is None else file.content.decode("utf-8", "backslashreplace")
    if text is not None:
        text = None if len(text) > LARGEST_SHOWN else "\n".join(map(one_line, text.splitlines()))
    return InputText(one_line(file.path), file.sha256, text)
