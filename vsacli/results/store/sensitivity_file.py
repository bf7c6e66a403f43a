"""Reading of sensitivity files, which have the layout of result files."""

from __future__ import annotations

from vsacli.base import file_formats
from vsacli.results.store.reader import StoredResult


class StoredSensitivity(StoredResult):
    """An open sensitivity file; a context manager that closes it."""

    format = file_formats.SENSITIVITY
    kind = "sensitivity"
    command = "sensitivity"
    _run_attributes = ()
    _how_to_store = "run sensitivity again"
