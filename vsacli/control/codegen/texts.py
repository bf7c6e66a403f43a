"""Texts of the generated files: templates, and the values inserted into them.

A template in `templates/` has the text that is common to all robots, with placeholders such as `@prefix`.
Lists that depend on the robot, such as members of structures and reference values, are written here; the
bodies of functions come from `vsacli.control.codegen.scalar`.
"""

from __future__ import annotations

import string
import textwrap
from collections.abc import Iterator, Sequence
from importlib.resources import files

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag
from vsacli.base.texts import for_comment, for_markdown, one_line, sentence
from vsacli.base.version import __version__
from vsacli.compute.tracing.c_code import digits
from vsacli.control.codegen.cost import table_bytes, worst_cost
from vsacli.control.codegen.interface import Function, Structure, structures
from vsacli.control.codegen.scalar import WIDTH, definitions, signature
from vsacli.control.codegen.self_test import CASES, TOLERANCE, Arrays, ReferenceResults
from vsacli.robot.model import Robot

DIGEST = "0xd19e5700u"
"""Placeholder for the digest of all texts until it is known; a valid C constant, so that texts compile."""

_STEPS = "As a rule a loop ends after a few iterations; near double solutions it takes more.\n"


class _Template(string.Template):
    """A template whose placeholders begin with @, since $ has a meaning in Make and CMake."""

    delimiter = "@"


def filled(template: str, prefix: str, **values: object) -> str:
    """Return the text of `templates/TEMPLATE.in` with values in place of its placeholders."""
    text = files("vsacli.control.codegen.templates").joinpath(f"{template}.in").read_text(encoding="utf-8")
    return _Template(text).substitute(values, prefix=prefix, upper=prefix.upper(), digest=DIGEST)


def comment(text: str) -> str:
    """Return a wrapped C comment; the text cannot end it early."""
    lines = textwrap.wrap(for_comment(text), WIDTH - 6)
    return "/* " + "\n   ".join(lines) + " */"


def header_text(prefix: str, robot: Robot, functions: Sequence[Function], precision: str, about: str) -> str:
    """Return the header file: structures with units, flags, functions. For arguments see `source_text`."""
    upper = prefix.upper()
    robot_file = "".join(
        "/* Of the file that the robot was read from; results of the same file have it, too. */\n"
        f'#define {upper}_ROBOT_SHA256 "{source.sha256}"\n'
        for source in robot.sources[:1]
    )
    return filled(
        "robot.h",
        prefix,
        head=comment(about),
        version=__version__,
        robot_file=robot_file,
        about=comment(_conventions_text(robot, functions)),
        joints=len(robot.joints),
        flags="\n".join(f"    {upper}_{flag.name} = {flag.value}, /* {flag.meaning} */" for flag in Flag),
        structures="\n\n".join(
            structure_text(prefix, declared, precision) for declared in structures(functions)
        ),
        functions="\n\n".join(
            f"{comment(declared.meaning)}\n{signature(prefix, declared, precision)};"
            for declared in functions
        ),
    )


def _conventions_text(robot: Robot, functions: Sequence[Function]) -> str:
    has_wrench = any(structure.name == "wrench" for structure in structures(functions))
    wrench_text = "the argument wrench acts" if has_wrench else "nothing acts"
    tool_text = (
        "end effector" if len(robot.tool_names) == 1 else "tools that it names" if has_wrench else "tools"
    )
    names = ", ".join(
        f"{index} {joint.name} ({joint.type}, {joint.actuator_type})"
        for index, joint in enumerate(robot.joints)
    )
    return (
        f"Joints: {names}. Motors 0 and 1 of a joint; what an actuator does not have is NaN. SI units; "
        f"signs, frames and gravity as in the robot file; {wrench_text} on the {tool_text}. Functions keep "
        "nothing between calls."
    )


def structure_text(prefix: str, structure: Structure, precision: str) -> str:
    """Return the C type of a structure, and the declaration of its constant if it has nominal values."""
    name = f"{prefix}_{structure.name}"
    lines = [comment(structure.meaning), "typedef struct {"]
    for array in structure.arrays:
        shape = "".join(f"[{length}]" for length in array.shape)
        number_type = "unsigned" if array.bits else precision
        lines.append(f"    {number_type} {array.name}{shape}; /* {array.meaning} */")
    lines.append(f"}} {name};")
    if structure.nominal:
        constant = f"extern const {name} {prefix}_nominal_{structure.name};"
        lines += ["", "/* Those of the robot file. */", constant]
    return "\n".join(lines)


def source_text(prefix: str, functions: Sequence[Function], precision: str, about: str) -> str:
    """Return the source file.

    Args:
        prefix: prefix of the robot's names in C.
        functions: functions to define.
        precision: one of `vsacli.control.codegen.scalar.PRECISIONS`.
        about: text of the comment at the beginning.
    """
    defined = "\n\n".join(definitions(prefix, functions, precision))
    return filled("robot.c", prefix, head=comment(about), definitions=defined)


def self_test_text(
    prefix: str, functions: Sequence[Function], reference: ReferenceResults, precision: str, about: str
) -> str:
    """Return the test program; for arguments see `source_text`."""
    definitions: list[str] = []
    for function in functions:
        constants = (*function.arguments, ("expected", function.result))
        values = (*reference.inputs(function), reference.results(function))
        definitions += (
            _case_table(f"{_c_type(prefix, structure, precision)} {function.name}_{name}", structure, arrays)
            for (name, structure), arrays in zip(constants, values, strict=True)
        )
        definitions.append(_test_function(prefix, function, reference))
    return filled(
        "robot_test.c",
        prefix,
        head=comment(about),
        cases=CASES,
        tolerance=TOLERANCE[precision],
        tests="\n\n".join(definitions),
        calls=" + ".join(f"test_{function.name}()" for function in functions),
    )


def _c_type(prefix: str, structure: Structure, precision: str) -> str:
    return precision if structure.by_value else f"{prefix}_{structure.name}"


def _case_table(declaration: str, structure: Structure, values: Arrays) -> str:
    cases = (
        _case_initializer(structure, {name: array[case] for name, array in values.items()})
        for case in range(CASES)
    )
    return "\n".join([f"static const {declaration}[CASES] = {{", *(f"    {case}," for case in cases), "};"])


def _case_initializer(structure: Structure, values: Arrays) -> str:
    members = [(array, _array_initializer(values[array.name], array.bits)) for array in structure.arrays]
    if structure.by_value:
        return members[0][1]
    return "{" + ", ".join(f".{array.name} = {value}" for array, value in members) + "}"


def _array_initializer(values: FloatArray, bits: bool) -> str:
    if values.ndim:
        return "{" + ", ".join(_array_initializer(entry, bits) for entry in values) + "}"
    return f"{int(values)}u" if bits else digits(float(values))


def _test_function(prefix: str, function: Function, reference: ReferenceResults) -> str:
    function_name, result = function.name, f"{prefix}_{function.result.name}"
    arguments = ", ".join(
        f"{'' if structure.by_value else '&'}{function_name}_{name}[n]"
        for name, structure in function.arguments
    )
    comparisons = "\n".join(_comparison_lines(function, reference))
    return f"""static int test_{function_name}(void)
{{
    int failures = 0;
    for (int n = 0; n < CASES; n++) {{
        const {result} *const expected = &{function_name}_expected[n];
        {result} found;
        {prefix}_{function_name}({arguments}, &found);
{comparisons}
    }}
    return failures;
}}"""


def _comparison_lines(function: Function, reference: ReferenceResults) -> Iterator[str]:
    for array in function.result.arrays:
        scale, bound = reference.comparison(function, array.name)
        for entry in array.entries:
            operands = f"found.{entry}", f"expected->{entry}"
            if np.isfinite(bound):
                operands = (
                    f"at_most({operands[0]}, {digits(bound)})",
                    f"at_most({operands[1]}, {digits(bound)})",
                )
            name = f"{function.name}: {entry}"
            yield f'        failures += differs("{name}", n, {", ".join(operands)}, {digits(scale)});'


def python_head(about: str) -> str:
    """Return the comment with which a file in Python begins."""
    return textwrap.fill(one_line(about), WIDTH, initial_indent="# ", subsequent_indent="# ")


def binding_text(prefix: str, functions: Sequence[Function], precision: str, about: str) -> str:
    """Return the Python module that calls the functions; for arguments see `source_text`."""
    used_structures = structures(functions)
    loop = next((declared for declared in functions if declared.name == "inverse_dynamics"), functions[0])
    definitions = [_binding_function(prefix, declared) for declared in functions]
    definitions += (_nominal_binding(prefix, declared) for declared in used_structures if declared.nominal)
    return filled(
        "robot.py",
        prefix,
        head=python_head(about),
        call=f"{loop.name}({_argument_list(loop)})",
        real=NUMPY_TYPES[precision],
        flags="\n".join(f"    {flag.name} = {flag.value}  # {flag.meaning}" for flag in Flag),
        data_types="\n\n".join(_data_type(declared, precision) for declared in used_structures),
        functions="\n\n\n".join(definitions),
    )


def _argument_list(function: Function) -> str:
    return ", ".join(name for name, _ in function.arguments)


def _data_type_name(structure: Structure) -> str:
    return structure.name.capitalize()


NUMPY_TYPES = {"double": "np.float64", "float": "np.float32"}
"""Types of numbers in Python."""


def _data_type(structure: Structure, precision: str) -> str:
    """Return the NumPy data type of a structure, with the memory layout of C."""
    number_type = NUMPY_TYPES[precision]
    members = "".join(
        f'        ("{array.name}", {"np.uintc" if array.bits else number_type}, {array.shape}),\n'
        for array in structure.arrays
    )
    return f"{_data_type_name(structure)} = np.dtype(\n    [\n{members}    ],\n    align=True,\n)"


def _binding_function(prefix: str, function: Function) -> str:
    """Return the Python function that calls the C function with the same arguments."""
    meaning = f'"""{function.meaning}"""'
    arguments = "".join(
        f", _real({name})" if structure.by_value else f", ({name}, {_data_type_name(structure)})"
        for name, structure in function.arguments
    )
    return f"""def {function.name}({_argument_list(function)}):
{textwrap.fill(meaning, WIDTH, initial_indent="    ", subsequent_indent="    ")}
    return _call(_LIBRARY.{prefix}_{function.name}, {_data_type_name(function.result)}{arguments})"""


def _nominal_binding(prefix: str, structure: Structure) -> str:
    """Return the Python code of the nominal values of a structure."""
    type_name, name = _data_type_name(structure), f"{prefix}_nominal_{structure.name}"
    return f"""_CONSTANT = (ctypes.c_char * {type_name}.itemsize).in_dll(_LIBRARY, "{name}")
NOMINAL_{structure.name.upper()} = np.frombuffer(_CONSTANT.raw, {type_name})[0]"""


def _wrench_sentence(robot: Robot, functions: Sequence[Function]) -> str:
    """Return the sentence on the wrenches on several tools; empty otherwise."""
    structure = next((candidate for candidate in structures(functions) if candidate.name == "wrench"), None)
    if structure is None or len(robot.tool_names) == 1:
        return ""
    members = ", ".join(f"`{array.name}`" for array in structure.arrays)
    return f"The argument `wrench` has the members {members}; nothing acts on other tools.\n"


def readme_text(
    prefix: str, robot: Robot, functions: Sequence[Function], precision: str, omitted: Sequence[str]
) -> str:
    """Return the README, with the usage of the code and the cost of a call."""
    loop = next(function for function in functions if function.name == "inverse_dynamics")
    programs = [function.program for function in functions]
    costs = [worst_cost(program) for program in programs]
    heads = [signature(prefix, function, precision) for function in functions]
    return filled(
        "README.md",
        prefix,
        name=for_markdown(robot.name),
        warnings="".join(f"\nWarning: {for_markdown(sentence(warning))}\n" for warning in robot.warnings),
        call=_argument_list(loop),
        arguments=", ".join(f"const {prefix}_{structure.name} *{name}" for name, structure in loop.arguments),
        tolerance=TOLERANCE[precision],
        functions="\n".join(
            f"- `{' '.join(head.split()).replace('( ', '(')}`: {function.meaning}"
            for function, head in zip(functions, heads, strict=True)
        ),
        joints=for_markdown(", ".join(f"{index} {name}" for index, name in enumerate(robot.joint_names))),
        wrenches=_wrench_sentence(robot, functions),
        omitted="".join(f"There is {for_markdown(sentence(reason))}\n" for reason in omitted),
        numbers="".join(
            filled("parameters.md", prefix, first=next(structure.entries))
            for structure in structures(functions)
            if structure.nominal
        ),
        costs="\n".join(
            f"| `{function.name}` | {cost.operations:,} | {cost.functions:,} | {cost.loops:,} |"
            for function, cost in zip(functions, costs, strict=True)
        ),
        steps=_STEPS if any(cost.loops for cost in costs) else "",
        tables=table_bytes(programs, precision),
    )
