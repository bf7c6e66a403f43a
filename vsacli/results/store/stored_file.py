"""What open HDF5 files of this tool have in common, whatever is in them."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import h5py

from vsacli.base.texts import one_line
from vsacli.results.store.damage import CheckedFile, bounded, own_dataset, reporting_damage
from vsacli.results.store.inputs import StoredInput, read_sources


class StoredFile:
    """An open file; a context manager that closes it.

    Args:
        path: of the file, as given.
        file: the same, open.

    Attributes:
        path: as given.
    """

    def __init__(self, path: str | Path, file: CheckedFile) -> None:
        self.path = Path(path)
        self._file = file
        self._checked: dict[str, h5py.Dataset] = {}

    def _dataset(self, name: str) -> h5py.Dataset:
        """A dataset, which is checked when it is first asked for."""
        if name not in self._checked:
            self._checked[name] = bounded(own_dataset(self._file, name))
        return self._checked[name]

    def _labels(self, name: str, rows: slice = slice(None)) -> tuple[str, ...]:
        return tuple(map(one_line, self._dataset(name).asstr()[rows]))

    def inputs(self) -> list[StoredInput]:
        """The files that were read, with what they held, as far as it was stored.

        Raises:
            InputError: the file is damaged.
        """
        with reporting_damage(self.path):
            return list(read_sources(self._file))

    def close(self) -> None:
        """Close the file."""
        self._checked.clear()
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
