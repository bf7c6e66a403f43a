"""Generated C code, compiled and called from Python."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from samples.marks import COMPILERS
from vsacli.base.arrays import FloatArray
from vsacli.control.codegen.interface import Array, Function, Structure
from vsacli.control.codegen.project import Project, prefix_of
from vsacli.control.codegen.scalar import source_text
from vsacli.robot.model import Robot

STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
"""Every warning is an error."""

Values = dict[str, Any]


def compile_c(folder: Path, *arguments: str, compiler: str = COMPILERS[0] if COMPILERS else "cc") -> None:
    """Run a compiler in a folder; what it says is the failure's message."""
    done = subprocess.run(
        [compiler, *arguments], cwd=folder, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr


def write_files(project: Project, folder: Path) -> None:
    for name, text in project.files.items():
        (folder / name).write_text(text, encoding="utf-8")


class Compiled:
    """Functions of a header and source, loaded.

    Args:
        folder: where both are.
        prefix: of their names.
        precision: of their numbers.
    """

    def __init__(self, folder: Path, prefix: str, precision: str = "double") -> None:
        compile_c(folder, *STRICT, "-fPIC", "-shared", f"{prefix}.c", "-o", f"{prefix}.so", "-lm")
        self._library = ctypes.CDLL(str(folder / f"{prefix}.so"))
        self._prefix = prefix
        self._real = {"double": ctypes.c_double, "float": ctypes.c_float}[precision]

    def __call__(self, function: Function, *arguments: Mapping[str, FloatArray]) -> tuple[Values, list[int]]:
        """The arrays of the result over samples, and what the function returned for each.

        Args:
            function: its declaration.
            arguments: arrays (samples, ...) by name, for each argument.
        """
        call = getattr(self._library, f"{self._prefix}_{function.name}")
        call.restype = ctypes.c_uint
        result_type = self._struct(function.result)
        samples = len(next(iter(arguments[0].values())))
        found: dict[str, list[Any]] = {array.name: [] for array in function.result.arrays}
        returned = []
        for k in range(samples):
            given = [
                self._filled(structure, {name: values[k] for name, values in arrays.items()})
                for (_, structure), arrays in zip(function.arguments, arguments, strict=True)
            ]
            result = result_type()
            returned.append(call(*map(ctypes.byref, given), ctypes.byref(result)))
            for array in function.result.arrays:
                found[array.name].append(np.ctypeslib.as_array(getattr(result, array.name)).copy())
        return {name: np.array(values) for name, values in found.items()}, returned

    def _struct(self, structure: Structure) -> type[ctypes.Structure]:
        fields = [(array.name, self._type(array)) for array in structure.arrays]
        return type(structure.name, (ctypes.Structure,), {"_fields_": fields})

    def _type(self, array: Array) -> Any:
        kind = ctypes.c_uint if array.bits else self._real
        for size in reversed(array.shape):
            kind = kind * size
        return kind

    def _filled(self, structure: Structure, values: Mapping[str, FloatArray]) -> ctypes.Structure:
        filled = self._struct(structure)()
        for array in structure.arrays:
            np.ctypeslib.as_array(getattr(filled, array.name))[...] = values[array.name]
        return filled


def compiled_robot(folder: Path, robot: Robot, functions: Sequence[Function], precision: str) -> Compiled:
    """Some functions of a robot, without the rest of a project."""
    from vsacli.control.codegen.header import header_text

    prefix, head = prefix_of(robot), "/* for a test */"
    folder.mkdir()
    (folder / f"{prefix}.h").write_text(header_text(prefix, robot, functions, precision, head))
    (folder / f"{prefix}.c").write_text(source_text(prefix, functions, precision, head))
    return Compiled(folder, prefix, precision)
