"""The files for a GPU: kernels in `NAME_gpu.cu`, and the Python module that compiles and launches them."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from vsacli.base.texts import one_line
from vsacli.base.wrench import WrenchFrame
from vsacli.control.codegen.interface import Function, Rows, Step, Structure, structures
from vsacli.control.codegen.kernels import (
    BLOCKS,
    THREADS,
    Kernel,
    evaluation_kernel,
    integration_kernel,
    kernel_text,
    rollout_kernel,
)
from vsacli.control.codegen.parameters import PARAMETERS, with_parameters
from vsacli.control.codegen.robot_functions import state_structure, variable_array
from vsacli.control.codegen.scalar import WIDTH, further_definitions
from vsacli.control.codegen.texts import NUMPY_TYPES, comment, filled, structure_text
from vsacli.dynamics.forward import Plant
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter

ROLLOUTS = {
    "rollout": "rollout_gpu.py",
    "integrate": "rollout_law_gpu.py",
}
"""Templates of the Python functions that need a kernel, by its name."""

_CONVERSIONS = {
    "double": "give float64, in JAX by jax_enable_x64, in PyTorch by .double(), or generate the code with "
    "--precision float",
    "float": "give float32, in PyTorch by .float(), or generate the code without --precision float",
}
"""Ways out of arrays of the other precision."""


def gpu_files(
    robot: Robot,
    prefix: str,
    functions: Sequence[Function],
    precision: str,
    about: str,
    frame: WrenchFrame | None,
    chosen: Sequence[Parameter],
) -> dict[str, str]:
    """Return the texts of the files for a GPU, by file name.

    Args:
        robot: Robot.
        prefix: Prefix of the robot's names in C.
        functions: Functions of the source file.
        precision: One of `vsacli.control.codegen.scalar.PRECISIONS`.
        about: Text of the comment at the beginning.
        frame: Frame of the wrench that the functions have as an argument; None without one.
        chosen: Parameters that they have as an argument.
    """
    by_name = {function.name: function for function in functions}
    further: list[Function] = []
    kernels = [evaluation_kernel(prefix, each) for each in functions if not isinstance(each, Step)]
    law, step = by_name.get("feedback_linearization"), by_name.get("step")
    if isinstance(step, Step):
        kernels.append(rollout_kernel(prefix, step))
    if law is not None and step is not None:
        further.append(with_parameters(measured_stiffness_function, robot, frame, chosen))
        kernels.append(integration_kernel(prefix, law, further[-1]))
    return {
        f"{prefix}_gpu.cu": _kernel_file(prefix, functions, further, kernels, precision, about),
        f"{prefix}_gpu.py": _loader(prefix, by_name, kernels, precision, about),
    }


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


def _kernel_file(
    prefix: str,
    functions: Sequence[Function],
    further: Sequence[Function],
    kernels: Sequence[Kernel],
    precision: str,
    about: str,
) -> str:
    """Return the text of the kernels, with functions and structures that the source file lacks."""
    declared = structures(functions)
    new = [each for each in structures(further) if each not in declared]
    definitions = [structure_text(prefix, each, precision) for each in new]
    definitions += further_definitions(prefix, functions, further, precision)
    return filled(
        "robot_gpu.cu",
        prefix,
        head=comment(about),
        precision=precision,
        threads=THREADS,
        blocks=BLOCKS,
        definitions="\n\n".join(definitions),
        kernels="\n\n".join(kernel_text(prefix, number, each) for number, each in enumerate(kernels)),
    )


def _loader(
    prefix: str, by_name: Mapping[str, Function], kernels: Sequence[Kernel], precision: str, about: str
) -> str:
    """Return the text of the Python module."""
    of_kernels = ((*dict(kernel.arguments).values(), kernel.result) for kernel in kernels)
    used = dict.fromkeys(chain.from_iterable(of_kernels))
    shapes = {each.name: each.layout.shapes for each in used if not each.nominal}
    nominal = {
        entry: value for each in used for entry, value in zip(each.entries, each.nominal, strict=False)
    }
    tables = {
        kernel.name: (tuple((name, each.name) for name, each in kernel.arguments), kernel.result.name)
        for kernel in kernels
    }
    public = [_evaluation(each) for each in by_name.values() if not isinstance(each, Step)]
    loop = by_name["inverse_dynamics"]
    return filled(
        "robot_gpu.py",
        prefix,
        head=textwrap.fill(one_line(about), WIDTH, initial_indent="# ", subsequent_indent="# "),
        call=f"{loop.name}({', '.join(name for name, _ in loop.arguments if name != PARAMETERS)})",
        real=NUMPY_TYPES[precision],
        convert=_CONVERSIONS[precision],
        threads=THREADS,
        structures=_entries(shapes),
        nominal=f"\n{_entries(nominal)}\n" if nominal else "",
        kernels=_entries(tables),
        before="",
        functions="\n\n\n".join(public),
        rollouts="".join(_rollout(prefix, kernel, by_name) for kernel in kernels if kernel.name in ROLLOUTS),
    )


def _entries(table: Mapping[str, Any]) -> str:
    """Return the entries of a dictionary in Python, one below the other."""
    lines = (f'"{name}": {value!r},'.replace("'", '"') for name, value in table.items())
    return "\n".join(
        textwrap.fill(line, WIDTH, initial_indent="    ", subsequent_indent="        ") for line in lines
    )


def _evaluation(function: Function) -> str:
    """Return the Python function that evaluates a function for each sample."""
    names = [name if name != PARAMETERS else f"{name}=None" for name, _ in function.arguments]
    arguments = "\n".join(_argument(name, structure) for name, structure in function.arguments)
    meaning = textwrap.fill(
        f'"""{function.meaning}"""', WIDTH, initial_indent="    ", subsequent_indent="    "
    )
    return f"""def {function.name}({", ".join(names)}, *, results=None, sample_axis=-1):
{meaning}
    arguments = {{
{textwrap.indent(arguments, "        ")}
    }}
    return _call("{function.name}", arguments, results, sample_axis)"""


def _argument(name: str, structure: Structure, key: str = "") -> str:
    """Return the entry of an argument among those of a call in Python."""
    return f'"{key or name}": ("{structure.name}", {key or name}),'


def _rollout(prefix: str, kernel: Kernel, by_name: Mapping[str, Function]) -> str:
    """Return the Python function that launches a kernel of rollouts, with the further arguments it has."""
    plant, law = by_name["step"], by_name.get("feedback_linearization")
    further = [(name, each, name) for name, each in plant.arguments if name in ("wrench", PARAMETERS)]
    if kernel.name == "integrate" and law is not None:
        further += [(name, each, f"law_{name}") for name, each in law.arguments if name == PARAMETERS]
    keywords = [key if name == "wrench" else f"{key}=None" for name, _, key in further]
    return filled(
        ROLLOUTS[kernel.name],
        prefix,
        keywords="".join(f"{keyword}, " for keyword in keywords),
        arguments="\n            ".join(_argument(*each) for each in further),
    )
