"""Makefile and README of generated code."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.control.codegen.interface import Function
from vsacli.control.codegen.scalar import signature
from vsacli.control.codegen.self_test import TOLERANCE
from vsacli.robot.model import Robot

_MAKEFILE = """CFLAGS ?= -std=c99 -O2 -Wall -Wextra -pedantic

{prefix}.o: {prefix}.c {prefix}.h
	$(CC) $(CFLAGS) -c {prefix}.c

{prefix}_test: {prefix}_test.c {prefix}.o
	$(CC) $(CFLAGS) {prefix}_test.c {prefix}.o -o {prefix}_test -lm

.PHONY: test clean
test: {prefix}_test
	./{prefix}_test

clean:
	rm -f {prefix}.o {prefix}_test
"""

_README = """# {name} in C

`{prefix}.c` and `{prefix}.h` are C99 and need nothing but math.h. The functions allocate nothing, keep
nothing between calls, never print, and always end after a bounded number of operations; several threads may
call them at once.

    make test

compiles `{prefix}_test.c` and compares the functions with what vsacli computes by NumPy, within
{tolerance:g} of the largest value of each array.

## Functions

{functions}

The structures are in `{prefix}.h`, each member with its unit. Joints are numbered from the base: {joints}.
{omitted}
## In a control loop

Call the function once per period, e.g. each millisecond, and look at what it returns before the torques go
out: where a bit says that a joint's step is infeasible or singular, its torques are NaN.

```c
#include "{prefix}.h"

void every_millisecond(const {prefix}_command *command)
{{
    {prefix}_drive drive;
    const unsigned flags = {prefix}_inverse_dynamics(command, &drive);
    if (flags & ({upper}_INFEASIBLE | {upper}_SINGULAR)) {{
        brake(); /* there is no such torque: drive.flags[joint] says at which joint, and why */
        return;
    }}
    for (int joint = 0; joint < {upper}_JOINTS; joint++)
        send(joint, drive.tau_motor[joint][0], drive.tau_motor[joint][1]);
}}
```

The command must be smooth: four derivatives of the position and two of the stiffness, all of the same
motion. Torques are those of the joint side of the gears. Do not compile with -ffast-math or
-ffinite-math-only: NaN would go unnoticed.
"""


def makefile_text(prefix: str) -> str:
    """Compiles the code, and runs its self-test."""
    return _MAKEFILE.format(prefix=prefix)


def readme_text(
    prefix: str, robot: Robot, functions: Sequence[Function], precision: str, omitted: Sequence[str]
) -> str:
    """How to use the code."""
    return _README.format(
        name=robot.name,
        prefix=prefix,
        upper=prefix.upper(),
        tolerance=TOLERANCE[precision],
        functions="\n".join(
            f"- `{signature(prefix, function)}`: {function.meaning}" for function in functions
        ),
        joints=", ".join(f"{index} {name}" for index, name in enumerate(robot.joint_names)),
        omitted="".join(f"There is {reason}.\n" for reason in omitted),
    )
