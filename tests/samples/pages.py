"""Pages read as a browser reads them, with Python's own parser: elements, scripts, packed numbers."""

from __future__ import annotations

import base64
import json
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np


class Page(HTMLParser):
    """A page, parsed.

    Attributes:
        tags: every opening tag with its attributes.
        scripts: what runs, in order.
        text: what people read.
        data: what the scripts are given.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self.data: Any = None
        self._arrays: dict[str, str] = {}
        self._inside: list[tuple[str, dict[str, str | None]]] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        while self._inside and self._inside.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        tag, attributes = self._inside[-1] if self._inside else ("", {})
        if tag != "script":
            self.text += data if tag != "style" else ""
        elif attributes.get("type") == "application/json":
            self.data = json.loads(data)
        elif attributes.get("type") == "text/plain":
            self._arrays[str(attributes["id"])] = data
        else:
            self.scripts.append(data)

    def array(self, number: int) -> np.ndarray:
        """A packed array."""
        return np.frombuffer(base64.b64decode(self._arrays[f"array-{number}"]), dtype="<f4")

    @property
    def charts(self) -> list[dict[str, Any]]:
        """All plots."""
        return [chart for section in self.data["sections"] for chart in section["charts"]]

    def chart(self, name: str, words: str = "") -> dict[str, Any]:
        """The one plot of a variable whose title has these words."""
        [found] = [each for each in self.charts if each["name"] == name and words in each["title"]]
        return found
