"""Kernels for a GPU: one thread a sample, which calls the generated functions as device code.

A kernel loads the arguments of its sample from arrays, calls functions, and stores the results. The same text
compiles as C++ for the host, where tests compare it with the functions themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from vsacli.compute.tracing.c_code import Dialect
from vsacli.control.codegen.actuation_functions import CONSTANTS, JointFunctions
from vsacli.control.codegen.interface import Arguments, Function, Step, Structure
from vsacli.control.codegen.scalar import indented

THREADS = 128
"""Threads of a block."""

BLOCKS = 2
"""Blocks that a multiprocessor holds at least: registers for the longest functions, of which 255 are left."""

VALUES = "values"
"""Name of the rows of all parameters, which come as one array."""


@dataclass(frozen=True)
class DeviceKernel:
    """A kernel of the generated project.

    Attributes:
        name: Name in C, without the robot's prefix.
        arguments: Names and structures of the arguments.
        result: Structure of the result, whose arrays are stored.
        output: Name of the result.
        lines: Statements that compute `returned`, the flags, and store results.
        scalars: Declarations of further arguments, numbers equal for all samples.
    """

    name: str
    arguments: Arguments
    result: Structure
    output: str
    lines: tuple[str, ...]
    scalars: tuple[str, ...] = ()


def evaluation_kernel(prefix: str, function: Function, name: str = "") -> DeviceKernel:
    """Return the kernel that evaluates a function for each sample, with the function's name by default."""
    lines = (
        *load_arguments(prefix, function.arguments),
        f"{prefix}_{function.result.name} {function.output};",
        f"const unsigned returned = {call_text(prefix, function, function.output)};",
        *store_result(function.result, function.output),
    )
    return DeviceKernel(name or function.name, function.arguments, function.result, function.output, lines)


def actuated_kernel(
    prefix: str, inverse: Function, links: Function, actuation: JointFunctions
) -> DeviceKernel:
    """Return the kernel of inverse dynamics that runs the recursion, then the actuation joint by joint.

    The threads of a block are at the same joint at the same time, so that the branch costs nothing.

    Args:
        prefix: Prefix of the robot's names in C.
        inverse: Function of inverse dynamics.
        links: Function of the link torques.
        actuation: Functions of the actuation.
    """
    motion = dict(links.arguments)["motion"]
    (_, torque_structure), (_, command_structure), *_ = actuation.functions[0].arguments
    names = [array.name for array in torque_structure.arrays]
    other_arguments = tuple(argument for argument in inverse.arguments if argument[0] != "command")
    joints = f"{prefix.upper()}_JOINTS"
    lines = (
        *load_arguments(prefix, other_arguments),
        f"__shared__ Real torque_of[{len(names)}][{joints}][{THREADS}];",
        "{",
        f"{prefix}_{motion.name} motion;",
        *(f"load(motion.{array.name}, command_{array.name}, n);" for array in motion.arrays),
        f"{prefix}_{links.result.name} {links.output};",
        f"{call_text(prefix, links, links.output)};",
        f"for (int joint = 0; joint < {joints}; joint++) {{",
        *(
            f"torque_of[{index}][joint][threadIdx.x] = {links.output}.{name}[joint];"
            for index, name in enumerate(names)
        ),
        "}",
        "}",
        "unsigned returned = 0;",
        "#pragma unroll 1",
        f"for (int joint = 0; joint < {joints}; joint++) {{",
        f"{prefix}_{torque_structure.name} torques;",
        *(f"torques.{name}[0] = torque_of[{index}][joint][threadIdx.x];" for index, name in enumerate(names)),
        f"{prefix}_{command_structure.name} command;",
        *(
            f"load(command.{array.name}, at_row(command_{array.name}, joint), n);"
            for array in command_structure.arrays
        ),
        f"{prefix}_{actuation.functions[0].result.name} {inverse.output};",
        *_function_switch(prefix, actuation, inverse.output),
        *store_arrays(inverse.result, inverse.output, joint="joint"),
        "}",
        "entry(flags, n) |= returned;",
    )
    return DeviceKernel(inverse.name, inverse.arguments, inverse.result, inverse.output, lines)


def _function_switch(prefix: str, actuation: JointFunctions, result: str) -> Iterator[str]:
    """Yield the statements that call the function of a joint with its constants."""
    yield "switch (structure_of[joint]) {"
    for index, function in enumerate(actuation.functions):
        call = call_text(prefix, function, result)
        table = f"{CONSTANTS}_{index}_of[constants_of[joint]]"
        yield f"case {index}: returned |= {call.replace(f'&{CONSTANTS}', f'&{table}')}; break;"
    yield "}"


def actuation_tables(prefix: str, actuation: JointFunctions, dialect: Dialect) -> Iterator[str]:
    """Yield the tables of the structure of each joint, and of the constants of each structure."""
    function_of_joint = actuation.of_joint
    constant_rows = [function_of_joint[:joint].count(index) for joint, index in enumerate(function_of_joint)]
    for name, indices in (("structure_of", function_of_joint), ("constants_of", constant_rows)):
        yield f"__constant__ const int {name}[] = {{{', '.join(map(str, indices))}}};"
    for index, function in enumerate(actuation.functions):
        members = [
            actuation.constants[joint]
            for joint, joint_function in enumerate(function_of_joint)
            if joint_function == index
        ]
        if members[0]:
            rows = (f"    {{{{{', '.join(map(dialect.real, row))}}}}}," for row in members)
            type_name = f"{prefix}_{function.arguments[-1][1].name}"
            yield f"__constant__ const {type_name} {CONSTANTS}_{index}_of[] = {{\n{chr(10).join(rows)}\n}};"


def rollout_kernel(prefix: str, step: Step) -> DeviceKernel:
    """Return the kernel of many steps of the plant, during which its state stays in registers."""
    arguments = tuple((name, structure) for name, structure in step.arguments if not structure.by_value)
    (state, state_structure), *held_arguments = arguments
    timed_arrays = (
        (name, held_structure.arrays) for name, held_structure in held_arguments if not held_structure.nominal
    )
    timed = [(name, array.name) for name, arrays in timed_arrays for array in arrays]
    lines = (
        *load_arguments(prefix, arguments),
        "unsigned returned = 0;",
        "for (Index step = 0; step < steps; step++) {",
        *(f"load_if_timed({name}.{array}, {name}_{array}, n, step);" for name, array in timed),
        f"returned |= {call_text(prefix, step, state)};",
        "}",
        *store_result(state_structure, state, step.output),
    )
    return DeviceKernel("rollout", arguments, state_structure, step.output, lines, ("Real dt", "Index steps"))


def integration_kernel(prefix: str, law: Function, stiffness: Function) -> DeviceKernel:
    """Return the kernel that advances the integrals of a law's errors over a control period.

    Args:
        prefix: Prefix of the robot's names in C.
        law: Function of feedback linearization.
        stiffness: Function of the stiffness of the joints at a state.
    """
    structures = dict(law.arguments)
    names = ("state", "reference", "integral", *(name for name, _ in stiffness.arguments[1:]))
    arguments = tuple((name, structures[name]) for name in names)
    integral = structures["integral"]
    lines = (
        *load_arguments(prefix, arguments),
        f"{prefix}_{stiffness.result.name} measured;",
        f"const unsigned returned = {call_text(prefix, stiffness, 'measured')};",
        f"for (int joint = 0; joint < {prefix.upper()}_JOINTS; joint++) {{",
        "integral.q[joint] += duration * (reference.q[joint] - state.q[joint]);",
        "integral.stiffness[joint] += duration * (reference.stiffness[joint] - measured.stiffness[joint]);",
        "}",
        *store_result(integral, "integral", "next"),
    )
    return DeviceKernel("integrate", arguments, integral, "next", lines, ("Real duration",))


def call_text(prefix: str, function: Function, result: str) -> str:
    """Return the call of a function with variables that are named as its arguments."""
    arguments = [name if structure.by_value else f"&{name}" for name, structure in function.arguments]
    return f"{prefix}_{function.name}({', '.join([*arguments, f'&{result}'])})"


def load_arguments(prefix: str, arguments: Arguments) -> Iterator[str]:
    """Yield the declarations of the arguments of a function, and statements that load them."""
    for name, structure in arguments:
        yield f"{prefix}_{structure.name} {name};"
        yield from load_lines(name, structure)


def load_lines(name: str, structure: Structure) -> Iterator[str]:
    """Yield the statements that load the members of an argument."""
    if structure.nominal:
        yield from (
            f"{name}.{entry} = entry({name}_{VALUES}, n, {row});"
            for row, entry in enumerate(structure.entries)
        )
    else:
        yield from (f"load({name}.{array.name}, {name}_{array.name}, n);" for array in structure.arrays)


def store_result(structure: Structure, name: str, output: str = "") -> Iterator[str]:
    """Yield the statements that store the arrays of a result that are wanted, and add the flags."""
    yield from store_arrays(structure, name, output)
    yield "entry(flags, n) |= returned;"


def store_arrays(structure: Structure, name: str, output: str = "", joint: str = "") -> Iterator[str]:
    """Yield the statements that store the arrays of a result that are wanted; of one joint if it is given."""
    for bit, array in enumerate(structure.arrays):
        target = f"{output or name}_{array.name}"
        yield f"if (STORED({bit}))"
        yield f"    store({name}.{array.name}, {f'at_row({target}, {joint})' if joint else target}, n);"


def kernel_text(prefix: str, number: int, kernel: DeviceKernel) -> str:
    """Return the definition of a kernel, which is compiled alone if KERNEL is its number."""
    parameters = ["Index samples", *kernel.scalars]
    parameters += [f"Input {name}_{array}" for name, array in _targets(kernel.arguments)]
    parameters += [
        f"{'FlagOutput' if array.bits else 'Output'} {kernel.output}_{array.name}"
        for array in kernel.result.arrays
    ]
    parameter_lines = ",\n    ".join([*parameters, "FlagOutput flags"])
    body = "\n".join(indented(kernel.lines, 1))
    return f"""#if !defined(KERNEL) || KERNEL == {number}
extern "C" __global__ void BOUNDS {prefix}_gpu_{kernel.name}(
    {parameter_lines})
{{
    const Index n = this_sample();
    if (n >= samples)
        return;
{body}
}}
#endif"""


def _targets(arguments: Arguments) -> Iterator[tuple[str, str]]:
    """Yield each argument with each of its arrays."""
    for name, structure in arguments:
        members = [VALUES] if structure.nominal else [array.name for array in structure.arrays]
        yield from ((name, member) for member in members)
