"""Generated C code, compiled and called from Python."""

from __future__ import annotations

import importlib.util
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from samples.marks import COMPILERS
from vsacli import Robot
from vsacli.control.codegen.interface import Function
from vsacli.control.codegen.project import Project, prefix_of
from vsacli.control.codegen.texts import binding_text, filled, header_text, source_text

STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
"""Every warning is an error."""

ABOUT = "For a test."

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
    """Functions of generated code, loaded by the Python module beside them.

    Args:
        folder: where the files are.
        prefix: of their names.
    """

    def __init__(self, folder: Path, prefix: str) -> None:
        flags = f"CFLAGS={' '.join(STRICT)}"
        make = ["make", "--silent", f"CC={COMPILERS[0]}", flags, f"lib{prefix}.so"]
        done = subprocess.run(make, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
        assert done.returncode == 0, done.stderr
        spec = importlib.util.spec_from_file_location(prefix, folder / f"{prefix}.py")
        assert spec is not None
        assert spec.loader is not None
        self.module: Any = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.module)

    def __call__(
        self, function: Function, *arguments: Mapping[str, np.ndarray] | float
    ) -> tuple[Values, list[int]]:
        """The arrays of the result over samples, and what the function returned for each.

        Args:
            function: its declaration.
            arguments: arrays (samples, ...) by name, for each argument; a number for one passed by value.
        """
        given: list[Any] = []
        for (_, structure), arrays in zip(function.arguments, arguments, strict=True):
            if not isinstance(arrays, Mapping):
                given.append(arrays)
                continue
            samples = len(next(iter(arrays.values())))
            records = np.zeros(samples, getattr(self.module, structure.name.capitalize()))
            for array in structure.arrays:
                records[array.name] = arrays[array.name]
            given.append(records)
        found, returned = getattr(self.module, function.name)(*given)
        return {array.name: found[array.name] for array in function.result.arrays}, returned.tolist()


def compiled(
    folder: Path, prefix: str, header: str, functions: Sequence[Function], precision: str
) -> Compiled:
    """Functions that a header declares, compiled in a folder."""
    files = {
        f"{prefix}.h": header,
        f"{prefix}.c": source_text(prefix, functions, precision, ABOUT),
        f"{prefix}.py": binding_text(prefix, functions, precision, ABOUT),
        "Makefile": filled("Makefile", prefix),
    }
    write_files(Project(files, [], ()), folder)
    return Compiled(folder, prefix)


def compiled_robot(folder: Path, robot: Robot, functions: Sequence[Function], precision: str) -> Compiled:
    """Some functions of a robot, without the rest of a project."""
    prefix = prefix_of(robot)
    folder.mkdir()
    header = header_text(prefix, robot, functions, precision, ABOUT)
    return compiled(folder, prefix, header, functions, precision)
