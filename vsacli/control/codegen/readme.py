"""The README of the generated code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from vsacli.base.texts import for_markdown, sentence
from vsacli.control.codegen.cost import table_bytes, worst_cost
from vsacli.control.codegen.interface import Function, Structure, structures
from vsacli.control.codegen.scalar import signature
from vsacli.control.codegen.self_test import TOLERANCE
from vsacli.robot.model import Robot

_README = """# {name} in C
{warnings}
`{prefix}.c` and `{prefix}.h` are C99 and need nothing but math.h. The functions allocate nothing, keep
nothing between calls, never print, and always end after a bounded number of operations; several threads may
call them at once.

    make test

compiles `{prefix}_test.c` and compares the functions with what vsacli computes by NumPy, within
{tolerance:g} of the largest value of each array. `cmake -B build && cmake --build build && ctest
--test-dir build` does the same; another CMake project takes in the library `{prefix}` by `add_subdirectory`.
`{prefix}.py` calls the functions from Python; its first lines say how.

## Functions

{functions}

The structures are in `{prefix}.h`, each member with its unit. Joints are numbered from the base: {joints}.
{omitted}{numbers}
## What a call costs

At the very most, with every branch entered and every loop run to its bound:

| function | operations | of them functions of math.h | loops |
| --- | --- | --- | --- |
{costs}

{steps}Tables of constants take {tables} bytes. Code and stack depend on the compiler, which tells the
stack of each function; a call takes that of the functions inside, too:

    make size CC=arm-none-eabi-gcc SIZE=arm-none-eabi-size \\
        CFLAGS="-std=c99 -O2 -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard"

## In a control loop

Call the function once per period, e.g. each millisecond, and look at what it returns before the torques go
out: where a bit says that a joint's step is infeasible or singular, its torques are no numbers. NaN, infinity
and what is too large in a command, from a sensor that failed for instance, counts as infeasible.

```c
#include "{prefix}.h"

void every_millisecond({arguments})
{{
    {prefix}_drive drive;
    const unsigned flags = {prefix}_inverse_dynamics({call}, &drive);
    if (flags & ({upper}_INFEASIBLE | {upper}_SINGULAR)) {{
        brake(); /* there is no such torque: drive.flags[joint] says at which joint, and why */
        return;
    }}
    for (int joint = 0; joint < {upper}_JOINTS; joint++)
        send(joint, drive.tau_motor[joint][0], drive.tau_motor[joint][1]);
}}
```

The command must be smooth: four derivatives of the position and two of the stiffness, all of the same
motion. Torques are those of the joint side of the gears. With -ffast-math or -ffinite-math-only, under which
NaN would go unnoticed, the code does not compile.
"""


_PARAMETERS = """
## Numbers of the robot

Numbers that change from task to task, such as a payload, are an argument. A constant holds those of the robot
file, from which others are made:

    {prefix}_{structure} {structure} = {prefix}_nominal_{structure};
    {structure}.{first} = ...;

Results are those of code made of a robot file with these numbers. They are not checked: the header says of
each number what the file demands of it, and no flag tells where one breaks that. `vsacli validate` checks a
robot file with such numbers as a whole, e.g. that the inertia of a link is one that a body can have. While a
number changes, its rate has no part in the derivatives of the torques.
"""


_STEPS = "As a rule a loop ends after a handful of steps; near double solutions it takes more.\n"


def readme_text(
    prefix: str, robot: Robot, functions: Sequence[Function], precision: str, omitted: Sequence[str]
) -> str:
    """How to use the code."""
    loop = next(function for function in functions if function.name == "inverse_dynamics")
    return _README.format(
        name=for_markdown(robot.name),
        warnings="".join(f"\nWarning: {for_markdown(sentence(warning))}\n" for warning in robot.warnings),
        prefix=prefix,
        upper=prefix.upper(),
        call=", ".join(name for name, _ in loop.arguments),
        arguments=", ".join(f"const {prefix}_{each.name} *{name}" for name, each in loop.arguments),
        tolerance=TOLERANCE[precision],
        functions="\n".join(
            f"- `{' '.join(signature(prefix, function).split()).replace('( ', '(')}`: {function.meaning}"
            for function in functions
        ),
        joints=for_markdown(", ".join(f"{index} {name}" for index, name in enumerate(robot.joint_names))),
        omitted="".join(f"There is {for_markdown(sentence(reason))}\n" for reason in omitted),
        numbers="".join(_numbers(prefix, each) for each in structures(functions) if each.nominal),
        costs="\n".join(_costs(functions)),
        steps=_STEPS if any(worst_cost(function.program).loops for function in functions) else "",
        tables=table_bytes([function.program for function in functions], precision),
    )


def _numbers(prefix: str, structure: Structure) -> str:
    """What whoever calls has to know about numbers of the robot that are arguments."""
    first = next(structure.entries)
    return _PARAMETERS.format(prefix=prefix, structure=structure.name, first=first)


def _costs(functions: Sequence[Function]) -> Iterator[str]:
    """A row of the table for each function."""
    for function in functions:
        cost = worst_cost(function.program)
        yield f"| `{function.name}` | {cost.operations:,} | {cost.functions:,} | {cost.loops:,} |"
