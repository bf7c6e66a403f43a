"""Instructions that calls of generated inverse dynamics take on a Cortex-M7."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samples.cortex_m7 import link, run
from vsacli.base.arrays import FloatArray

REPEATS = 100
COUNTING = ("-icount", "shift=0")
"""A nanosecond of the board's time for each instruction."""

A_TICK = 40
"""Instructions: the timer counts at 25 MHz, so that many calls are counted together."""

PROGRAM = """
#include <stdio.h>
#include "{prefix}.h"
#define SYSTICK ((volatile unsigned *)0xE000E010u) /* control, reload, and what it counts down */
static const {prefix}_command commands[] = {{
{commands}
}};
int main(void)
{{
    {prefix}_drive drive;
    SYSTICK[1] = 0xFFFFFFu;
    for (unsigned n = 0; n < sizeof commands / sizeof commands[0]; n++) {{
        SYSTICK[2] = 0;
        SYSTICK[0] = 5;
        for (int k = 0; k < {repeats}; k++)
            {prefix}_inverse_dynamics(&commands[n], &drive);
        printf("%u\\n", 0xFFFFFFu - SYSTICK[2]);
        SYSTICK[0] = 0;
    }}
    return 0;
}}
"""


def instructions(folder: Path, prefix: str, commands: FloatArray) -> FloatArray:
    """Of a call for each command, (commands,).

    Args:
        folder: with the header, and the object file for the processor.
        prefix: of their names.
        commands: (commands, signals, joints).
    """
    rows = [np.array2string(row, separator=",", threshold=row.size) for row in commands]
    written = ",\n".join(row.replace("[", "{").replace("]", "}") for row in rows)
    program = PROGRAM.format(prefix=prefix, commands=written, repeats=REPEATS)
    (folder / "counter.c").write_text(program)
    found = run(link(folder, "-O2", "counter.c", f"{prefix}.o"), *COUNTING)
    return np.array(found.stdout.split(), dtype=float) * A_TICK / REPEATS
