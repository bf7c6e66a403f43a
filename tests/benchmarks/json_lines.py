"""Files of JSON lines to which long benchmarks add, so that they go on where they were ended."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np


def read(path: Path) -> list[Any]:
    """Return what the lines hold; nothing if there is no file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def add(path: Path, items: Iterable[object]) -> None:
    """Add a line for each item, all of them at once."""
    with path.open("a") as file:
        file.writelines([json.dumps(item, default=np.ndarray.item) + "\n" for item in items])
