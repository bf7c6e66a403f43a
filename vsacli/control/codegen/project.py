"""Everything that `vsacli codegen` writes: header, source, self-test, Makefile, README."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.texts import for_markdown, sentence
from vsacli.base.version import __version__
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.header import comment, header_text
from vsacli.control.codegen.interface import Function
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.codegen.scalar import DIGEST, signature, source_text
from vsacli.control.codegen.self_test import TOLERANCE, Reference, self_test_text
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
{warnings}
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
out: where a bit says that a joint's step is infeasible or singular, its torques are no numbers. NaN, infinity
and what is too large in a command, from a sensor that failed for instance, counts as infeasible.

```c
#include "{prefix}.h"

void every_millisecond({parameters})
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


def makefile_text(prefix: str) -> str:
    """Compiles the code, and runs its self-test."""
    return _MAKEFILE.format(prefix=prefix)


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
        parameters=", ".join(f"const {prefix}_{each.name} *{name}" for name, each in loop.arguments),
        tolerance=TOLERANCE[precision],
        functions="\n".join(
            f"- `{signature(prefix, function)}`: {function.meaning}" for function in functions
        ),
        joints=for_markdown(", ".join(f"{index} {name}" for index, name in enumerate(robot.joint_names))),
        omitted="".join(f"There is {for_markdown(sentence(reason))}\n" for reason in omitted),
    )


class Project(NamedTuple):
    """Generated code.

    Attributes:
        files: texts by file name.
        omitted: the functions that there are not, with the reason; a sentence each.
        warnings: what may be wrong with the robot, a sentence each; the files repeat it.
    """

    files: dict[str, str]
    omitted: list[str]
    warnings: tuple[str, ...]


def generate(robot: Robot, precision: str = "double") -> Project:
    """C99 for a robot: link torques, inverse dynamics, feedback linearization.

    Args:
        robot: the robot.
        precision: type of the numbers, one of `vsacli.control.codegen.scalar.PRECISIONS`.

    Raises:
        InputError: something of the robot has no evaluation in a bounded number of operations, or too many.
    """
    prefix = prefix_of(robot)
    title = f"{robot.name}, {_plural(len(robot.joints))}, {precision}. Written by vsacli {__version__}."
    head = comment(" ".join([title, *(f"Warning: {sentence(warning)}" for warning in robot.warnings)]))
    try:
        functions, omitted = _functions(robot)
        files = {
            f"{prefix}.h": header_text(prefix, robot, functions, precision, head),
            f"{prefix}.c": source_text(prefix, functions, precision, head),
            f"{prefix}_test.c": self_test_text(prefix, functions, Reference(robot), precision, head),
            "Makefile": makefile_text(prefix),
            "README.md": readme_text(prefix, robot, functions, precision, omitted),
        }
    except NotImplementedError as error:
        raise InputError.one(f"no C code can be made of {robot.name}: {error}") from error
    return Project(_sealed(files), omitted, robot.warnings)


def _sealed(files: dict[str, str]) -> dict[str, str]:
    """The texts with their common digest."""
    digest = hashlib.sha256("".join(files.values()).encode()).hexdigest()
    return {name: text.replace(DIGEST, f"0x{digest[:8]}u") for name, text in files.items()}


def _functions(robot: Robot) -> tuple[list[Function], list[str]]:
    """Those that there are, and why there are not more.

    The last one grows with the third power of the number of joints, so it is looked at if the others were not
    too long.

    Raises:
        NotImplementedError: not even the first two.
    """
    makers = (link_torques_function, inverse_dynamics_function)
    functions, omitted = [_recorded(make(robot)) for make in makers], []
    try:
        functions.append(_recorded(feedback_linearization_function(robot)))
    except InputError as error:
        omitted.append(f"no feedback_linearization: {error}")
    except NotImplementedError as error:
        omitted.append(f"no {error}")
    return functions, omitted


def _recorded(function: Function) -> Function:
    """A function that is known to have a program.

    Raises:
        NotImplementedError: as of `Function.program`.
    """
    _ = function.program
    return function


def prefix_of(robot: Robot) -> str:
    """What the names in C begin with: the robot's, in lower case, of letters that C allows."""
    name = re.sub(r"\W+", "_", robot.name.lower(), flags=re.ASCII).strip("_")
    return name if re.match(r"[a-z]", name) else f"robot_{name}".rstrip("_")


def write(project: Project, folder: str | Path, outputs: Outputs) -> None:
    """Write the files into a folder, which is made if need be.

    Raises:
        StorageError: as `Outputs.folder` and `Outputs.file`.
    """
    outputs.folder(folder)
    for name, text in project.files.items():
        outputs.file(Path(folder) / name).write_text(text)


def _plural(joints: int) -> str:
    return f"{joints} joint" if joints == 1 else f"{joints} joints"
