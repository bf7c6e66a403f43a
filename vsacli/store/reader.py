"""Reading a result file."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py

from vsacli.arrays import FlagArray, FloatArray
from vsacli.errors import InputError, StorageError
from vsacli.store.schema import FORMAT
from vsacli.variables import VARIABLES, Variable, select_variables

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class StoredResult:
    """An open result file; a context manager that closes it. A subclass reads another format.

    Attributes:
        path: the file, as given.
        attributes: the root attributes, e.g. `created`, `command_line`, `versions`.
        robot_name, trajectory_name, verdict: as in the report.
        complete: False if the run was ended at an infeasible step.
        joint_names, joint_types: base to tip; "revolute" or "prismatic".
        actuators: of each joint, "antagonistic", "elastic" or "rigid".
        variables: names of the variables the file holds, in declared order, without `time`.
        samples: number of steps stored.
        time: (samples,) in s.
        report: the report of the run, as in `--json`.
    """

    format = FORMAT
    declared: Mapping[str, Variable] = VARIABLES

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a file.

        Raises:
            InputError: there is no such file, or it is not a complete file of the format this version reads.
            StorageError: the operating system refuses to read it, or another program is writing it.
        """
        _check_signature(path)
        with contextlib.ExitStack() as stack:
            with _reporting_damage(path):
                file = stack.enter_context(h5py.File(path, "r"))
                found = file.attrs.get("format")
            if found != cls.format:
                raise InputError.one(_foreign(found, cls.format), path)
            result = cls(path, file)
            stack.pop_all()
        return result

    def __init__(self, path: str | Path, file: h5py.File) -> None:
        self.path = Path(path)
        self._file = file
        with _reporting_damage(path):
            self.attributes: dict[str, Any] = dict(file.attrs)
            self.robot_name = str(file.attrs["robot_name"])
            self.trajectory_name = str(file.attrs["trajectory_name"])
            self.verdict = str(file.attrs["verdict"])
            self.complete = bool(file.attrs["complete"])
            self.joint_names: tuple[str, ...] = tuple(file["joint"].asstr()[...])
            self.joint_types: tuple[str, ...] = tuple(file["joint_type"].asstr()[...])
            kinds = file["inputs/robot/joints/actuator_type"]
            self.actuators: tuple[str, ...] = tuple(kinds.asstr()[...])
            self.variables = tuple(
                name for name, variable in self.declared.items() if variable.dims and name in file
            )
            self.time: FloatArray = file["time"][...]
            self.samples = len(self.time)
            self.report: dict[str, Any] = json.loads(file["report/json"].asstr()[()])

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray | FlagArray:
        """Steps start..stop-1 of a variable, (steps, joints) or (steps, joints, 2), in its declared units.

        Raises:
            InputError: there is no such variable, the file does not hold it, or the file is damaged.
        """
        select_variables([name], self.declared)
        if name not in self._file:
            message = f"holds no {name}; run invdyn again without --variables, or with {name} among them"
            raise InputError.one(message, self.path)
        with _reporting_damage(self.path):
            values: FloatArray | FlagArray = self._file[name][start:stop]
        return values

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def open_result(path: str | Path) -> StoredResult:
    """Open a result file of `invdyn`; see `StoredResult.open`."""
    return StoredResult.open(path)


def _check_signature(path: str | Path) -> None:
    """Tell a missing file, a folder and a file of another kind from each other before HDF5 sees them."""
    try:
        with Path(path).open("rb") as file:
            start = file.read(len(_SIGNATURE))
    except FileNotFoundError:
        raise InputError.one(
            "there is no such file; expected a result file, as invdyn writes it", path
        ) from None
    except IsADirectoryError:
        raise InputError.one("is a folder; expected a result file, as invdyn writes it", path) from None
    except OSError as error:
        raise StorageError(path, f"cannot be read: {error.strerror}") from error
    if start != _SIGNATURE:
        kind = "is empty" if not start else "is not an HDF5 file"
        raise InputError.one(f"{kind}; expected a result file, as invdyn writes it", path)


def _foreign(found: object, expected: str) -> str:
    if not isinstance(found, str) or not found.startswith("vsacli-"):
        return f"is an HDF5 file, but no result file: it has no attribute format = {expected!r}"
    if found.partition("/")[0] != expected.partition("/")[0]:
        return f"has the format {found}, but expected is a file of the format {expected}"
    return f"has the format {found}, but this version reads {expected}; run invdyn again"


@contextlib.contextmanager
def _reporting_damage(path: str | Path) -> Iterator[None]:
    """HDF5 reports truncation and corruption by any of these exceptions."""
    try:
        yield
    except BlockingIOError as error:
        raise StorageError(path, "cannot be read: another program has it open for writing") from error
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError) as error:
        raise InputError.one(f"is damaged or truncated ({error}); run invdyn again", path) from error
