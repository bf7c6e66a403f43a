"""NumPy on what recording leaves of a kernel: repays recording it from many samples on."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.engine.engines import NumPyEngine, passes, samples_per_pass
from vsacli.compute.engine.kernel import Kernel, record
from vsacli.compute.tracing.row_program import RowProgram, Scratch

KEPT = 8
"""Programs that are kept for the next call."""


class RecordedEngine:
    """The operations of each kernel, recorded when it is first needed; a kernel with loops as it is.

    The numbers are those of `NumPyEngine`, to the last bit but for powers: exponents of 3, 4 and 1.5 are
    recorded as products. Not for several threads at a time.
    """

    def __init__(self) -> None:
        self._scratch: dict[RowProgram, Scratch] = {}

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        program = row_program(kernel)
        if program is None:
            return NumPyEngine().run(kernel, rows)
        if program not in self._scratch:
            self._scratch[program] = program.scratch(samples_per_pass(len(rows)))
        outputs = np.empty((kernel.outputs, len(rows[0])))
        for part in passes(rows):
            program([row[part] for row in rows], outputs[:, part], self._scratch[program])
        return outputs


@lru_cache(maxsize=KEPT)
def row_program(kernel: Kernel) -> RowProgram | None:
    """The program of a kernel; None if it has loops or tables."""
    try:
        return RowProgram(record(kernel))
    except NotImplementedError:
        return None
