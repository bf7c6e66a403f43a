"""NumPy on what recording leaves of a kernel: repays recording it from many samples on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsacli.arrays import FloatArray
from vsacli.engine.engines import SAMPLES_PER_PASS, NumPyEngine
from vsacli.engine.kernel import Kernel, record
from vsacli.tracing.row_program import RowProgram


class RecordedEngine:
    """The operations of each kernel, recorded when it is first needed; a kernel with loops as it is.

    The numbers are those of `NumPyEngine`, to the last bit. Not for several threads at a time.
    """

    def __init__(self) -> None:
        self._programs: dict[Kernel, RowProgram | None] = {}

    def run(self, kernel: Kernel, rows: Sequence[FloatArray]) -> FloatArray:
        """As of `Engine`."""
        program = self._program(kernel)
        if program is None:
            return NumPyEngine().run(kernel, rows)
        outputs = np.empty((kernel.outputs, len(rows[0])))
        for start in range(0, outputs.shape[1], SAMPLES_PER_PASS):
            part = slice(start, start + SAMPLES_PER_PASS)
            program([row[part] for row in rows], outputs[:, part])
        return outputs

    def _program(self, kernel: Kernel) -> RowProgram | None:
        if kernel not in self._programs:
            try:
                self._programs[kernel] = RowProgram(record(kernel))
            except NotImplementedError:
                self._programs[kernel] = None
        return self._programs[kernel]
