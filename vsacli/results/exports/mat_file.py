"""Results as MATLAB files of version 5, which MATLAB, Octave and SciPy read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import IO, Any, cast

import numpy as np

from vsacli.base.errors import InputError
from vsacli.results.exports.result_format import ResultFormat
from vsacli.results.exports.selection import Chosen, Selection

MAX_VARIABLE_BYTES = 2**31 - 2**16
"""The format counts the bytes of a variable in 32 bits, of which readers take 31; less what stands before."""


def write_mat(selection: Selection, stream: IO[bytes], done: Callable[[int], object]) -> None:
    """Write `time`, each variable (samples, joints[, 2]), and what says what they are.

    A variable is read when its turn comes, so that no more than one is in memory.
    """
    from scipy.io import savemat

    savemat(cast("Any", stream), _Variables(selection, done), oned_as="column", long_field_names=True)


def check_sizes(selection: Selection) -> None:
    """Refuse a variable that is too large for the format."""
    for chosen in selection.chosen:
        size = len(selection.time) * chosen.there.size * np.dtype(np.float64).itemsize
        if size > MAX_VARIABLE_BYTES:
            reason = (
                f"{chosen.name} has {size:,} bytes, and a variable of a MATLAB file of version 5 must stay "
                "below 2 GB; take a lower --rate, or read the result itself, whose variables h5read gives"
            )
            raise InputError.one(reason, selection.result.path)


class _Variables(Mapping[str, Any]):
    """The variables of the file by name, each made when it is asked for."""

    def __init__(self, selection: Selection, done: Callable[[int], object]) -> None:
        self._made: dict[str, Callable[[], Any]] = {
            "joint_names": lambda: _cell_array(selection.result.joint_names),
            "joint_types": lambda: _cell_array(selection.result.joint_types),
            "units": lambda: _units(selection),
            "time": lambda: selection.time,
            **{each.name: _reading(selection, each, done) for each in selection.chosen},
        }

    def __getitem__(self, name: str) -> Any:
        return self._made[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._made)

    def __len__(self) -> int:
        return len(self._made)


def _reading(selection: Selection, chosen: Chosen, done: Callable[[int], object]) -> Callable[[], Any]:
    def read() -> Any:
        values = selection.read(chosen, 0, len(selection.time))
        done(len(values))
        return values

    return read


def _cell_array(texts: Sequence[str]) -> Any:
    """A column of texts, which MATLAB indexes by braces."""
    return np.array(texts, dtype=object)[:, None]


def _units(selection: Selection) -> dict[str, Any]:
    """The units of each variable by name: one for each joint, or axis of the wrench."""
    types = selection.result.joint_types
    units = {each.name: _cell_array(each.units(types)) for each in selection.chosen}
    return {"time": "s", **units}


MAT = ResultFormat(write_mat, binary=True, missing="NaN", check=check_sizes)
