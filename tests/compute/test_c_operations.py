"""Every operation written as C, for single samples and for lanes of them, against NumPy."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.generated_code import compile_c, compiled
from samples.marks import COMPILERS, needs_compiler, slow
from samples.traced_functions import CONTROL_FLOW, ELEMENTWISE, operands

from vsacli.compute.engine.compiler import Library
from vsacli.compute.engine.engines import kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.control.codegen.interface import Array, Function, Structure
from vsacli.control.codegen.texts import DIGEST

pytestmark = needs_compiler

UNITS = 4
"""In the last place: what libm, its vector functions and NumPy's vector functions promise."""

EXACT = ("operators", "add", "subtract", "multiply", "divide", "sqrt", "small powers", "negative", "absolute")
"""Rounded as the norm of floating-point arithmetic says."""

LEAST = float(np.finfo(np.float64).tiny)
"""Of numbers with all their digits."""

PROCESSORS = ("native", slow("x86-64"), slow("x86-64-v3")) if platform.machine() == "x86_64" else ("native",)
"""Registers of different widths, and a processor for which there are no vector functions."""


def as_number(name: str, x: Any, y: Any) -> Any:
    """An operation, truth values as 1 and 0."""
    value, of_ones = (ELEMENTWISE[name](*rows) for rows in ((x, y), (np.ones(1), np.ones(1))))
    return np.where(value, 1.0, 0.0) if of_ones.dtype == np.bool_ else value


@dataclass(frozen=True)
class Everything:
    """All operations of two values, and all loops, branches and tables, as one kernel."""

    inputs = 2
    outputs = len(ELEMENTWISE) + sum(len(np.atleast_2d(function(np.ones(1)))) for function in CONTROL_FLOW)

    def __call__(self, rows: Sequence[Any]) -> list[Any]:
        x, y = rows
        values = [as_number(name, x, y) for name in ELEMENTWISE]
        for function in CONTROL_FLOW:
            results = function(x)
            values += results if isinstance(results, list) else [results]
        return values


def subnormal(row: np.ndarray) -> np.ndarray:
    """Where lanes are not to be judged: these are zero to them, but not to all functions of math.h."""
    return (row != 0) & (np.abs(row) < LEAST)


def wrong(found: np.ndarray, x: np.ndarray, y: np.ndarray, least: float = 0) -> list[str]:
    """Operations whose results are not NumPy's, with where; what is below the least counts as zero."""
    names = [*ELEMENTWISE, *["nested"] * Everything.outputs]
    with np.errstate(all="ignore"):
        expected = [np.asarray(value, dtype=float) for value in Everything()([x, y])]
        return [
            f"{name} at {x[off][0]}, {y[off][0]}: {row[off][0]}, not {right[off][0]}"
            for name, row, right in zip(names, found, expected, strict=False)
            if (off := ~close(row, right, 0 if name in EXACT else UNITS, least)).any()
        ]


def close(found: np.ndarray, expected: np.ndarray, units: int, least: float) -> np.ndarray:
    alike = (found == expected) | (np.isnan(found) & np.isnan(expected))
    return alike | (np.abs(found - expected) <= np.maximum(units * np.spacing(np.abs(expected)), least))


def test_of_single_samples(tmp_path: Path) -> None:
    values = Structure("values", "", (Array("x", (2,), ""),))
    results = Structure("results", "", (Array("y", (Everything.outputs,), ""),))
    function = Function("all", "", (("values", values),), results, Everything())
    header = (
        f"#define EACH_DIGEST {DIGEST}\n"
        "typedef struct { double x[2]; } each_values;\n"
        f"typedef struct {{ double y[{Everything.outputs}]; }} each_results;\n"
        "unsigned each_all(const each_values *values, each_results *results);\n"
    )
    x, y = operands()
    found, _ = compiled(tmp_path, "each", header, [function], "double")(
        function, {"x": np.column_stack([x, y])}
    )
    assert wrong(found["y"].T, x, y) == []


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("processor", PROCESSORS)
def test_of_lanes(compiler: str, processor: str, tmp_path: Path) -> None:
    (tmp_path / "lanes.c").write_text(batch_source(kernel_program(Everything())))
    machine = ["-std=gnu11", "-O1", "-fno-math-errno", "-fPIC", "-shared", f"-march={processor}"]
    compile_c(tmp_path, *machine, "lanes.c", "-o", "lanes.so", "-lm", compiler=compiler)
    library = Library(tmp_path / "lanes.so", Everything.outputs)
    pairs = operands()
    x, y = (row[~(subnormal(pairs[0]) | subnormal(pairs[1]))] for row in pairs)
    assert wrong(library([x, y], 1), x, y, LEAST) == []
