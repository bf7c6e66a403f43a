"""Reading of sensitivity files, which have the layout of result files."""

from __future__ import annotations

from vsacli.results.store.reader import StoredResult
from vsacli.results.store.schema import SENSITIVITY


class StoredSensitivity(StoredResult):
    """An open sensitivity file; a context manager that closes it."""

    format = SENSITIVITY
    kind = "sensitivity"
    command = "sensitivity"
    _of_runs = ()
    _to_get = "run sensitivity again"
