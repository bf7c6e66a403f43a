"""The header of the generated code: structures with units, bits, functions."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from vsacli.base.flags import Flag
from vsacli.base.texts import for_comment
from vsacli.base.version import __version__
from vsacli.control.codegen.interface import Array, Function, Structure, structures
from vsacli.control.codegen.scalar import DIGEST, WIDTH, signature
from vsacli.robot.model import Robot


def header_text(prefix: str, robot: Robot, functions: Sequence[Function], precision: str, head: str) -> str:
    """The header file; arguments as of `vsacli.control.codegen.scalar.source_text`."""
    guard = f"{prefix.upper()}_H"
    parts = [
        head,
        f"#ifndef {guard}\n#define {guard}",
        "\n".join(_provenance(prefix, robot)),
        '#ifdef __cplusplus\nextern "C" {\n#endif',
        _joints(prefix, robot, any(name == "wrench" for each in functions for name, _ in each.arguments)),
        "\n".join(_flags(prefix)),
        *(_structure(prefix, structure, precision) for structure in structures(functions)),
        *(_declaration(prefix, function) for function in functions),
        "#ifdef __cplusplus\n}\n#endif",
        "#endif",
    ]
    return "\n\n".join(parts) + "\n"


def _provenance(prefix: str, robot: Robot) -> Iterator[str]:
    """What wrote the files, and of which robot."""
    yield "/* The same in all files that were written together. */"
    yield f"#define {prefix.upper()}_DIGEST {DIGEST}"
    yield "/* The vsacli that wrote them. */"
    yield f'#define {prefix.upper()}_VERSION "{__version__}"'
    if robot.sources:
        yield "/* Of the file that the robot was read from; results of the same file have it, too. */"
        yield f'#define {prefix.upper()}_ROBOT_SHA256 "{robot.sources[0].sha256}"'


def _joints(prefix: str, robot: Robot, acted_on: bool) -> str:
    acting = "the argument wrench acts" if acted_on else "nothing acts"
    names = ", ".join(
        f"{index} {joint.name} ({joint.type}, {joint.actuator_type})"
        for index, joint in enumerate(robot.joints)
    )
    text = (
        f"Joints: {names}. Motors 0 and 1 of a joint; what an actuator does not have is NaN. SI units; "
        f"signs, frames and gravity as in the robot file; {acting} on the end effector. Functions keep "
        "nothing between calls."
    )
    return f"{comment(text)}\nenum {{ {prefix.upper()}_JOINTS = {len(robot.joints)} }};"


def _flags(prefix: str) -> Iterator[str]:
    yield "/* Bits of flags: what is wrong with a joint. */"
    yield "enum {"
    for flag in Flag:
        yield f"    {prefix.upper()}_{flag.name} = {flag.value}, /* {flag.meaning} */"
    yield "};"


def _structure(prefix: str, structure: Structure, precision: str) -> str:
    members = [_member(array, precision) for array in structure.arrays]
    name = f"{prefix}_{structure.name}"
    lines = [comment(structure.meaning), "typedef struct {", *members, f"}} {name};"]
    if structure.nominal:
        constant = f"extern const {name} {prefix}_nominal_{structure.name};"
        lines += ["", "/* Those of the robot file. */", constant]
    return "\n".join(lines)


def _member(array: Array, precision: str) -> str:
    shape = "".join(f"[{size}]" for size in array.shape)
    return f"    {'unsigned' if array.bits else precision} {array.name}{shape}; /* {array.meaning} */"


def _declaration(prefix: str, function: Function) -> str:
    return f"{comment(function.meaning)}\n{signature(prefix, function)};"


def comment(text: str) -> str:
    """A comment, in as many lines as it takes, that no text ends early."""
    lines = textwrap.wrap(for_comment(text), WIDTH - 6)
    return "/* " + "\n   ".join(lines) + " */"
