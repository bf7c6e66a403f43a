"""The files for a GPU: kernels in `NAME_gpu.cu`, and the Python module that compiles and launches them."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np

from vsacli.base.wrench import WrenchFrame
from vsacli.compute.tracing import Program, is_of_calls
from vsacli.compute.tracing.c_code import Dialect
from vsacli.compute.tracing.program import operation_count
from vsacli.control.codegen.actuation_functions import JointFunctions, actuation
from vsacli.control.codegen.feedback_function import law_in_parts, link_motion_function
from vsacli.control.codegen.interface import Function, Rows, Step, Structure, structures
from vsacli.control.codegen.kernels import (
    BLOCKS,
    THREADS,
    DeviceKernel,
    actuated_kernel,
    actuation_tables,
    evaluation_kernel,
    integration_kernel,
    kernel_text,
    rollout_kernel,
)
from vsacli.control.codegen.parameters import PARAMETERS, Maker, with_parameters
from vsacli.control.codegen.robot_functions import state_structure, variable_array
from vsacli.control.codegen.scalar import WIDTH, further_definitions, scalar_dialect
from vsacli.control.codegen.texts import NUMPY_TYPES, comment, filled, python_head, structure_text
from vsacli.dynamics.forward import Plant
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter

ROLLOUTS = {
    "rollout": "rollout_gpu.py",
    "integrate": "rollout_law_gpu.py",
}
"""Templates of the Python functions that need a kernel, by its name."""

_GLUE = "\xa0"
"""A space at which no line is broken."""

_CONVERSIONS = {
    "double": "give float64, in JAX by jax_enable_x64, in PyTorch by .double(), or generate it with "
    "--precision float",
    "float": "give float32, in PyTorch by .float(), or generate it without --precision float",
}
"""Ways out of arrays of the other precision."""

MOST_OF_LAW = 4_000
"""Largest number of operations of a law in one kernel; two kernels write and read less than one spills."""


@dataclass
class DeviceCode:
    """Functions and kernels beyond those of the source file.

    Attributes:
        functions: Further functions.
        kernels: Kernels by name.
        before: Kernels that compute an argument of another one, by its name.
        tables: Definitions of constants that the kernels read.
    """

    functions: list[Function] = field(default_factory=list)
    kernels: dict[str, DeviceKernel] = field(default_factory=dict)
    before: dict[str, tuple[str, ...]] = field(default_factory=dict)
    tables: list[str] = field(default_factory=list)


def gpu_files(
    robot: Robot,
    prefix: str,
    functions: Sequence[Function],
    precision: str,
    about: str,
    frame: WrenchFrame | None,
    free_parameters: Sequence[Parameter],
) -> dict[str, str]:
    """Return the texts of the files for a GPU, by file name.

    Args:
        robot: Robot.
        prefix: Prefix of the robot's names in C.
        functions: Functions of the source file.
        precision: One of `vsacli.control.codegen.scalar.PRECISIONS`.
        about: Text of the comment at the beginning.
        frame: Frame of the wrench that the functions have as an argument; None without one.
        free_parameters: Parameters that they have as an argument.
    """

    def make_function(make: Maker) -> Function:
        return with_parameters(make, robot, frame, free_parameters)

    code, by_name = DeviceCode(), {function.name: function for function in functions}
    for function in functions:
        if not isinstance(function, Step):
            code.kernels[function.name] = evaluation_kernel(prefix, function)
    joint_functions = actuation(robot, by_name["inverse_dynamics"], free_parameters)
    if joint_functions is not None:
        _add_actuation(code, prefix, by_name, joint_functions, scalar_dialect(precision))
    law, step = by_name.get("feedback_linearization"), by_name.get("step")
    if (
        law is not None
        and _needs_two_parts(law.program)
        and all(joint.actuator.sprung for joint in robot.joints)
    ):
        _add_law_in_parts(code, prefix, law.name, make_function)
    if isinstance(step, Step):
        code.kernels["rollout"] = rollout_kernel(prefix, step)
        if law is not None:
            code.functions.append(make_function(measured_stiffness_function))
            code.kernels["integrate"] = integration_kernel(prefix, law, code.functions[-1])
    return {
        f"{prefix}_gpu.cu": _kernel_file_text(prefix, functions, code, precision, about),
        f"{prefix}_gpu.py": _loader_text(prefix, by_name, code, precision, about),
    }


def _needs_two_parts(law: Program) -> bool:
    """Return whether a law is computed in two parts; laws of calls are too long for a GPU anyway."""
    return operation_count(law) > MOST_OF_LAW and not is_of_calls(law)


def _add_actuation(
    code: DeviceCode,
    prefix: str,
    by_name: Mapping[str, Function],
    joint_functions: JointFunctions,
    dialect: Dialect,
) -> None:
    """Let the kernel of inverse dynamics run the recursion, then the joints in a loop."""
    inverse, links = by_name["inverse_dynamics"], by_name["link_torques"]
    code.functions += joint_functions.functions
    code.kernels[inverse.name] = actuated_kernel(prefix, inverse, links, joint_functions)
    code.tables += actuation_tables(prefix, joint_functions, dialect)


def _add_law_in_parts(
    code: DeviceCode, prefix: str, name: str, make_function: Callable[[Maker], Function]
) -> None:
    """Let the kernel of a law follow one that computes the motion of the links."""
    first, second = make_function(link_motion_function), make_function(law_in_parts)
    code.functions += [first, second]
    code.kernels[first.name] = evaluation_kernel(prefix, first)
    code.kernels[name] = evaluation_kernel(prefix, second, name)
    code.before[name] = (first.name,)


def measured_stiffness_function(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the function of the stiffness of the joints at a state; a wrench has no effect."""
    drivetrain = Plant(robot, frame).drivetrain
    state = state_structure(robot)

    def compute(rows: Rows) -> Rows:
        q, _, theta, _ = state.layout.arrays(np.concatenate(rows)).values()
        return list(drivetrain.stiffness(q, drivetrain.of_motors(theta)[drivetrain.sprung]))

    return Function(
        name="measured_stiffness",
        meaning="Stiffness of the joints at a state, whose error a law integrates.",
        arguments=(("state", state),),
        result=Structure("stiffness", "Stiffness at a state.", (variable_array(robot, "stiffness"),)),
        compute=compute,
    )


def _kernel_file_text(
    prefix: str, functions: Sequence[Function], code: DeviceCode, precision: str, about: str
) -> str:
    """Return the text of the kernels, with functions and structures that the source file lacks."""
    declared, kernels = structures(functions), code.kernels.values()
    new_structures = [structure for structure in structures(code.functions) if structure not in declared]
    definitions = [structure_text(prefix, structure, precision) for structure in new_structures]
    definitions += further_definitions(prefix, functions, code.functions, precision)
    return filled(
        "robot_gpu.cu",
        prefix,
        head=comment(about),
        precision=precision,
        threads=THREADS,
        blocks=BLOCKS,
        definitions="\n\n".join([*definitions, *code.tables]),
        kernels="\n\n".join(
            kernel_text(prefix, number, structure) for number, structure in enumerate(kernels)
        ),
    )


def _loader_text(
    prefix: str, by_name: Mapping[str, Function], code: DeviceCode, precision: str, about: str
) -> str:
    """Return the text of the Python module."""
    kernels = code.kernels.values()
    kernel_structures = ((*dict(kernel.arguments).values(), kernel.result) for kernel in kernels)
    used_structures = dict.fromkeys(chain.from_iterable(kernel_structures))
    shapes = {
        structure.name: structure.layout.shapes for structure in used_structures if not structure.nominal
    }
    nominal = {
        entry: value
        for structure in used_structures
        for entry, value in zip(structure.entries, structure.nominal, strict=False)
    }
    tables = {
        kernel.name: (
            tuple((name, structure.name) for name, structure in kernel.arguments),
            kernel.result.name,
        )
        for kernel in kernels
    }
    evaluations = [
        _evaluation_function(structure) for structure in by_name.values() if not isinstance(structure, Step)
    ]
    loop = by_name["inverse_dynamics"]
    return filled(
        "robot_gpu.py",
        prefix,
        head=python_head(about),
        call=f"{loop.name}({', '.join(name for name, _ in loop.arguments if name != PARAMETERS)})",
        real=NUMPY_TYPES[precision],
        convert=_CONVERSIONS[precision],
        threads=THREADS,
        structures=_dictionary_lines(shapes),
        nominal=f"\n{_dictionary_lines(nominal)}\n" if nominal else "",
        kernels=_dictionary_lines(tables),
        before=f"\n{_dictionary_lines(code.before)}\n" if code.before else "",
        functions="\n\n\n".join(evaluations),
        rollouts="".join(
            _rollout_function(prefix, kernel, by_name) for kernel in kernels if kernel.name in ROLLOUTS
        ),
    )


def _dictionary_lines(table: Mapping[str, Any]) -> str:
    """Return the entries of a dictionary in Python, one below the other; no line ends with a key."""
    lines = (
        f'"{name}": {value!r},'.replace("'", '"').replace(": ", f":{_GLUE}") for name, value in table.items()
    )
    wrapped = (
        textwrap.fill(line, WIDTH, initial_indent="    ", subsequent_indent="        ") for line in lines
    )
    return "\n".join(wrapped).replace(_GLUE, " ")


def _evaluation_function(function: Function) -> str:
    """Return the Python function that evaluates a function for each sample."""
    names = [name if name != PARAMETERS else f"{name}=None" for name, _ in function.arguments]
    arguments = "\n".join(_argument_entry(name, structure) for name, structure in function.arguments)
    meaning = textwrap.fill(
        f'"""{function.meaning}"""', WIDTH, initial_indent="    ", subsequent_indent="    "
    )
    return f"""def {function.name}({", ".join(names)}, *, results=None, sample_axis=-1):
{meaning}
    arguments = {{
{textwrap.indent(arguments, "        ")}
    }}
    return _call("{function.name}", arguments, results, sample_axis)"""


def _argument_entry(name: str, structure: Structure, key: str = "") -> str:
    """Return the entry of an argument among those of a call in Python."""
    return f'"{key or name}": ("{structure.name}", {key or name}),'


def _rollout_function(prefix: str, kernel: DeviceKernel, by_name: Mapping[str, Function]) -> str:
    """Return the Python function that launches a kernel of rollouts, with the further arguments it has."""
    plant, law = by_name["step"], by_name.get("feedback_linearization")
    further_arguments = [
        (name, structure, name) for name, structure in plant.arguments if name in ("wrench", PARAMETERS)
    ]
    if kernel.name == "integrate" and law is not None:
        further_arguments += [
            (name, structure, f"law_{name}") for name, structure in law.arguments if name == PARAMETERS
        ]
    keywords = [key if name == "wrench" else f"{key}=None" for name, _, key in further_arguments]
    return filled(
        ROLLOUTS[kernel.name],
        prefix,
        keywords="".join(f"{keyword}, " for keyword in keywords),
        arguments="".join(f"\n            {_argument_entry(*structure)}" for structure in further_arguments),
    )
