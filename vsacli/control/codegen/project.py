"""The files that `vsacli codegen` writes: header, source, self-test, Python binding, build files, README."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.texts import counted, sentence
from vsacli.base.version import __version__
from vsacli.base.wrench import WrenchFrame, check_wrench_frame
from vsacli.control.codegen.cost import worst_cost
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.gpu import gpu_files
from vsacli.control.codegen.interface import Function
from vsacli.control.codegen.parameters import Maker, check_parameters, with_parameters
from vsacli.control.codegen.plant_functions import state_derivative_function, step_function
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.codegen.self_test import ReferenceResults, check_single_precision
from vsacli.control.codegen.texts import (
    DIGEST,
    binding_text,
    filled,
    header_text,
    readme_text,
    self_test_text,
    source_text,
)
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, parameters


class Project(NamedTuple):
    """Generated code.

    Attributes:
        files: texts by file name.
        omitted: sentences that name the functions that could not be generated, with the reason.
        warnings: warnings about the robot, a sentence each; the files repeat them.
    """

    files: dict[str, str]
    omitted: list[str]
    warnings: tuple[str, ...]


def generate(
    robot: Robot,
    precision: str = "double",
    wrench: WrenchFrame | None = None,
    patterns: Sequence[str] = (),
    *,
    loops: bool = True,
) -> Project:
    """Generate C99 code for a robot: link torques, inverse dynamics, feedback linearization, plant.

    Args:
        robot: robot.
        precision: type of the numbers, one of `vsacli.control.codegen.scalar.PRECISIONS`.
        wrench: frame of a wrench at the end effector that the functions take as an argument, one of
            `vsacli.base.wrench.WRENCH_FRAMES`, or that of each of several tools; None for no such argument.
        patterns: patterns of paths as in `vsacli.robot.parameters`; matching parameters become arguments.
        loops: whether loops are allowed; without them every call executes the same operations.

    Raises:
        InputError: part of the robot has no evaluation in a bounded number of operations, or too many, or
            none without loops; single precision fails the self-test; a pattern matches no parameter, or one
            that cannot be an argument.
    """
    prefix = prefix_of(robot)
    joints = counted(len(robot.joints), "joint")
    title = f"{robot.name}, {joints}, {precision}. Written by vsacli {__version__}."
    about = " ".join([title, *(f"Warning: {sentence(warning)}" for warning in robot.warnings)])
    free_parameters = parameters(robot, patterns) if patterns else ()
    try:
        if wrench is not None:
            check_wrench_frame(wrench, robot.tool_names)
        functions, omitted = _generated_functions(robot, wrench, free_parameters)
        if not loops:
            _check_loops(robot, functions)
        reference = ReferenceResults(robot, free_parameters, wrench)
        if precision == "float":
            check_single_precision(robot, functions, reference)
        files = {
            f"{prefix}.h": header_text(prefix, robot, functions, precision, about),
            f"{prefix}.c": source_text(prefix, functions, precision, about),
            f"{prefix}_test.c": self_test_text(prefix, functions, reference, precision, about),
            f"{prefix}.py": binding_text(prefix, functions, precision, about),
            "Makefile": filled("Makefile", prefix),
            "CMakeLists.txt": filled("CMakeLists.txt", prefix),
            "README.md": readme_text(prefix, robot, functions, precision, omitted),
        }
    except NotImplementedError as error:
        raise InputError.one(f"no C code can be made of {robot.name}: {error}") from error
    digest = hashlib.sha256("".join(files.values()).encode()).hexdigest()
    files |= gpu_files(robot, prefix, functions, precision, about, wrench, free_parameters)
    files["README.md"] += filled("gpu.md", prefix)
    files_with_digest = {name: text.replace(DIGEST, f"0x{digest[:8]}u") for name, text in files.items()}
    return Project(files_with_digest, omitted, robot.warnings)


def _generated_functions(
    robot: Robot, wrench: WrenchFrame | None, free_parameters: Sequence[Parameter]
) -> tuple[list[Function], list[str]]:
    """Return the functions that can be generated, and the reasons for missing ones.

    Feedback and plant grow with the third power of the number of joints, so they are tried last, after the
    others have turned out not to be too long.

    Raises:
        InputError: some chosen parameters cannot be arguments.
        NotImplementedError: link torques or inverse dynamics cannot be generated.
    """

    def make_function(make: Maker) -> Function:
        function = with_parameters(make, robot, wrench, free_parameters)
        _ = function.program  # raises NotImplementedError if it cannot be generated
        return function

    try:
        functions = [make_function(link_torques_function), make_function(inverse_dynamics_function)]
    except NotImplementedError:
        if free_parameters:
            check_parameters(robot, wrench, free_parameters)
        raise
    omitted = []
    try:
        functions.append(make_function(feedback_linearization_function))
    except (InputError, NotImplementedError) as error:
        omitted.append(f"no feedback_linearization: {error.__cause__ or error}")
    try:
        derivative = make_function(state_derivative_function)
        functions += [derivative, step_function(robot, derivative)]
    except (InputError, NotImplementedError) as error:
        omitted.append(f"no state_derivative and no step: {error.__cause__ or error}")
    return functions, omitted


def _check_loops(robot: Robot, functions: Sequence[Function]) -> None:
    """Raise an error if the code contains loops.

    Raises:
        InputError: joints need loops; names them.
    """
    if not any(worst_cost(function.program).loops for function in functions):
        return
    base_joints = (dataclasses.replace(joint, parent=None, mount=None) for joint in robot.joints)
    single_joint_robots = (dataclasses.replace(robot, joints=(joint,), tools=()) for joint in base_joints)
    names = [
        single_joint.joints[0].name
        for single_joint in single_joint_robots
        if worst_cost(inverse_dynamics_function(single_joint).program).loops
    ]
    subject = f"{', '.join(names)} of {robot.name} {'is' if len(names) == 1 else 'are'} solved by iteration"
    raise InputError.one(
        f"{subject}; only pairs of equal cubic, sinh, exponential or quadratic springs have a closed-form "
        "solution"
    )


def prefix_of(robot: Robot) -> str:
    """Return the prefix of names in C: the robot's name in lower case, with other characters replaced."""
    name = re.sub(r"\W+", "_", robot.name.lower(), flags=re.ASCII).strip("_")
    return name if re.match(r"[a-z]", name) else f"robot_{name}".rstrip("_")


def write(project: Project, folder: str | Path, outputs: Outputs) -> None:
    """Write the files into a folder, which is created if necessary.

    Raises:
        StorageError: see `Outputs.folder` and `Outputs.file`.
    """
    outputs.folder(folder)
    for name, text in project.files.items():
        outputs.file(Path(folder) / name).write_text(text)
