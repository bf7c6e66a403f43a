"""Instructions and stack that calls of generated inverse dynamics take on a Cortex-M7."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samples.cortex_m7 import link, run

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
static {prefix}_drive drive;
enum {{ PAINT = 0xA5, PAINTED = 32768, OWN = 256 }}; /* the last is for what calls */

/* Bytes below the caller that a call writes to. */
static unsigned stack_used(const {prefix}_command *command)
{{
    volatile unsigned char *const end = (volatile unsigned char *)__builtin_frame_address(0) - OWN;
    int depth;
    for (depth = 1; depth <= PAINTED; depth++)
        end[-depth] = PAINT;
    {prefix}_inverse_dynamics(command, &drive);
    while (depth > 1 && end[1 - depth] == PAINT)
        depth--;
    return (unsigned)depth - 1 + OWN;
}}

int main(void)
{{
    SYSTICK[1] = 0xFFFFFFu;
    for (unsigned n = 0; n < sizeof commands / sizeof commands[0]; n++) {{
        SYSTICK[2] = 0;
        SYSTICK[0] = 5;
        for (int k = 0; k < {repeats}; k++)
            {prefix}_inverse_dynamics(&commands[n], &drive);
        const unsigned ticks = 0xFFFFFFu - SYSTICK[2];
        SYSTICK[0] = 0;
        printf("%u %u\\n", ticks, stack_used(&commands[n]));
    }}
    return 0;
}}
"""


def taken(folder: Path, prefix: str, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Instructions, and bytes of stack, of a call for each command, (commands,).

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
    ticks, stack = np.array(found.stdout.split(), dtype=float).reshape(-1, 2).T
    return ticks * A_TICK / REPEATS, stack
