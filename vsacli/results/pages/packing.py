"""Numbers for the scripts of a page: arrays in base64, everything else as JSON."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vsacli.base.json_records import json_value


class Packed:
    """Arrays that a page holds, each once and known by its number.

    Single precision is what can be seen: a screen shows four digits of a curve, a cursor six.
    """

    def __init__(self) -> None:
        self._numbers: dict[bytes, int] = {}

    def add(self, values: ArrayLike) -> int:
        """The number of an array, of any shape; what is not finite, or too large, becomes NaN."""
        with np.errstate(over="ignore"):
            single = np.asarray(values, dtype="<f4")
        content = np.where(np.isfinite(single), single, np.float32(np.nan)).astype("<f4").tobytes()
        return self._numbers.setdefault(content, len(self._numbers))

    @property
    def texts(self) -> list[str]:
        """The arrays in base64, by number."""
        return [base64.b64encode(content).decode("ascii") for content in self._numbers]


def as_script(content: Any) -> str:
    """JSON values for an element `script`, which nothing in them can end."""
    text = json.dumps(json_value(content), separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
